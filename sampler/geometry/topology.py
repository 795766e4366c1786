"""How triangles hang together: shared edges, components, and which of them must be turned to agree with their neighbours.

Graph work is sequential; it runs as single-threaded Warp kernels on the CPU, half a million triangles in well under a second.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp


@wp.kernel(enable_backward=False, module="sampler_topology")
def link(
    a: wp.array(dtype=int),
    b: wp.array(dtype=int),
    turn: wp.array(dtype=int),
    root: wp.array(dtype=int),
    parity: wp.array(dtype=int),
    clash: wp.array(dtype=int),
):
    """Union-find with parity over all links ``a[k], b[k]``; ``turn`` 1 where exactly one of the two must be turned."""
    for k in range(a.shape[0]):
        i = a[k]
        p = int(0)
        while root[i] != i:
            above = root[i]
            parity[i] = parity[i] ^ parity[above]
            root[i] = root[above]
            p = p ^ parity[i]
            i = root[i]
        j = b[k]
        q = int(0)
        while root[j] != j:
            above = root[j]
            parity[j] = parity[j] ^ parity[above]
            root[j] = root[above]
            q = q ^ parity[j]
            j = root[j]
        if i != j:
            low = wp.min(i, j)
            root[wp.max(i, j)] = low
            parity[wp.max(i, j)] = p ^ q ^ turn[k]
        elif p ^ q != turn[k]:
            clash[0] = clash[0] + 1


@dataclass(frozen=True)
class Edges:
    """Undirected edges of triangles and the half-edges on them.

    Attributes:
        ends: vertex numbers, lower first, shape (edges, 2).
        half: half-edges sorted by edge, three times their triangle plus the corner they start at.
        forward: whether each of these runs from the lower vertex to the higher.
        start: first half-edge of each edge, and one entry more, shape (edges + 1,).
    """

    ends: np.ndarray
    half: np.ndarray
    forward: np.ndarray
    start: np.ndarray

    @cached_property
    def face(self) -> np.ndarray:
        """Triangle of each half-edge."""
        return self.half // 3

    @cached_property
    def edge(self) -> np.ndarray:
        """Edge of each half-edge, its row in ``ends``."""
        return np.repeat(np.arange(len(self.ends)), self.degree)

    @cached_property
    def degree(self) -> np.ndarray:
        """Triangles at each edge, shape (edges,)."""
        return np.diff(self.start)

    def of(self, degree: int) -> np.ndarray:
        """Numbers of the half-edges of all edges with so many triangles, shape (n, degree)."""
        return self.start[:-1][self.degree == degree][:, None] + np.arange(degree)


def edges_of(faces: np.ndarray) -> Edges:
    """Edges of triangles, shape (n, 3)."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(tail, head).astype(np.int64), np.maximum(tail, head).astype(np.int64)
    key = low * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    ends = np.stack([low[order][first], high[order][first]], axis=1)
    return Edges(ends, order, (tail < head)[order], np.append(first, len(order)))


def halves_around(vertices: np.ndarray, faces: np.ndarray, edges: Edges, k: int) -> np.ndarray:
    """Numbers of the half-edges on an edge in the order in which their triangles lie around it.

    Angles grow right-handed about the way from the vertex of the lower number to the other.

    Args:
        vertices: shape (n, 3) [m].
        faces: shape (m, 3).
        edges: of the faces.
        k: number of the edge.
    """
    half = np.arange(edges.start[k], edges.start[k + 1])
    low, high = vertices[edges.ends[k]]
    axis = (high - low) / (np.linalg.norm(high - low) or 1.0)
    tip = vertices[faces[edges.face[half]]].sum(axis=1) - low - high - low  # the corner opposite to the edge, from there
    away = tip - np.outer(tip @ axis, axis)
    length = np.linalg.norm(away, axis=1)
    side = away[length.argmax()] / (length.max() or 1.0)
    return half[np.argsort(np.arctan2(away @ np.cross(axis, side), away @ side))]


def link_items(number: int, a: np.ndarray, b: np.ndarray, turn: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, int]:
    """Join items that are linked.

    Args:
        number: of items.
        a: first of two linked items, shape (n,); earlier links win where they contradict one another.
        b: second of two linked items, shape (n,).
        turn: whether exactly one of the two must be turned, shape (n,); never if None.

    Returns:
        Group of each item, numbered from 0 without gaps, shape (number,); whether it must be turned for its group to agree,
        shape (number,); number of links that contradict others.
    """
    root = wp.array(np.arange(number), dtype=int, device="cpu")
    parity, clash = wp.zeros(number, dtype=int, device="cpu"), wp.zeros(1, dtype=int, device="cpu")
    turn = np.zeros(len(a), np.int32) if turn is None else turn
    if len(a):
        given = [wp.array(np.ascontiguousarray(x, np.int32), dtype=int, device="cpu") for x in (a, b, turn)]
        wp.launch(link, dim=1, inputs=[*given, root, parity, clash], device="cpu")
    roots, turned = root.numpy(), parity.numpy()
    while np.any(roots[roots] != roots):
        turned = turned ^ np.where(roots[roots] != roots, turned[roots], 0)
        roots = roots[roots]
    _, group = np.unique(roots, return_inverse=True)
    return group, turned.astype(bool), int(clash.numpy()[0])


def merge_points(points: np.ndarray) -> np.ndarray:
    """First of the points, shape (n, 3) [m], that are identical to each one, shape (n,)."""
    points = points + 0.0  # -0.0 becomes 0.0
    bits = np.ascontiguousarray(points, np.float64).view(np.uint64)
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = bits * factors
    mixed ^= mixed >> np.uint64(29)
    key = (mixed * np.array([3, 5, 7], np.uint64)).sum(axis=1, dtype=np.uint64)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    same = first[inverse]
    different = np.any(points[same] != points, axis=1)  # two points of one key: next to impossible, then kept apart
    return np.where(different, np.arange(len(points)), same)
