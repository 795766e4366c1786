"""Winding numbers of closed surfaces: how often a ray leaves the surface more often than it enters it.

Much faster than solid angles, and exact: a ray along no special direction meets an edge next to never. An open surface is closed
by cones over its open edges, whose own solid angle is then taken off again.
"""

import numpy as np
import warp as wp

from sampler.topology import edges_of, link_items, merge_points

_LEAN = wp.constant(wp.vec2(0.31371927, 0.17334821))  # x and y of the rays per z; no edge of a drawing runs so

# Corners relative to the ray's start are sheared so that the ray is the axis z; double precision tells the sides of edges.
_LEAVINGS = """
    using namespace wp;
    const Mesh mesh = mesh_get(id);
    const double sx = lean[0], sy = lean[1];
    int stack[BVH_QUERY_STACK_SIZE];
    int count = 1, leavings = 0;
    stack[0] = *mesh.bvh.root;
    while (count) {
        const int node = stack[--count];
        const BVHPackedNodeHalf low = bvh_load_node(mesh.bvh.node_lowers, node);
        const BVHPackedNodeHalf high = bvh_load_node(mesh.bvh.node_uppers, node);
        const float below[2] = {low.x - p[0], low.y - p[1]}, above[2] = {high.x - p[0], high.y - p[1]};
        float enter = low.z - p[2] > 0.0f ? low.z - p[2] : 0.0f, leave = high.z - p[2];
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
                z[c] = (double)corner[2] - p[2];
                x[c] = ((double)corner[0] - p[0]) - sx * z[c];
                y[c] = ((double)corner[1] - p[1]) - sy * z[c];
            }
            const double u = x[1] * y[2] - y[1] * x[2], v = x[2] * y[0] - y[2] * x[0], w = x[0] * y[1] - y[0] * x[1];
            const bool leaves = u > 0.0 && v > 0.0 && w > 0.0, enters = u < 0.0 && v < 0.0 && w < 0.0;
            if ((leaves || enters) && (u * z[0] + v * z[1] + w * z[2] > 0.0) == leaves) leavings += leaves ? 1 : -1;
        }
    }
    return leavings;
"""


@wp.func_native(_LEAVINGS)
def leavings(id: wp.uint64, p: wp.vec3, lean: wp.vec2) -> int:
    """How often a ray upward leaves a mesh, less how often it enters it."""
    ...


@wp.kernel(enable_backward=False, module="sampler_rays")
def count_leavings(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), first: int, number: wp.array(dtype=int)):
    """Winding number of a closed mesh around each point."""
    i = first + wp.tid()
    number[i] = leavings(mesh, points[i], _LEAN)


def closing_cone(triangles: np.ndarray) -> np.ndarray:
    """Triangles that close others, shape (n, 3, 3): cones over the edges that run more often one way than the other.

    Each connected line of edges has its own apex, so that seen from afar its cone is next to nothing.
    """
    corners = triangles.reshape(-1, 3)
    _, first, vertex = np.unique(merge_points(corners, 0.0), return_index=True, return_inverse=True)
    edges = edges_of(vertex.reshape(-1, 3))
    edge = np.repeat(np.arange(len(edges.ends)), edges.degree)
    surplus = np.bincount(edge, np.where(edges.forward, 1, -1)).astype(int)
    surplus[edges.ends[:, 0] == edges.ends[:, 1]] = 0
    ends = np.repeat(edges.ends, np.abs(surplus), axis=0)
    line = link_items(len(first), *ends.T)[0][ends[:, 0]]
    low, high = corners[first[ends]].transpose(1, 0, 2)
    forward = np.repeat(surplus > 0, np.abs(surplus))[:, None]
    number = np.maximum(np.bincount(line), 1)[:, None]
    apex = np.stack([np.bincount(line, x, len(number)) for x in 0.5 * (low + high).T], axis=1) / number
    return np.stack([np.where(forward, high, low), np.where(forward, low, high), apex[line]], axis=1)
