"""Winding numbers of closed surfaces: how often a ray leaves the surface more often than it enters it.

Much faster than solid angles, and exact: a ray along no special direction meets an edge next to never. An open surface is closed
by cones over its open edges, whose own solid angle is then taken off again.
"""

import numpy as np
import warp as wp

from sampler.topology import edges_of, link_items, merge_points

_CELL = 16.0  # width of the smallest cells, in median lengths of open edges
_LEAN = wp.constant(wp.vec2(0.31371927, 0.17334821))  # x and y of the rays per z; no edge of a drawing runs so

# Corners relative to the ray's start are turned and sheared so that the ray is the axis z; double precision tells the sides of
# edges. Of the six ways out of the box of the mesh the shortest is taken, for there is the least to be met.
_LEAVINGS = """
    using namespace wp;
    const Mesh mesh = mesh_get(id);
    const BVHPackedNodeHalf floor = bvh_load_node(mesh.bvh.node_lowers, *mesh.bvh.root);
    const BVHPackedNodeHalf ceiling = bvh_load_node(mesh.bvh.node_uppers, *mesh.bvh.root);
    const float bottom[3] = {floor.x, floor.y, floor.z}, top[3] = {ceiling.x, ceiling.y, ceiling.z};
    int up = 0;
    float way = 1e30f, sign = 1.0f;
    for (int k = 0; k < 3; ++k) {
        if (top[k] - p[k] < way) { way = top[k] - p[k]; up = k; sign = 1.0f; }
        if (p[k] - bottom[k] < way) { way = p[k] - bottom[k]; up = k; sign = -1.0f; }
    }
    if (way < 0.0f) return 0;
    const int right = (up + 1) % 3, ahead = (up + 2) % 3;
    const float from[3] = {p[right], p[ahead], sign * p[up]};
    const double sx = lean[0], sy = lean[1];
    int stack[BVH_QUERY_STACK_SIZE];
    int count = 1, leavings = 0;
    stack[0] = *mesh.bvh.root;
    while (count) {
        const int node = stack[--count];
        const BVHPackedNodeHalf low = bvh_load_node(mesh.bvh.node_lowers, node);
        const BVHPackedNodeHalf high = bvh_load_node(mesh.bvh.node_uppers, node);
        const float least[3] = {low.x, low.y, low.z}, most[3] = {high.x, high.y, high.z};
        const float entry = (sign > 0.0f ? least[up] : -most[up]) - from[2];
        float enter = entry > 0.0f ? entry : 0.0f, leave = (sign > 0.0f ? most[up] : -least[up]) - from[2];
        const float below[2] = {least[right] - from[0], least[ahead] - from[1]};
        const float above[2] = {most[right] - from[0], most[ahead] - from[1]};
        for (int k = 0; k < 2; ++k) {
            const float a = below[k] / lean[k], b = above[k] / lean[k];  // the lean is positive
            enter = a > enter ? a : enter;
            leave = b < leave ? b : leave;
        }
        if (enter > leave + 1e-5f) continue;
        if (!low.b) {
            stack[count++] = low.i;
            stack[count++] = high.i;
            continue;
        }
        for (int k = low.i; k < (int)high.i; ++k) {
            const int face = mesh.bvh.primitive_indices[k];
            double x[3], y[3], z[3];
            for (int c = 0; c < 3; ++c) {
                const vec3 corner = mesh.points[mesh.indices[3 * face + c]];
                z[c] = (double)(sign * corner[up]) - from[2];
                x[c] = ((double)corner[right] - from[0]) - sx * z[c];
                y[c] = ((double)corner[ahead] - from[1]) - sy * z[c];
            }
            const double u = x[1] * y[2] - y[1] * x[2], v = x[2] * y[0] - y[2] * x[0], w = x[0] * y[1] - y[0] * x[1];
            const bool leaves = u > 0.0 && v > 0.0 && w > 0.0, enters = u < 0.0 && v < 0.0 && w < 0.0;
            if ((leaves || enters) && (u * z[0] + v * z[1] + w * z[2] > 0.0) == leaves) leavings += leaves ? 1 : -1;
        }
    }
    return sign > 0.0f ? leavings : -leavings;
"""


@wp.func_native(_LEAVINGS)
def leavings(id: wp.uint64, p: wp.vec3, lean: wp.vec2) -> int:
    """How often a ray leaves a mesh, less how often it enters it."""
    ...


@wp.kernel(enable_backward=False, module="sampler_rays")
def count_leavings(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), first: int, number: wp.array(dtype=int)):
    """Winding number of a closed mesh around each point."""
    i = first + wp.tid()
    number[i] = leavings(mesh, points[i], _LEAN)


def closing_cones(triangles: np.ndarray) -> np.ndarray:
    """Triangles that close others, shape (n, 3, 3): cones over the edges that run more often one way than the other.

    Each connected line of edges has one apex in each cell of a grid that it passes; what is left between those gets apexes in
    cells twice as wide, and so on. So the cones are small, and seen from farther away next to nothing.
    """
    corners = triangles.reshape(-1, 3)
    _, first, vertex = np.unique(merge_points(corners, 0.0), return_index=True, return_inverse=True)
    edges = edges_of(vertex.reshape(-1, 3))
    surplus = np.bincount(np.repeat(np.arange(len(edges.ends)), edges.degree), np.where(edges.forward, 1, -1)).astype(int)
    surplus[edges.ends[:, 0] == edges.ends[:, 1]] = 0
    tail, head = _directed(*edges.ends.T, surplus)
    points, line = corners[first], link_items(len(first), tail, head)[0]
    cones = [triangles[:0]]
    low, cell = points.min(axis=0), 0.0
    while len(tail):
        middle = 0.5 * (points[tail] + points[head])
        cell = 2.0 * cell or _CELL * float(np.median(np.linalg.norm(points[tail] - points[head], axis=1)))
        at = np.floor((middle - low) / cell)
        _, one, group = np.unique(np.column_stack([line[tail], at]), axis=0, return_index=True, return_inverse=True)
        number = np.bincount(group)[:, None]
        apex = np.stack([np.bincount(group, x) for x in middle.T], axis=1) / number
        cones.append(np.stack([points[head], points[tail], apex[group]], axis=1))
        # The way from tail to head now leads over the apex; ways to and fro between a point and an apex cancel.
        ends, left = np.unique(np.concatenate([tail, head]) * len(apex) + np.tile(group, 2), return_inverse=True)
        surplus = np.bincount(left, np.repeat([1, -1], len(tail))).astype(int)
        begin, over = np.divmod(ends, len(apex))
        points, line, over = np.concatenate([points, apex]), np.concatenate([line, line[tail[one]]]), over + len(points)
        tail, head = _directed(begin, over, surplus)
    return np.concatenate(cones)


def _directed(begin: np.ndarray, end: np.ndarray, surplus: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges as often as they are in surplus, shape (n,), turned round where that is negative."""
    begin, end = (np.repeat(x, np.abs(surplus)) for x in np.where(surplus > 0, [begin, end], [end, begin]))
    return begin, end
