"""From places that are far from all particles to the farthest ones near by."""

import numpy as np
import warp as wp

from sampler.geometry.closest import closest_point
from sampler.geometry.surface import ASIDE, nearest_face
from sampler.geometry.topology import merge_points
from sampler.launching import launch_shares
from sampler.particles.cells import Cells
from sampler.particles.gap_kernels import MODULE, nearest_particles
from sampler.particles.skin import Skin

_STARTS = 150  # places to climb from
_CELL = 0.5  # of those with the same particle nearest one in each cell of so many spacings, so that they lie in many gaps
_KNOWN = 20  # the worst places among which they are chosen, per start
_FIRST, _SHORTER = wp.constant(0.12), wp.constant(0.7)  # length of the first step, in spacings, and of each next, of that before
_BACK = wp.constant(1.0e-4)  # of the diagonal: how much farther than they went places are sought back


@wp.kernel(enable_backward=False, module=MODULE)
def climb_from(
    cells: Cells,
    mesh: wp.uint64,
    corners: wp.array(dtype=wp.vec3),
    face_normals: wp.array(dtype=wp.vec3),
    spacing: float,
    most: float,
    along: int,
    steps: int,
    trials: int,
    seed: int,
    first: int,
    places: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    ways: wp.array(dtype=float),
):
    """Take each place to the worst one near by, step by step; each step is the best of some at random that are better."""
    i = first + wp.tid()
    random = wp.rand_init(seed, i)
    length = _FIRST * spacing
    for _ in range(steps):
        here = places[i]
        up = normals[i]
        for _ in range(trials):
            aside = length * wp.vec3(wp.randn(random), wp.randn(random), wp.randn(random))
            face = nearest_face(mesh, here + aside, 1.01 * wp.length(aside) + _BACK, up, ASIDE)
            if face >= 0:
                there = closest_point(corners[3 * face], corners[3 * face + 1], corners[3 * face + 2], here + aside)
                closest, own = nearest_particles(cells, there, face_normals[face], spacing, most)
                way = wp.where(along == 1, own.way, closest.way)
                if way > ways[i]:
                    places[i] = there
                    normals[i] = face_normals[face]
                    ways[i] = way
        length *= _SHORTER


def climb(
    skin: Skin,
    cells: Cells,
    known: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    along: bool,
    steps: tuple[int, int],
    spacing: float,
    most: float,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Climb from the worst places to the worst ones near by: random places miss these by some percent.

    Args:
        skin: where they lie.
        cells: the particles, with lists.
        known: places to begin with, shape (n, 3) float32, the normals there, shape (n, 3), the particles nearest to them, shape
            (n,), and how far these are, shape (n,), in spacings.
        along: whether ways along the surface are meant.
        steps: how many, each shorter than that before; and the best of how many trials each is.
        spacing: of the particles, in the kernels' unit as all places.
        most: how far particles are looked for, in spacings.
        random: where chance comes from.

    Returns:
        The worst places, shape (m, 3) float32, the normals there, shape (m, 3), and their distances, shape (m,), in spacings.
    """
    points, normals, which, way = known
    number = min(_KNOWN * _STARTS, len(points))
    order = np.argpartition(-way, number - 1)[:number]
    order = order[np.argsort(-way[order], kind="stable")]
    cell = merge_points(np.floor(points[order] / (_CELL * spacing)))
    first = np.unique(which[order].astype(np.int64) * number + cell, return_index=True)[1]
    chosen = order[np.sort(first)[:_STARTS]]
    places, up = (wp.array(x[chosen], dtype=wp.vec3, device=skin.device) for x in (points, normals))
    ways = wp.array(way[chosen], dtype=float, device=skin.device)
    options = [spacing, most, int(along), *steps, int(random.integers(2**31))]
    launch_shares(climb_from, len(chosen), [cells, *skin.faces, *options], [places, up, ways], skin.device)
    return places.numpy(), up.numpy(), ways.numpy()
