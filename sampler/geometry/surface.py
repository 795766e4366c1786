"""Exact questions to a set of triangles: closest point, generalized winding number, rays; on the CPU's cores or a GPU."""

from functools import cached_property

import numpy as np
import warp as wp

from sampler.geometry.closest import closest_on_triangles
from sampler.geometry.rays import closing_cones, count_windings, leavings_between
from sampler.geometry.vectors import cross, extremes, lengths
from sampler.launching import launch_shares

ASIDE = wp.constant(1.0e-5)  # of the diagonal: how much nearer the wrong side of a wall must be to be taken
_APART = 2.0, 1.2  # times their spread, from where on triangles are summed: within 0.002, and within 0.07 in a third of the time
_SURE = 0.38  # how near to a whole number rough winding numbers are good enough: asked is on which side of a half they are
_FARTHEST = 4.0  # of the diagonal: as far as rays go
_RAGGED = 0.5  # open edges per triangle from which solid angles are as fast


# Warp's own query loses up to 1e-4 of the diagonal on long thin triangles: it measures them in single precision.
_NEAREST = """
    using namespace wp;
    const Mesh mesh = mesh_get(id);
    const vec3d side(up[0], up[1], up[2]);
    int stack[BVH_QUERY_STACK_SIZE];
    float reached[BVH_QUERY_STACK_SIZE];
    int count = 1, best = -1;
    stack[0] = *mesh.bvh.root;
    reached[0] = 0.0f;
    double least = (double)limit * limit;
    while (count) {
        const int node = stack[--count];
        if (reached[count] > least * 1.000001) continue;
        const BVHPackedNodeHalf low = bvh_load_node(mesh.bvh.node_lowers, node);
        const BVHPackedNodeHalf high = bvh_load_node(mesh.bvh.node_uppers, node);
        if (low.b) {
            for (int k = low.i; k < (int)high.i; ++k) {
                const int face = mesh.bvh.primitive_indices[k];
                const vec3 x = mesh.points[3 * face], y = mesh.points[3 * face + 1], z = mesh.points[3 * face + 2];
                if (distance_to_aabb_sq(p, wp::min(wp::min(x, y), z), wp::max(wp::max(x, y), z)) > least * 1.000001) continue;
                const vec3d point(p[0], p[1], p[2]);
                const vec3d corner[3] = {
                    vec3d(x[0], x[1], x[2]) - point, vec3d(y[0], y[1], y[2]) - point, vec3d(z[0], z[1], z[2]) - point
                };
                const vec3d u = corner[1] - corner[0], v = corner[2] - corner[0], n = cross(u, v);
                const double area = dot(n, n);
                double distance = 1e300;
                bool within = area > 0.0;
                for (int c = 0; c < 3; ++c) {
                    const vec3d a = corner[c], along = corner[(c + 1) % 3] - a;
                    if (dot(cross(along, a), n) > 0.0) within = false;
                    const double square = dot(along, along);
                    double share = square > 0.0 ? -dot(a, along) / square : 0.0;
                    share = share < 0.0 ? 0.0 : (share > 1.0 ? 1.0 : share);
                    const vec3d near = a + share * along;
                    const double d = dot(near, near);
                    if (d < distance) distance = d;
                }
                if (within) distance = dot(corner[0], n) * dot(corner[0], n) / area;
                const double facing = dot(n, side);
                if (facing < 0.0 && facing * facing > 0.5 * area) distance += (double)aside * aside;
                if (distance < least) { least = distance; best = face; }
            }
        } else {
            const BVHPackedNodeHalf al = bvh_load_node(mesh.bvh.node_lowers, low.i);
            const BVHPackedNodeHalf ah = bvh_load_node(mesh.bvh.node_uppers, low.i);
            const BVHPackedNodeHalf bl = bvh_load_node(mesh.bvh.node_lowers, high.i);
            const BVHPackedNodeHalf bh = bvh_load_node(mesh.bvh.node_uppers, high.i);
            const float a = distance_to_aabb_sq(p, vec3(al.x, al.y, al.z), vec3(ah.x, ah.y, ah.z));
            const float b = distance_to_aabb_sq(p, vec3(bl.x, bl.y, bl.z), vec3(bh.x, bh.y, bh.z));
            const bool first = a < b;
            const float near = first ? a : b, far = first ? b : a;
            stack[count] = first ? high.i : low.i;
            reached[count] = far;
            count += far <= least * 1.000001;
            stack[count] = first ? low.i : high.i;
            reached[count] = near;
            count += near <= least * 1.000001;
        }
    }
    return best;
"""


