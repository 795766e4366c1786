"""How particles lie, in NumPy alone."""

import numpy as np
import trimesh


def distances(places, points):
    """From places to the nearest point, shape (places,)."""
    parts = np.array_split(places, 1 + len(places) * len(points) // 3_000_000)
    return np.concatenate([np.linalg.norm(part[:, None] - points, axis=2).min(axis=1) for part in parts])


def neighbours(points):
    """From points to the nearest other one, shape (points,)."""
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(apart, np.inf)
    return apart.min(axis=1)


def worst_on_a_box(extents, points, cells=80):
    """Farthest place of a box from points: over a grid, then finer around the worst of its places."""
    u = (np.arange(cells + 1) / cells - 0.5) * (1.0 - 1e-12)
    worst = 0.0
    for axis in range(3):
        for side in (-1.0, 1.0):
            place = np.stack(np.broadcast_arrays(side * 0.5, u[:, None], u[None, :]), axis=-1).reshape(-1, 3)
            step = 1.0 / cells
            for _ in range(4):
                found = distances(np.roll(place, axis, axis=1) * extents, points)
                best = place[np.argsort(-found)[:60]]
                step /= 4.0
                fine = step * (np.indices((9, 9)).reshape(2, -1).T - 4)
                place = (best[:, None] + np.column_stack([np.zeros(81), fine])).reshape(-1, 3)
                place = np.clip(place, -0.5, 0.5)
            worst = max(worst, found.max())
    return worst


def worst_place(mesh, points, number):
    """How far from all points the surface lies at most; where random places are far, many more are taken."""
    places, _ = trimesh.sample.sample_surface(mesh, number, seed=7)
    far = distances(places, points)
    more, _ = trimesh.sample.sample_surface(mesh, 20 * number, seed=8)
    cell = 0.2 * far.max()
    around = np.indices((3, 3, 3)).reshape(3, -1).T - 1
    numbers = np.array([1, 10**5, 10**10])
    doubtful = (np.floor(places[far > 0.9 * far.max()] / cell)[:, None] + around) @ numbers
    more = more[np.isin(np.floor(more / cell) @ numbers, doubtful)]
    return max(far.max(), distances(more, points).max())
