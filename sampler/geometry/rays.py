"""Winding numbers of closed surfaces: how often a ray leaves the surface more often than it enters it.

Much faster than solid angles, and exact: a ray along no special direction meets an edge next to never. Of many points only a few
are asked so, the others by the way to the nearest of these. An open surface is closed by cones over its open edges, whose own
solid angle is then taken off again.
"""

import numpy as np
import warp as wp

from sampler.geometry.topology import edges_of, link_items, merge_points
from sampler.launching import launch_shares

_CONE = 16.0  # width of the smallest cells that get a cone of their own, in median lengths of open edges
_LEAN = (0.31371927, 0.17334821)  # sideways per way along an axis; no edge of a drawing runs so
_POINTS = 40  # per square of the cells along a side, in each of which one post is asked by a ray
_POST = (0.5113, 0.4871, 0.5237)  # where in its cell: no plane of a drawing is likely to be there

# Corners relative to the start are turned and sheared so that the way is along the axis z; double precision tells the sides of
# edges.
_LEAVINGS = """
    using namespace wp;
    const Mesh mesh = mesh_get(id);
    const double way[3] = {(double)q[0] - p[0], (double)q[1] - p[1], (double)q[2] - p[2]};
    int up = 0;
    for (int k = 1; k < 3; ++k) if (fabs(way[k]) > fabs(way[up])) up = k;
    if (way[up] == 0.0) return 0;
    const int right = (up + 1) % 3, ahead = (up + 2) % 3;
    const float sign = way[up] > 0.0 ? 1.0f : -1.0f;
    const double sx = way[right] / fabs(way[up]), sy = way[ahead] / fabs(way[up]), far = fabs(way[up]);
    const float start[3] = {p[right], p[ahead], sign * p[up]};
    const float slower[2] = {1.0f / (float)(sx == 0.0 ? 1e-20 : sx), 1.0f / (float)(sy == 0.0 ? 1e-20 : sy)};
    int stack[BVH_QUERY_STACK_SIZE];
    int count = 1, leavings = 0;
    stack[0] = *mesh.bvh.root;
    while (count) {
        const int node = stack[--count];
        const BVHPackedNodeHalf low = bvh_load_node(mesh.bvh.node_lowers, node);
        const BVHPackedNodeHalf high = bvh_load_node(mesh.bvh.node_uppers, node);
        const float least[3] = {low.x, low.y, low.z}, most[3] = {high.x, high.y, high.z};
        const float bottom = (sign > 0.0f ? least[up] : -most[up]) - start[2];
        const float top = (sign > 0.0f ? most[up] : -least[up]) - start[2];
        float enter = bottom > 0.0f ? bottom : 0.0f, leave = top < (float)far ? top : (float)far;
        const float below[2] = {least[right] - start[0], least[ahead] - start[1]};
        const float above[2] = {most[right] - start[0], most[ahead] - start[1]};
        for (int k = 0; k < 2; ++k) {
            const float a = (below[k] - 1e-6f) * slower[k], b = (above[k] + 1e-6f) * slower[k];
            enter = wp::max(enter, wp::min(a, b));  // CUDA has its own, which would be as good a match
            leave = wp::min(leave, wp::max(a, b));
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
                z[c] = (double)(sign * corner[up]) - start[2];
                x[c] = ((double)corner[right] - start[0]) - sx * z[c];
                y[c] = ((double)corner[ahead] - start[1]) - sy * z[c];
            }
            const double u = x[1] * y[2] - y[1] * x[2], v = x[2] * y[0] - y[2] * x[0], w = x[0] * y[1] - y[0] * x[1];
            const bool leaves = u > 0.0 && v > 0.0 && w > 0.0, enters = u < 0.0 && v < 0.0 && w < 0.0;
            const double height = (u * z[0] + v * z[1] + w * z[2]) / (u + v + w);
            if ((leaves || enters) && height > 0.0 && height < far) leavings += leaves ? 1 : -1;
        }
    }
    return sign > 0.0f ? leavings : -leavings;
"""