@wp.func_native(_NEAREST)
def nearest_face(id: wp.uint64, p: wp.vec3, limit: float, up: wp.vec3, aside: float) -> int:
    """Triangle of a mesh nearest to a point, measured in double precision; -1 where none is within the limit.

    Triangles that face away from the unit vector ``up`` count as ``aside`` farther where they are near: of two that coincide,
    the one on the wanted side is found.
    """
    ...


@wp.func_native("return wp::mesh_query_winding_number(id, p, apart);")
def winding_number(id: wp.uint64, p: wp.vec3, apart: float) -> float:
    """Generalized winding number of a mesh around a point; triangles farther than ``apart`` times their spread are summed."""
    ...


@wp.kernel(enable_backward=False, module="sampler_surface")
def find_closest(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    limit: wp.array(dtype=float),
    up: wp.array(dtype=wp.vec3),
    first: int,
    face: wp.array(dtype=int),
):
    """Triangle nearest to each point, -1 where none is within its limit."""
    i = first + wp.tid()
    face[i] = nearest_face(mesh, points[i], limit[i], up[i], ASIDE)


@wp.kernel(enable_backward=False, module="sampler_surface")
def find_winding(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), apart: float, first: int, number: wp.array(dtype=float)):
    """Generalized winding number of each point (Jacobson et al. 2013; far triangles by Barill et al. 2018)."""
    i = first + wp.tid()
    number[i] = winding_number(mesh, points[i], apart)


@wp.kernel(enable_backward=False, module="sampler_surface")
def cast_ray(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    limit: float,
    first: int,
    face: wp.array(dtype=int),
    length: wp.array(dtype=float),
):
    """First triangle met by each ray within a limit and the way to it; -1 for none."""
    i = first + wp.tid()
    hit = wp.mesh_query_ray(mesh, points[i], direction[i], limit)
    face[i] = wp.where(hit.result, hit.face, -1)
    length[i] = hit.t


