"""Spread particles evenly over a mesh: scatter too many, thin them out, then let them push each other along the surface."""

from collections.abc import Callable

import numpy as np
import trimesh
import warp as wp

from sampler.distance import SignedDistance

_SCATTERED = 6  # random points per wanted particle
_ROUNDS = 60
_REACH = 2.0  # of the repulsion, in spacings


@wp.kernel(enable_backward=False, module="unique")
def push_apart(grid: wp.uint64, points: wp.array(dtype=wp.vec3), reach: float, pushed: wp.array(dtype=wp.vec3), strength: float):
    """Move each point by ``sum_j phi(d) (p - p_j)/d`` with a Gaussian phi that has faded at ``reach`` (source document A)."""
    i = wp.tid()
    here = points[i]
    push = wp.vec3(0.0)
    for j in wp.hash_grid_query(grid, here, reach):
        if j != i:
            away = here - points[j]
            distance = wp.length(away)
            if distance < reach and distance > 0.0:
                share = distance / reach
                push += away / distance * (wp.exp(-8.0 * share * share) - wp.exp(-8.0))
    pushed[i] = here + push * strength


def particle_count(area: float, spacing: float) -> int:
    """Particles that cover an area [m^2] as a triangular lattice of the given spacing [m]: ``A / (sqrt(3)/2 h^2)``."""
    return max(1, round(area / (np.sqrt(3.0) / 2.0 * spacing**2)))


def spread_particles(
    mesh: trimesh.Trimesh,
    field: SignedDistance,
    spacing: float,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> np.ndarray:
    """Spread particles over the surface of a mesh.

    Args:
        mesh: in metres.
        field: distance to the same mesh.
        spacing: wanted distance between neighbours [m].
        seed: of the random start.
        progress: called with the share of the work done, 0 to 1.

    Returns:
        Particle centres on the surface, shape (n, 3) [m].
    """
    number = particle_count(mesh.area, spacing)
    random = np.random.default_rng(seed)
    scattered, _ = trimesh.sample.sample_surface(mesh, _SCATTERED * number, seed=int(random.integers(1 << 31)))
    points = _thin_out(np.asarray(scattered), number, spacing)
    return _relax(points, field, spacing, progress)


def _thin_out(points: np.ndarray, number: int, spacing: float) -> np.ndarray:
    """Keep points at least 0.7 spacings apart, first come first kept, up to the wanted number."""
    cell = 0.7 * spacing
    taken: dict[tuple, list[np.ndarray]] = {}
    kept = []
    for point in points:
        x, y, z = (int(c) for c in np.floor(point / cell))
        near = (taken.get((x + i, y + j, z + k), ()) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1))
        if all(np.sum((point - other) ** 2) >= cell**2 for group in near for other in group):
            taken.setdefault((x, y, z), []).append(point)
            kept.append(point)
            if len(kept) == number:
                break
    return np.array(kept)


def _relax(points: np.ndarray, field: SignedDistance, spacing: float, progress) -> np.ndarray:
    device, reach = field.device, _REACH * spacing
    grid = wp.HashGrid(64, 64, 64, device=device)
    pushed = wp.zeros(len(points), dtype=wp.vec3, device=device)
    for turn in range(_ROUNDS):
        here = wp.array(points.astype(np.float32), dtype=wp.vec3, device=device)
        grid.build(here, reach)
        strength = 0.25 * spacing * (1.0 - 0.8 * turn / _ROUNDS)
        wp.launch(push_apart, dim=len(points), inputs=[grid.id, here, reach, pushed, strength], device=device)
        _, points, _ = field.query(pushed.numpy())
        progress((turn + 1) / _ROUNDS)
    return points.astype(float)
