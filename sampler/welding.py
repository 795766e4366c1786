"""Sewing open edges together: cracks between faces that were meant to meet."""

import numpy as np
import warp as wp

from sampler.topology import edges_of, link_items

_FARTHEST = 2e-3  # of the diagonal
_SHARE = 0.25  # of the shortest open edge at a vertex; more would close triangles
_ROUNDS = 4


@wp.kernel(enable_backward=False, module="sampler_welding")
def find_partner(
    grid: wp.uint64, points: wp.array(dtype=wp.vec3), reach: wp.array(dtype=float), widest: float, partner: wp.array(dtype=int)
):
    """Nearest other point within the reach of both; -1 for none."""
    i = wp.tid()
    here = points[i]
    least = reach[i]
    best = int(-1)
    for j in wp.hash_grid_query(grid, here, widest):
        distance = wp.length(points[j] - here)
        if j != i and distance <= wp.min(least, reach[j]):
            least = distance
            best = j
    partner[i] = best


def sew_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Vertex that each vertex is joined with, itself in most cases, shape (n,).

    Only vertices at open edges are joined, and only over a small part of the length of those edges.

    Args:
        vertices: shape (n, 3) [m].
        faces: shape (m, 3).
    """
    same = np.arange(len(vertices))
    diagonal = float(np.linalg.norm(np.ptp(vertices[faces].reshape(-1, 3), axis=0)))
    for _ in range(_ROUNDS):
        edges = edges_of(same[faces])
        ends = edges.ends[(edges.degree == 1) & (edges.ends[:, 0] != edges.ends[:, 1])]
        if not len(ends):
            break
        length = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
        shortest = np.full(len(vertices), np.inf)
        np.minimum.at(shortest, ends.ravel(), np.repeat(length, 2))
        open_ = np.unique(ends)
        reach = np.minimum(_FARTHEST * diagonal, _SHARE * shortest[open_])
        partner = _partners((vertices[open_] - vertices[open_].mean(axis=0)) / diagonal, reach / diagonal)
        found = np.flatnonzero(partner >= 0)
        if not len(found):
            break
        group, _, _ = link_items(len(open_), found, partner[found])
        first = np.full(int(group.max()) + 1, -1)
        first[group[::-1]] = open_[::-1]
        joined = np.arange(len(vertices))
        joined[open_] = first[group]
        same = joined[same]
    return same


def _partners(points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    widest = max(float(reach.max()), 1e-6)
    here = wp.array(points.astype(np.float32), dtype=wp.vec3, device="cpu")
    grid = wp.HashGrid(128, 128, 128, device="cpu")
    grid.build(here, widest)
    partner = wp.empty(len(points), dtype=int, device="cpu")
    limit = wp.array(reach.astype(np.float32), dtype=float, device="cpu")
    wp.launch(find_partner, dim=len(points), inputs=[grid.id, here, limit, widest, partner], device="cpu")
    return partner.numpy()
