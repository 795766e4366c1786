"""Signed distance to a triangle mesh: the exact closest point on the triangles, the sign by generalized winding number."""

import numpy as np
import trimesh
import warp as wp


@wp.kernel(enable_backward=False, module="unique")
def query_surface(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    limit: float,
    distance: wp.array(dtype=float),
    closest: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
):
    """Closest point of the mesh, its face normal, and the signed distance of each point; negative inside."""
    i = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, points[i], limit)
    if found.result:
        nearest = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        closest[i] = nearest
        normal[i] = wp.mesh_eval_face_normal(mesh, found.face)
        distance[i] = found.sign * wp.length(points[i] - nearest)


class SignedDistance:
    """Distance queries against a mesh, on the CPU or a GPU.

    Args:
        mesh: in metres.
        device: Warp device.
    """

    def __init__(self, mesh: trimesh.Trimesh, device: str = "cpu"):
        self.device = device
        self.span = float(np.linalg.norm(mesh.extents))
        self.mesh = wp.Mesh(
            points=wp.array(np.asarray(mesh.vertices, np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(np.asarray(mesh.faces, np.int32).ravel(), dtype=int, device=device),
            support_winding_number=True,
        )

    def query(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Query points.

        Args:
            points: shape (n, 3) [m], mesh frame.

        Returns:
            Signed distance, shape (n,) [m], negative inside; closest surface points, shape (n, 3) [m]; normals of the faces
            they lie on, shape (n, 3).
        """
        where = wp.array(np.asarray(points, np.float32), dtype=wp.vec3, device=self.device)
        number = len(points)
        distance = wp.zeros(number, dtype=float, device=self.device)
        closest, normal = (wp.zeros(number, dtype=wp.vec3, device=self.device) for _ in range(2))
        farthest = 4.0 * self.span + float(np.abs(points).max(initial=0.0))
        wp.launch(
            query_surface,
            dim=number,
            inputs=[self.mesh.id, where, farthest, distance, closest, normal],
            device=self.device,
        )
        return distance.numpy(), closest.numpy(), normal.numpy()