class Surface:
    """Triangles that can be asked.

    Queries run in single precision on a copy of unit diagonal at the origin, wherever and however large the mesh is; closest
    points are then computed again in double precision on the triangle that was found.

    Args:
        triangles: corners, shape (n, 3, 3) [m].
        device: Warp device.

    Attributes:
        triangles: as given.
        normals: of the triangles, zero where they have no area, shape (n, 3).
    """

    def __init__(self, triangles: np.ndarray, device: str = "cpu"):
        self.device = device
        self.triangles = np.asarray(triangles, float)
        low, high = extremes(self.triangles)
        self.centre, self.unit = 0.5 * (low + high), float(np.linalg.norm(high - low))
        self.half = 0.5 * (high - low) / self.unit
        upright, self.areas = _upright(self.triangles)
        self.normals = _units(upright, self.areas)

    @cached_property
    def mesh(self) -> wp.Mesh:
        """The copy that queries run on."""
        return self._copy(solid_angles=False)

    @cached_property
    def _weighed(self) -> wp.Mesh:
        """The copy that solid angles are asked of, which takes twice as long to build."""
        return self._copy(solid_angles=True)

    def _copy(self, solid_angles: bool) -> wp.Mesh:
        return wp.Mesh(
            points=self.shift(self.triangles.reshape(-1, 3)),
            indices=wp.array(np.arange(3 * len(self.triangles), dtype=np.int32), dtype=int, device=self.device),
            support_winding_number=solid_angles,
        )

    @staticmethod
    def areas_of(triangles: np.ndarray) -> np.ndarray:
        """Areas of triangles, shape (n, 3, 3) [m]."""
        return _upright(triangles)[1]

    @staticmethod
    def normals_of(triangles: np.ndarray) -> np.ndarray:
        """Unit normals of triangles, shape (n, 3, 3) [m]; zero where they have no area."""
        return _units(*_upright(triangles))

    def shift(self, points: np.ndarray) -> wp.array:
        """Points in the frame and unit of the queries."""
        return wp.array(self.shifted(points), dtype=wp.vec3, device=self.device)

    def shifted(self, points: np.ndarray) -> np.ndarray:
        """The same on the host, shape (n, 3) float32."""
        return ((np.asarray(points, float) - self.centre) / self.unit).astype(np.float32)

    def vectors(self, values: np.ndarray) -> wp.array:
        """Directions, shape (n, 3), for kernels."""
        return wp.array(np.asarray(values, np.float32), dtype=wp.vec3, device=self.device)

    def back(self, points: np.ndarray) -> np.ndarray:
        """Points [m] from those in the frame and unit of the queries, shape (n, 3)."""
        return points * self.unit + self.centre

    @cached_property
    def faces(self) -> tuple[wp.uint64, wp.array, wp.array]:
        """The triangles for kernels: the copy that queries run on, its corners, and the normals."""
        return self.mesh.id, self.mesh.points, self.vectors(self.normals)

    def closest(
        self, points: np.ndarray, limit: np.ndarray | float | None = None, up: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Closest points of the triangles.

        Args:
            points: shape (n, 3) [m].
            limit: farthest to look [m]; everywhere if None.
            up: unit vectors, shape (n, 3); of triangles in one place those that face their way are taken.

        Returns:
            Closest points, shape (n, 3) [m]; triangles they lie on, shape (n,), -1 and the point itself where there is none.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        if limit is None:
            limit = np.linalg.norm(points - self.centre, axis=1) + self.unit
        limit = np.broadcast_to(np.asarray(limit, float) / self.unit, len(points)).astype(np.float32)
        face = wp.empty(len(points), dtype=int, device=self.device)
        limit = wp.array(limit, dtype=float, device=self.device)
        up = self.vectors(np.zeros_like(points) if up is None else up)
        self._launch(find_closest, [self.shift(points), limit, up], [face])
        face = face.numpy()
        nearest = points.copy()
        found = face >= 0
        nearest[found] = closest_on_triangles(points[found], self.triangles[face[found]])
        return nearest, face

    def winding(self, points: np.ndarray, rough: bool = False) -> np.ndarray:
        """Generalized winding number of points, shape (n, 3) [m]: 1 inside, 0 outside of a closed surface.

        Within 0.002 on meshes with cracks; rough ones within 0.07, but for those near a half.
        """
        cone, closed = self._closing
        number, sign = np.zeros(len(points), np.float32), 1.0
        if closed is not None:
            number += count_windings(closed.mesh, closed.half, closed.shifted(points), self.device)
            if cone is None:
                return number
            sign = -1.0
        open_one, apart = cone or self, _APART[1] if rough else _APART[0]
        total = number + sign * open_one._solid_angles(points, apart)
        if rough:
            doubt = np.flatnonzero(np.abs(total - np.round(total)) > _SURE)
            total[doubt] = number[doubt] + sign * open_one._solid_angles(points[doubt], _APART[0])
        return total

    def leavings(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """By how much the winding number falls on ways between points, shape (n, 3) [m], through the surface; shape (n,) int."""
        return leavings_between(self.mesh, self.shifted(begin), self.shifted(end), self.device)

    @cached_property
    def _closing(self) -> tuple["Surface | None", "Surface | None"]:
        """What closes the surface, and both together; nothing where there is too much to close."""
        cone = closing_cones(self.triangles)
        if not len(cone):
            return None, self
        if len(cone) > _RAGGED * len(self.triangles):
            return None, None
        return Surface(cone, self.device), Surface(np.concatenate([self.triangles, cone]), self.device)

    def _solid_angles(self, points: np.ndarray, apart: float) -> np.ndarray:
        number = wp.empty(len(points), dtype=float, device=self.device)
        launch_shares(find_winding, len(points), [self._weighed.id, self.shift(points), apart], [number], self.device)
        return number.numpy()

    def cast(self, points: np.ndarray, direction: np.ndarray, limit: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """First triangles met by rays of unit direction, shape (n,), -1 for none, and the ways to them, shape (n,) [m].

        At most ``limit`` [m] away; the shorter that is, the faster.
        """
        face = wp.empty(len(points), dtype=int, device=self.device)
        length = wp.empty(len(points), dtype=float, device=self.device)
        limit = min(limit / self.unit, _FARTHEST)
        self._launch(cast_ray, [self.shift(points), self.vectors(direction), limit], [face, length])
        return face.numpy(), length.numpy() * self.unit

    def _launch(self, kernel, inputs: list, outputs: list) -> None:
        launch_shares(kernel, len(outputs[0]), [self.mesh.id, *inputs], outputs, self.device)


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each unit normal, shape (n, 3), and across each other; both shape (n, 3)."""
    aside = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), np.finfo(float).tiny)
    return aside, np.cross(normals, aside)


def _upright(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals of triangles, shape (n, 3, 3) [m], twice as long as their areas [m^2], and these."""
    upright = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return upright, 0.5 * lengths(upright)


def _units(upright: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Unit normals from what ``_upright`` gives; zero where there is no area."""
    return np.divide(0.5 * upright, areas[:, None], out=np.zeros_like(upright), where=areas[:, None] > 0.0)
