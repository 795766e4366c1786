"""The surface of a smooth tool: its triangles in a tree of boxes, and the point of it that is nearest to a grain.

All in double precision and in the tool's frame, so that overlaps, which are tiny differences of large numbers, are exact.
"""

import math

import numpy as np
import warp as wp

from sand_sim.engine.count import part_start

_IN_LEAF = 4  # triangles at most
_MERGED = math.cos(math.radians(30.0))
IN_ROW = 4  # triangles that are noted in one row
FEW = 3 * IN_ROW  # in all: a grain has a row for each of its slots
_FLAT = 1e-9  # of the distance searched: corners that rise less above a face lie in its plane, which is rounded


@wp.struct
class TriangleTree:
    """A complete binary tree of boxes: nodes 2 k and 2 k + 1 are below node k, 1 is the root, the last ``leaves`` are leaves."""

    leaves: int  # a power of two; 0 for a tool without a tree
    first_node: int
    triangles: int
    first_triangle: int
    first_slot: int  # contacts are listed under partner numbers from here on


def plant_tree(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order triangles by halving them again and again along the longest extent of their centres.

    Args:
        triangles: corners, shape (n, 3, 3) [m]; those without area are left out.

    Returns:
        Corners [m] and unit normals in the order of the leaves, of which leaf k of m holds numbers ``n k // m`` to
        ``n (k + 1) // m``, shape (n, 4, 3); lower and upper corner of each node's box, shape (2 m, 2, 3) [m].
    """
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(cross, axis=1)
    triangles, normals = triangles[length > 0.0], cross[length > 0.0] / length[length > 0.0, None]
    number = len(triangles)
    levels = max(0, math.ceil(math.log2(number / _IN_LEAF)))
    centres, order = triangles.mean(axis=1), np.arange(number)
    for level in range(levels):
        starts = number * np.arange(2**level) // 2**level
        segment = np.repeat(np.arange(2**level), np.diff(starts, append=number))
        sorted_ = centres[order]
        axis = np.argmax(np.maximum.reduceat(sorted_, starts) - np.minimum.reduceat(sorted_, starts), axis=1)
        order = order[np.lexsort((sorted_[np.arange(number), axis[segment]], segment))]
    leaves = 2**levels
    starts, triangles = number * np.arange(leaves) // leaves, triangles[order]
    boxes = np.zeros((2 * leaves, 2, 3))
    boxes[leaves:, 0] = np.minimum.reduceat(triangles.min(axis=1), starts)
    boxes[leaves:, 1] = np.maximum.reduceat(triangles.max(axis=1), starts)
    for level in reversed(range(levels)):
        below = boxes[2 ** (level + 1) : 2 ** (level + 2)].reshape(-1, 2, 2, 3)
        boxes[2**level : 2 ** (level + 1), 0] = below[:, :, 0].min(axis=1)
        boxes[2**level : 2 ** (level + 1), 1] = below[:, :, 1].max(axis=1)
    return np.concatenate([triangles, normals[order][:, None]], axis=1), boxes


@wp.func
def nearest_on_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, face: wp.vec3d):
    """Distance [m] of a point from a triangle with unit normal ``face``, and unit vector to the point from the closest one.

    Right behind the face the distance is negative and the vector that of the face. Regions as in Ericson 2005 (Real-Time
    Collision Detection), 5.1.5.
    """
    zero = wp.float64(0.0)
    ab = b - a
    ac = c - a
    ap = p - a
    bp = p - b
    cp = p - c
    d1 = wp.dot(ab, ap)
    d2 = wp.dot(ac, ap)
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    of_a = d3 * d6 - d5 * d4
    of_b = d5 * d2 - d1 * d6
    of_c = d1 * d4 - d3 * d2
    normal = face
    distance = wp.dot(face, ap)
    away = ap
    inside = int(0)
    if d1 <= zero and d2 <= zero:
        away = ap
    elif d3 >= zero and d4 <= d3:
        away = bp
    elif d6 >= zero and d5 <= d6:
        away = cp
    elif of_c <= zero and d1 >= zero and d3 <= zero:
        away = ap - ab * (d1 / (d1 - d3))
    elif of_b <= zero and d2 >= zero and d6 <= zero:
        away = ap - ac * (d2 / (d2 - d6))
    elif of_a <= zero and d4 >= d3 and d5 >= d6:
        away = bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    else:
        inside = 1
    if inside == 0:
        distance = wp.length(away)
        if distance > zero:
            normal = away / distance
    return distance, normal


@wp.func
def stands_on(corners: wp.array(dtype=wp.vec3d), triangle: int, p: wp.vec3d, margin: wp.float64) -> bool:
    """Whether the perpendicular from a point meets a triangle farther than ``margin`` [m] from its sides."""
    a = corners[4 * triangle]
    b = corners[4 * triangle + 1]
    c = corners[4 * triangle + 2]
    face = corners[4 * triangle + 3]
    on_ab = wp.dot(wp.cross(face, b - a), p - a) > margin * wp.length(b - a)
    on_bc = wp.dot(wp.cross(face, c - b), p - b) > margin * wp.length(c - b)
    return on_ab and on_bc and wp.dot(wp.cross(face, a - c), p - c) > margin * wp.length(a - c)


@wp.func
def is_merged(away: wp.vec3d, distance: wp.float64, normals: wp.mat33d, distances: wp.vec3d, number: int) -> bool:
    """Whether a place of the surface belongs to one of the contacts found before.

    It does where its direction is within 30 degrees of the contact's, so that the facets of a rounded hollow are one contact; and
    where it lies no higher than the contact's tangent plane, which goes for all of a surface that is flat or bulges there.
    """
    merged = int(0)
    for k in range(number):
        along = wp.dot(away, normals[k])
        if along > wp.float64(wp.static(_MERGED)) * distance or along > wp.float64(0.999999) * distances[k]:
            merged = 1
    return merged > 0


@wp.func
def rises(corners: wp.array(dtype=wp.vec3d), triangle: int, over: int, slack: wp.float64) -> bool:
    """Whether a corner of a triangle is higher above the plane of another one than ``slack`` [m]."""
    up = corners[4 * over + 3]
    height = wp.dot(up, corners[4 * over]) + slack
    on_a = wp.dot(up, corners[4 * triangle]) > height
    on_b = wp.dot(up, corners[4 * triangle + 1]) > height
    return on_a or on_b or wp.dot(up, corners[4 * triangle + 2]) > height


@wp.func
def is_near(boxes: wp.array(dtype=wp.vec3d), node: int, p: wp.vec3d, limit: wp.float64, slack: wp.float64) -> bool:
    """Whether a box is nearer to a point than a limit [m]."""
    gap = wp.max(wp.max(boxes[2 * node] - p, p - boxes[2 * node + 1]), wp.vec3d(wp.float64(0.0)))
    return wp.dot(gap, gap) < limit * (limit + slack)


@wp.func
def triangles_in(tree: TriangleTree, leaf: int):
    """Begin and end of the triangles of a leaf."""
    first = part_start(tree.triangles, leaf - tree.leaves, tree.leaves)
    last = part_start(tree.triangles, leaf - tree.leaves + 1, tree.leaves)
    return tree.first_triangle + first, tree.first_triangle + last


@wp.func
def next_node(node: int) -> int:
    """The node to look at after one and all below it; 0 after the last."""
    after = node + 1
    while after % 2 == 0:
        after = after // 2
    if after == 1:
        after = 0
    return after


@wp.func
def is_nearer(
    corners: wp.array(dtype=wp.vec3d),
    triangle: int,
    p: wp.vec3d,
    nearest: wp.float64,
    slack: wp.float64,
    normals: wp.mat33d,
    distances: wp.vec3d,
    number: int,
):
    """Whether a triangle is nearer than the ``nearest`` so far [m], its distance [m] and its normal."""
    nearer = False
    distance = nearest
    way = wp.vec3d(wp.float64(0.0))
    least = wp.abs(nearest)
    a = corners[4 * triangle]
    face = corners[4 * triangle + 3]
    height = wp.dot(face, p - a)
    # Further contacts are in front of their faces, or a wall's back would count beside its front.
    if wp.abs(height) < least + slack and (number == 0 or height >= wp.float64(0.0)):
        distance, way = nearest_on_triangle(p, a, corners[4 * triangle + 1], corners[4 * triangle + 2], face)
        # Of a wall without thickness, which is there both ways, the side that faces the grain.
        before = wp.abs(distance) < least + slack and distance > nearest and nearest < wp.float64(0.0)
        if wp.abs(distance) < least or before:
            nearer = number == 0 or not is_merged(way * distance, distance, normals, distances, number)
    return nearer, distance, way


@wp.func
def nearest_on_tree(
    tree: TriangleTree,
    boxes: wp.array(dtype=wp.vec3d),
    corners: wp.array(dtype=wp.vec3d),
    p: wp.vec3d,
    limit: wp.float64,
    normals: wp.mat33d,
    distances: wp.vec3d,
    number: int,
):
    """Distance [m] of the nearest place that belongs to none of the ``number`` contacts found before, its normal and triangle.

    The distance is negative behind a face, and ``limit`` where nothing is nearer; the triangle is -1 then.
    """
    nearest = limit
    slack = limit * wp.float64(1.0e-12)
    normal = wp.vec3d(wp.float64(0.0))
    triangle = int(-1)
    node = int(1)
    while node > 0:
        near = is_near(boxes, tree.first_node + node, p, wp.abs(nearest), slack)
        if near and node < tree.leaves:
            node = 2 * node
        else:
            if near:
                first, last = triangles_in(tree, node)
                for k in range(first, last):
                    nearer, distance, way = is_nearer(corners, k, p, nearest, slack, normals, distances, number)
                    if nearer:
                        nearest = distance
                        normal = way
                        triangle = k
            node = next_node(node)
    return nearest, normal, triangle


@wp.func
def list_near(
    tree: TriangleTree,
    boxes: wp.array(dtype=wp.vec3d),
    corners: wp.array(dtype=wp.vec3d),
    p: wp.vec3d,
    limit: wp.float64,
    over: int,
    near: wp.array2d(dtype=int),
    row: int,
) -> int:
    """Note the triangles that are no farther than ``limit`` [m] from a point, and tell how many they are; -1 if too many.

    Where it is ``over`` one, 0 or greater, that one is left out, and so are those that nowhere rise above its plane.
    """
    none = wp.mat33d()
    slack = limit * wp.float64(1.0e-12)
    number = int(0)
    node = int(1)
    while node > 0:
        close = is_near(boxes, tree.first_node + node, p, limit, slack)
        if close and node < tree.leaves:
            node = 2 * node
        else:
            if close:
                first, last = triangles_in(tree, node)
                for k in range(first, last):
                    counts, _d, _w = is_nearer(corners, k, p, limit, slack, none, wp.vec3d(), 0)
                    if over >= 0:
                        counts = counts and k != over and rises(corners, k, over, limit * wp.float64(wp.static(_FLAT)))
                    if counts:
                        if number < wp.static(FEW):
                            near[row + number // wp.static(IN_ROW), number % wp.static(IN_ROW)] = k
                        number += 1
            node = next_node(node)
            if number > wp.static(FEW):
                number = -1
                node = 0
    return number


@wp.func
def nearest_of_few(
    corners: wp.array(dtype=wp.vec3d),
    near: wp.array2d(dtype=int),
    row: int,
    few: int,
    over: int,
    p: wp.vec3d,
    limit: wp.float64,
    normals: wp.mat33d,
    distances: wp.vec3d,
    number: int,
):
    """As ``nearest_on_tree``, of the triangles from ``list_near`` and the one below the point: distance and normal."""
    nearest = limit
    slack = limit * wp.float64(1.0e-12)
    normal = wp.vec3d(wp.float64(0.0))
    for k in range(-1, few):
        triangle = over
        if k >= 0:
            triangle = near[row + k // wp.static(IN_ROW), k % wp.static(IN_ROW)]
        if triangle >= 0:
            nearer, distance, way = is_nearer(corners, triangle, p, nearest, slack, normals, distances, number)
            if nearer:
                nearest = distance
                normal = way
    return nearest, normal
