"""Turning faces so that neighbours agree and solids look outward."""

import numpy as np

from sampler.geometry.surface import Surface
from sampler.geometry.topology import Edges, edges_of, halves_around, link_items

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_NESTED = 0.9  # share of the area of a cavity's walls that lies inside of the solid; parts that overlap others come out of them
_VOTERS = 100  # largest faces of a piece, which tell what side of it is the inside


def agree_faces(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Turn faces so that neighbours run along their common edges in opposite directions.

    Where more than two faces share an edge and as many run along it one way as the other, they agree as they are: solids touch or
    overlap there. Elsewhere those next to one another around it should agree; a majority of such edges decides for each pair of
    pieces.

    Returns:
        Faces, shape (n, 3); component of each, shape (n,); piece without many-sided edges that each belongs to, shape (n,);
        number of faces turned; number of edges that contradict the rest.
    """
    edges, area = edges_of(faces), Surface.areas_of(vertices[faces])
    pair = edges.of(2)
    a, b = edges.face[pair].T
    turn = edges.forward[pair[:, 0]] == edges.forward[pair[:, 1]]
    group, turned, clashes = link_items(len(faces), a, b, turn)
    piece, turned = group, _as_most_is(turned, group, area)
    if np.any(edges.degree > 2):
        sound, *links = _sound_pieces(edges, group, turned, area)
        voted = _votes(vertices, faces, edges, group, turned, sound)
        links = np.concatenate([[*links, 0 * links[0]], voted], axis=1)
        joined, flip, _ = link_items(len(sound), *links)
        group = joined[group]
        turned = _as_most_is(turned ^ flip[piece], group, area)
    return np.where(turned[:, None], faces[:, ::-1], faces), group, piece, int(turned.sum()), clashes


def _as_most_is(turned: np.ndarray, group: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Which faces to turn where that of a group is right as it is of which there is more area."""
    return turned ^ (2.0 * np.bincount(group, area * turned) > np.bincount(group, area))[group]


def _sound_pieces(edges: Edges, piece: np.ndarray, turned: np.ndarray, area: np.ndarray) -> tuple[np.ndarray, ...]:
    """Pieces that, with all they hang together with, agree as they are, and which of them belong together.

    A piece that is closed by itself belongs to no other. Neither do partitions and fins: without them the others agree.

    Returns:
        Whether a piece is one, shape (pieces,); pairs that belong together, shape (n,) twice.
    """
    number = int(piece.max()) + 1
    half = np.flatnonzero(edges.degree[edges.edge] > 2)
    runs = np.where(edges.forward[half] ^ turned[edges.face[half]], 1, -1)
    ends, which = np.unique(np.column_stack([edges.edge[half], piece[edges.face[half]]]), axis=0, return_inverse=True)
    own = np.bincount(which.ravel(), runs).astype(int)  # how many more faces of a piece run one way along an edge
    ends, own = ends[own != 0], own[own != 0]
    edge, owner = np.unique(ends[:, 0], return_inverse=True)[1], ends[:, 1]
    surplus = np.bincount(edge, own, 1).astype(int)
    order = np.argsort(owner, kind="stable")
    begin = np.searchsorted(owner[order], np.arange(number + 1))
    loose = np.zeros(number, bool)
    for p in np.argsort(np.bincount(piece, area), kind="stable") if surplus.any() else ():
        mine = order[begin[p] : begin[p + 1]]
        if len(mine) and np.all(surplus[edge[mine]] == own[mine]):
            loose[p], surplus[edge[mine]] = True, 0
    beside = np.flatnonzero(edge[1:] == edge[:-1])
    cluster, _, _ = link_items(number, owner[beside], owner[beside + 1])
    sound = np.ones(number, bool)
    sound[cluster[owner[surplus[edge] != 0]]] = False
    sound = sound[cluster]
    kept = np.flatnonzero(sound[owner] & ~loose[owner])
    beside = np.flatnonzero(edge[kept[1:]] == edge[kept[:-1]])
    return sound, owner[kept[beside]], owner[kept[beside + 1]]


def _votes(vertices, faces, edges: Edges, group: np.ndarray, turned: np.ndarray, sound: np.ndarray) -> np.ndarray:
    """Pairs of other pieces that meet at edges, most decided first, and whether one of them must be turned; shape (3, n) int."""
    votes: dict[tuple[int, int], int] = {}
    for k in np.unique(edges.edge[(edges.degree[edges.edge] > 2) & ~sound[group[edges.face]]]):
        half = halves_around(vertices, faces, edges, k)
        half = half[~sound[group[edges.face[half]]]]
        pieces, runs = group[edges.face[half]], edges.forward[half] ^ turned[edges.face[half]]
        agree = 2 * runs.sum() == len(runs)
        for p, q, alike in zip(pieces, np.roll(pieces, -1), runs == np.roll(runs, -1), strict=True):
            if p != q:
                pair = int(min(p, q)), int(max(p, q))
                votes[pair] = votes.get(pair, 0) + (1 if alike and not agree else -1)
    ranked = sorted((pair for pair in votes if votes[pair]), key=lambda pair: -abs(votes[pair]))
    return np.array([(*pair, votes[pair] > 0) for pair in ranked], int).reshape(-1, 3).T


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
        asked = np.flatnonzero(inward[component])
        within = around.winding(triangles[asked].mean(axis=1), rough=True) > 0.5
        area = Surface.areas_of(triangles[asked])
        whole, inner = (np.bincount(component[asked], weight, len(inward)) for weight in (area, area * within))
        inward &= inner <= _NESTED * whole
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
    """Triangles, shape (n, 3, 3) [m], without an inside on any side, shape (n,) bool; those of no area have no sides."""
    before, behind = _sides(triangles, around)
    return (np.abs(before) < 0.5) & (np.abs(behind) < 0.5) & (Surface.areas_of(triangles) > 0.0)


def _sides(triangles: np.ndarray, around: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Rough winding numbers closely before and behind the middles of triangles."""
    centre, step = triangles.mean(axis=1), _STEP * around.unit * Surface.normals_of(triangles)
    before = around.winding(centre + step, rough=True)
    return before, before + around.leavings(centre - step, centre + step)
