"""Closing holes: boundary loops of a component and the triangles of least area that span them."""

from dataclasses import dataclass

import numpy as np

from sampler.geometry.loops import span_loops
from sampler.geometry.surface import Surface
from sampler.geometry.topology import edges_of
from sampler.mending.bridges import bridge, facing_rims


@dataclass(frozen=True)
class Caps:
    """What closes holes.

    Attributes:
        faces: oriented as their component, shape (k, 3).
        owner: component of each, shape (k,).
        loop: number of the boundary loop that each helps to close, shape (k,): one of n corners takes n - 2 faces.
        loops: corners of each loop, in the direction in which its cap runs along it.
        turn: by how much each turns at its corners in all, within the surface it bounds [rad], shape (loops,).
    """

    faces: np.ndarray
    owner: np.ndarray
    loop: np.ndarray
    loops: list[np.ndarray]
    turn: np.ndarray


def close_holes(vertices: np.ndarray, faces: np.ndarray, component: np.ndarray, bridged: bool = False) -> Caps:
    """Span all boundary loops of consistently oriented components.

    Args:
        vertices: shape (n, 3) [m].
        faces: shape (m, 3).
        component: of each face, shape (m,).
        bridged: where two loops are the ends of one gap, close it by one bridge instead of a cap each.
    """
    found = list(boundary_loops(faces, component))
    owner, loops = np.array([owner for owner, _ in found], np.int64), [loop for _, loop in found]
    turn = _turns(vertices, faces, component, owner, loops)
    area = np.bincount(component, Surface.areas_of(vertices[faces]))
    pairs = facing_rims(vertices, faces, owner, loops, turn, area) if bridged else []
    bridges = [bridge(vertices, loops[first], loops[second]) for first, second in pairs]
    alone = np.setdiff1d(np.arange(len(loops)), np.array(pairs, np.int64))
    caps = span_loops(vertices, [loops[k] for k in alone]) + [triangles for _, triangles in bridges]
    loops = [loops[k] for k in alone] + [loop for loop, _ in bridges]
    first, second = np.array(pairs, np.int64).reshape(-1, 2).T
    owner, turn = np.concatenate([owner[alone], owner[first]]), np.concatenate([turn[alone], turn[first] + turn[second]])
    number = [len(cap) for cap in caps]
    spanned = np.concatenate([np.zeros((0, 3), np.int64), *caps])
    return Caps(spanned, np.repeat(owner, number), np.repeat(np.arange(len(number)), number), loops, turn)


def _turns(vertices, faces, component, owner: np.ndarray, loops: list[np.ndarray]) -> np.ndarray:
    """Sum over each loop of what the angles of the faces at its corners differ from half a turn [rad].

    Bends of the surface do not count: around the rims of a bent strip and of a flat one it is once round, for convex corners.
    """
    if not loops:
        return np.zeros(0)
    number = [len(loop) for loop in loops]
    corner = np.repeat(owner, number) * len(vertices) + np.concatenate(loops)
    known, which = np.unique(corner, return_inverse=True)
    asked = component[:, None] * len(vertices) + faces
    place = np.searchsorted(known, asked).clip(max=len(known) - 1)
    face, k = np.nonzero(known[place] == asked)
    here, after, before = (vertices[faces[face, (k + step) % 3]] for step in range(3))
    p, q = after - here, before - here
    angle = np.arctan2(np.linalg.norm(np.cross(p, q), axis=1), np.einsum("ij,ij->i", p, q))
    off = np.abs(np.pi - np.bincount(place[face, k], angle, len(known)))
    return np.bincount(np.repeat(np.arange(len(loops)), number), off[which.ravel()])


def boundary_loops(faces: np.ndarray, component: np.ndarray):
    """Yield the component and the vertex numbers of each boundary loop, in the direction in which a cap runs along it."""
    edges = edges_of(faces)
    key = edges.edge * (int(component.max()) + 1) + component[edges.face]
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    net = np.bincount(group, np.where(edges.forward, 1, -1)).astype(int)
    follow: dict[tuple[int, int], list[int]] = {}
    for k in np.flatnonzero(net):
        low, high = edges.ends[edges.edge[first[k]]].tolist()
        owner = int(component[edges.face[first[k]]])
        tail, head = (high, low) if net[k] > 0 else (low, high)
        follow.setdefault((owner, tail), []).extend([head] * abs(net[k]))
    for owner, start in list(follow):
        while follow[owner, start]:
            path, place = [start], {start: 0}
            while follow.get((owner, path[-1])):
                head = follow[owner, path[-1]].pop()
                if head in place:
                    loop = path[place[head] :]
                    for vertex in loop[1:]:
                        del place[vertex]
                    path = path[: place[head] + 1]
                    if len(loop) > 2:
                        yield owner, np.array(loop)
                else:
                    place[head] = len(path)
                    path.append(head)
