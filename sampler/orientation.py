"""Turning faces so that neighbours agree and solids look outward."""

import numpy as np

from sampler.surface import Surface
from sampler.topology import Edges, edges_of, halves_around, link_items

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_VOTERS = 100  # largest faces of a piece, which tell what side of it is the inside


def agree_faces(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Turn faces so that neighbours run along their common edges in opposite directions.

    Where more than two faces share an edge, those next to one another around it should agree, and do if two of them are one face
    of two solids and as many run along it one way as the other; a majority of such edges decides for each pair of pieces.

    Returns:
        Faces, shape (n, 3); component of each, shape (n,); piece without many-sided edges that each belongs to, shape (n,);
        number of faces turned; number of edges that contradict the rest.
    """
    edges = edges_of(faces)
    pair = edges.of(2)
    a, b = edges.face[pair].T
    turn = edges.forward[pair[:, 0]] == edges.forward[pair[:, 1]]
    group, turned, clashes = link_items(len(faces), a, b, turn)
    piece = group
    if np.any(edges.degree > 2):
        a, b, turn = _many_sided(vertices, faces, edges, group, turned)
        joined, flip, _ = link_items(int(group.max()) + 1, a, b, turn)
        turned, group = turned ^ flip[group], joined[group]
    area = Surface.areas_of(vertices[faces])
    minority = 2.0 * np.bincount(group, area * turned) > np.bincount(group, area)
    turned ^= minority[group]
    return np.where(turned[:, None], faces[:, ::-1], faces), group, piece, int(turned.sum()), clashes


def _many_sided(vertices: np.ndarray, faces: np.ndarray, edges: Edges, group: np.ndarray, turned: np.ndarray):
    """Pairs of pieces that meet at edges with more than two faces, most decided first, and whether one of them must be turned."""
    votes: dict[tuple[int, int], int] = {}
    several = np.unique(edges.face[edges.degree[edges.edge] > 2])
    _, same, count = np.unique(np.sort(faces[several], axis=1), axis=0, return_inverse=True, return_counts=True)
    twin = np.zeros(len(faces), bool)
    twin[several] = count[same.ravel()] > 1
    for k in np.flatnonzero(edges.degree > 2):
        pieces = group[edges.face[edges.start[k] : edges.start[k + 1]]]
        if np.all(pieces == pieces[0]):
            continue
        half = halves_around(vertices, faces, edges, k)
        face = edges.face[half]
        runs = edges.forward[half] ^ turned[face]
        agree = twin[face].any() and 2 * runs.sum() == len(runs)
        for p, q, alike in zip(group[face], np.roll(group[face], -1), runs == np.roll(runs, -1), strict=True):
            if p != q:
                pair = int(min(p, q)), int(max(p, q))
                votes[pair] = votes.get(pair, 0) + (1 if alike and not agree else -1)
    ranked = sorted((pair for pair in votes if votes[pair]), key=lambda pair: -abs(votes[pair]))
    a, b = (np.array([pair[k] for pair in ranked], int) for k in (0, 1))
    return a, b, np.array([votes[pair] > 0 for pair in ranked], bool)


def face_outward(vertices: np.ndarray, faces: np.ndarray, component: np.ndarray, sheet: np.ndarray) -> tuple[np.ndarray, int]:
    """Turn solids that face inward, but not the cavities of others.

    Args:
        vertices: shape (n, 3) [m].
        faces: closed or nearly, shape (m, 3).
        component: of each face, shape (m,).
        sheet: faces without an inside, which stay as they are, shape (m,).

    Returns:
        Faces and the number of components turned.
    """
    triangles = vertices[faces]
    local = triangles - triangles.mean(axis=(0, 1))
    part = np.einsum("ij,ij->i", local[:, 0], np.cross(local[:, 1], local[:, 2])) / 6.0
    volume = np.bincount(component, np.where(sheet, 0.0, part))
    all_turned = volume.sum() < 0.0
    inward = (volume > 0.0) if all_turned else (volume < 0.0)
    if inward.any() and not inward.all():
        outer = ~inward[component] & ~sheet
        around = Surface(triangles[outer][:, ::-1] if all_turned else triangles[outer])
        first = np.array([np.flatnonzero(component == c)[0] for c in np.flatnonzero(inward)])
        nested = around.winding(triangles[first].mean(axis=1)) > 0.5
        inward[np.flatnonzero(inward)[nested]] = False
    turned = inward ^ all_turned
    turned &= volume != 0.0
    return np.where(turned[component][:, None], faces[:, ::-1], faces), int(turned.sum())


def inward_pieces(triangles: np.ndarray, piece: np.ndarray, around: Surface) -> np.ndarray:
    """Find pieces that face inward in spite of their neighbours.

    Args:
        triangles: shape (n, 3, 3) [m].
        piece: of each triangle, shape (n,).
        around: all surfaces.

    Returns:
        Faces of such pieces, shape (n,) bool; the largest faces of a piece decide.
    """
    area = Surface.areas_of(triangles)
    order = np.lexsort([-area, piece])
    begin = np.searchsorted(piece[order], piece[order])
    asked = order[np.arange(len(order)) - begin < _VOTERS]
    before, behind = _sides(triangles[asked], around)
    inward = (before < -0.5) & (np.abs(behind) < 0.5)
    outward = (behind > 0.5) & (np.abs(before) < 0.5)
    vote = np.bincount(piece[asked], area[asked] * (1.0 * inward - outward))
    return vote[piece] > 0.0


def outside_on_both_sides(triangles: np.ndarray, around: Surface) -> np.ndarray:
    """Triangles, shape (n, 3, 3) [m], without an inside on any side, shape (n,) bool."""
    before, behind = _sides(triangles, around)
    return (np.abs(before) < 0.5) & (np.abs(behind) < 0.5)


def _sides(triangles: np.ndarray, around: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Rough winding numbers closely before and behind the middles of triangles."""
    centre, step = triangles.mean(axis=1), _STEP * around.unit * Surface.normals_of(triangles)
    before = around.winding(centre + step, rough=True)
    return before, before + around.leavings(centre - step, centre + step)
