"""Sewing open edges together: cracks between faces that were meant to meet."""

import numpy as np
import warp as wp

from sampler.geometry.surface import Surface
from sampler.geometry.topology import Edges, edges_of, link_items

_FARTHEST = 2e-3  # of the diagonal
_SHARE = 0.25  # of the length of open edges and of the height of triangles over them; more would close triangles
_ROUNDS = 4
_OPPOSED = -0.7  # cosine between normals from which two holes of one surface are in the two skins of a wall


@wp.func
def farther(a: wp.vec3, b: wp.vec3, p: wp.vec3, q: wp.vec3) -> float:
    """The longer of the ways from a to p and from b to q."""
    return wp.max(wp.length(a - p), wp.length(b - q))


@wp.kernel(enable_backward=False, module="sampler_welding")
def find_partner_edge(
    grid: wp.uint64,
    middles: wp.array(dtype=wp.vec3),
    tails: wp.array(dtype=wp.vec3),
    heads: wp.array(dtype=wp.vec3),
    reach: wp.array(dtype=float),
    partner: wp.array(dtype=int),
):
    """Other edge with the nearest ends, both within reach of both: its number, or -2 less it if turned round; -1 for none."""
    i = wp.tid()
    least = reach[i]
    best = int(-1)
    for j in wp.hash_grid_query(grid, middles[i], reach[i]):
        if j != i:
            along = farther(tails[i], heads[i], tails[j], heads[j])
            against = farther(tails[i], heads[i], heads[j], tails[j])
            if wp.min(along, against) <= wp.min(least, reach[j]):
                least = wp.min(along, against)
                best = wp.where(against < along, -2 - j, j)
    partner[i] = best


@wp.kernel(enable_backward=False, module="sampler_welding")
def find_partner_vertex(
    grid: wp.uint64, points: wp.array(dtype=wp.vec3), reach: wp.array(dtype=float), partner: wp.array(dtype=int)
):
    """Nearest other point within the reach of both; -1 for none."""
    i = wp.tid()
    here = points[i]
    least = reach[i]
    best = int(-1)
    for j in wp.hash_grid_query(grid, here, reach[i]):
        distance = wp.length(points[j] - here)
        if j != i and distance <= wp.min(least, reach[j]):
            least = distance
            best = j
    partner[i] = best


def sew_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Vertex that each vertex is joined with, itself in most cases, shape (n,).

    First those at the ends of open edges that lie beside one another, then single ones at open edges, as where a long edge meets
    two short ones; only over a small part of the length of those edges. Holes in the two skins of a thin wall are no crack.

    Args:
        vertices: shape (n, 3) [m].
        faces: shape (m, 3).
    """
    same = np.arange(len(vertices))
    diagonal = float(np.linalg.norm(np.ptp(vertices[faces].reshape(-1, 3), axis=0)))
    for turn in range(1 + _ROUNDS):
        edges = edges_of(same[faces])
        rim = edges.of(1)[:, 0]
        rim = rim[np.diff(edges.ends[edges.degree == 1], axis=1)[:, 0] != 0]
        if not len(rim):
            break
        face, corner = np.divmod(edges.half[rim], 3)
        corners = same[faces[face[:, None], (corner[:, None] + np.arange(3)) % 3]]  # the open edge's, then the opposite one
        links = (_vertex_links if turn else _edge_links)(vertices, corners, diagonal)
        links = links[~_through_walls(vertices, same[faces], edges, face, corners[:, :2], links)]
        if len(links):
            group, _, _ = link_items(len(vertices), *links.T)
            first = np.full(int(group.max()) + 1, -1)
            first[group[::-1]] = np.arange(len(vertices))[::-1]
            same = first[group][same]
        elif turn:
            break
    return same


def _edge_links(vertices: np.ndarray, corners: np.ndarray, diagonal: float) -> np.ndarray:
    """Vertices to be joined because open edges, first two corners of triangles, are the nearest to each other; shape (k, 2)."""
    ends = corners[:, :2]
    points = (vertices[corners] - vertices[ends].mean(axis=(0, 1))) / diagonal
    along, aside = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    length = np.linalg.norm(along, axis=1)
    height = np.linalg.norm(np.cross(along, aside), axis=1) / length
    reach = np.minimum(_FARTHEST, _SHARE * np.minimum(length, height))
    inputs = [_vectors(x) for x in (points[:, :2].mean(axis=1), points[:, 0], points[:, 1])]
    found = _ask(find_partner_edge, inputs, reach)
    partner = np.where(found < -1, -2 - found, found)
    mutual = np.flatnonzero((partner >= 0) & (partner[partner] == np.arange(len(partner))))
    others = ends[partner[mutual]]
    others = np.where((found[mutual] < -1)[:, None], others[:, ::-1], others)
    links = np.concatenate([np.stack([ends[mutual, k], others[:, k]], axis=1) for k in (0, 1)])
    return links[links[:, 0] != links[:, 1]]


def _vertex_links(vertices: np.ndarray, corners: np.ndarray, diagonal: float) -> np.ndarray:
    """Vertices to be joined because they are near to each other, at open edges, first two corners of triangles; shape (k, 2)."""
    ends = corners[:, :2]
    length = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
    shortest = np.full(len(vertices), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(length, 2))
    open_ = np.unique(ends)
    points = (vertices[open_] - vertices[open_].mean(axis=0)) / diagonal
    partner = _ask(find_partner_vertex, [_vectors(points)], np.minimum(_FARTHEST, _SHARE * shortest[open_] / diagonal))
    found = np.flatnonzero(partner >= 0)
    return np.stack([open_[found], open_[partner[found]]], axis=1)


def _through_walls(vertices, faces, edges: Edges, face: np.ndarray, ends: np.ndarray, links: np.ndarray) -> np.ndarray:
    """Whether links join two holes of one surface whose faces, turned to agree with one another, look opposite ways; shape (k,).

    Open edges are those of faces with such numbers, shape (n,), between such vertices, shape (n, 2).
    """
    pair = edges.of(2)
    turn = edges.forward[pair[:, 0]] == edges.forward[pair[:, 1]]
    part, turned, _ = link_items(len(faces), *edges.face[pair].T, turn)
    hole, _, _ = link_items(len(vertices), *ends.T)
    of_vertex = np.full(len(vertices), -1)
    of_vertex[ends] = part[face, None]
    through = (of_vertex[links[:, 0]] == of_vertex[links[:, 1]]) & (hole[links[:, 0]] != hole[links[:, 1]])
    if through.any():
        upward, normal = Surface.normals_of(vertices[faces[face]]), np.zeros((len(vertices), 3))
        for k in (0, 1):
            np.add.at(normal, ends[:, k], np.where(turned[face, None], -upward, upward))
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
        through &= np.einsum("ij,ij->i", *normal[links.T]) < _OPPOSED
    return through


def _ask(kernel, inputs: list[wp.array], reach: np.ndarray) -> np.ndarray:
    """Partners that a kernel finds for points, the first of the inputs, within their reach; shape (n,) int."""
    grid = wp.HashGrid(128, 128, 128, device="cpu")
    grid.build(inputs[0], max(float(reach.max()), 1e-6))
    partner = wp.empty(len(reach), dtype=int, device="cpu")
    limit = wp.array(reach.astype(np.float32), dtype=float, device="cpu")
    wp.launch(kernel, dim=len(reach), inputs=[grid.id, *inputs, limit, partner], device="cpu")
    return partner.numpy()


def _vectors(values: np.ndarray) -> wp.array:
    return wp.array(values.astype(np.float32), dtype=wp.vec3, device="cpu")