@wp.func_native(_LEAVINGS)
def leavings(id: wp.uint64, p: wp.vec3, q: wp.vec3) -> int:
    """How often the way from a point to another leaves a mesh, less how often it enters it."""
    ...


@wp.kernel(enable_backward=False, module="sampler_rays")
def count_leavings(
    mesh: wp.uint64, begin: wp.array(dtype=wp.vec3), end: wp.array(dtype=wp.vec3), first: int, number: wp.array(dtype=int)
):
    """How often each way leaves a mesh, less how often it enters it: by how much the winding number falls along it."""
    i = first + wp.tid()
    number[i] = leavings(mesh, begin[i], end[i])


def count_windings(mesh: wp.Mesh, half: np.ndarray, points: np.ndarray, device: str) -> np.ndarray:
    """Winding numbers of a closed mesh around points.

    Args:
        mesh: its box has its middle at the origin.
        half: lengths of the box, shape (3,).
        points: shape (n, 3).
        device: Warp device.

    Returns:
        Shape (n,) int.
    """
    number = np.zeros(len(points), np.int32)
    within = np.flatnonzero(np.all(np.abs(points) <= half, axis=1))
    points = points[within]
    cells = np.ceil(np.sqrt(len(points) / _POINTS)) + 1.0
    at = np.floor((points + half) * (0.5 * cells / half.max()))
    _, one, post = np.unique(at @ [cells**2, cells, 1.0], return_index=True, return_inverse=True)
    posts = ((at[one] + _POST) * (2.0 * half.max() / cells) - half).astype(np.float32)
    around = leavings_between(mesh, posts, _outside(posts, half), device)
    number[within] = leavings_between(mesh, points, posts[post], device) + around[post]
    return number


def _outside(points: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Points outside a box on the shortest of the six ways out of it."""
    way = np.concatenate([half - points, half + points], axis=1)
    side, axis = np.divmod(way.argmin(axis=1), 3)
    row, forth = np.arange(len(points)), way.min(axis=1).clip(0.0) * 1.001 + 1e-3
    lean = np.zeros_like(points)
    lean[row, axis] = np.where(side == 0, 1.0, -1.0)
    for k in (0, 1):
        lean[row, (axis + 1 + k) % 3] = _LEAN[k]
    return points + lean * forth[:, None]


def leavings_between(mesh: wp.Mesh, begin: np.ndarray, end: np.ndarray, device: str) -> np.ndarray:
    """How often ways between points, shape (n, 3), leave a mesh, less how often they enter it; shape (n,) int."""
    number = wp.empty(len(begin), dtype=int, device=device)
    ways = [wp.array(np.asarray(x, np.float32), dtype=wp.vec3, device=device) for x in (begin, end)]
    launch_shares(count_leavings, len(begin), [mesh.id, *ways], [number], device)
    return number.numpy()


def closing_cones(triangles: np.ndarray) -> np.ndarray:
    """Triangles that close others, shape (n, 3, 3): cones over the edges that run more often one way than the other.

    Each connected line of edges has one apex in each cell of a grid that it passes; what is left between those gets apexes in
    cells twice as wide, and so on. So the cones are small, and seen from farther away next to nothing.
    """
    corners = triangles.reshape(-1, 3)
    _, first, vertex = np.unique(merge_points(corners), return_index=True, return_inverse=True)
    edges = edges_of(vertex.reshape(-1, 3))
    surplus = np.bincount(edges.edge, np.where(edges.forward, 1, -1)).astype(int)
    surplus[edges.ends[:, 0] == edges.ends[:, 1]] = 0
    tail, head = _directed(*edges.ends.T, surplus)
    points, line = corners[first], link_items(len(first), tail, head)[0]
    cones = [triangles[:0]]
    low, cell = points.min(axis=0), 0.0
    while len(tail):
        middle = 0.5 * (points[tail] + points[head])
        cell = 2.0 * cell or _CONE * float(np.median(np.linalg.norm(points[tail] - points[head], axis=1)))
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
