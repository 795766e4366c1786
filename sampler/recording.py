"""A Rerun recording of a body in the making: mesh, slices of the field, particles as they relax."""

from pathlib import Path

import numpy as np
import trimesh

from sampler.body import ParticleBody
from sampler.distance import SignedDistance
from sampler.errors import MeshError
from sampler.geometry.surface import Surface

_EVERY = 3  # moves of the particles between two pictures
_SLICE = 200  # nodes along the longest edge of a slice
_FREE, _SOLID = np.array([70, 130, 200]), np.array([210, 110, 60])


class Recording:
    """Writes one ``.rrd`` file.

    Args:
        path: of the file.
        mesh: as read [m].
        radius: of the particles [m].

    Raises:
        MeshError: if Rerun is not installed or the file cannot be written.
    """

    def __init__(self, path: Path, mesh: trimesh.Trimesh, radius: float):
        try:
            import rerun as rr
            import rerun.blueprint as rrb
        except ImportError:
            raise MeshError("--rrd needs Rerun: pip install 'rerun-sdk'") from None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.open("wb").close()
        except OSError as error:
            raise MeshError(f"recording {path}: cannot be written: {error.strerror}") from None
        self._rr, self._radius, self._moves = rr, radius, 0
        self._stream = rr.RecordingStream("sampler")
        views = [
            rrb.Spatial3DView(name="particles", contents=["/solid", "/particles", "/normals"]),
            rrb.Spatial3DView(name="signed distance", contents=["/mesh", "/field/**"]),
        ]
        self._stream.save(path, rrb.Blueprint(rrb.Horizontal(*views), collapse_panels=True))
        self._log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._log("mesh", self._mesh(np.asarray(mesh.triangles), [150, 150, 150, 60]), static=True)

    def particles(self, points: np.ndarray) -> None:
        """Add the particles, shape (n, 3) [m], after one more move."""
        if self._moves % _EVERY == 0:
            self._show(points, [90, 120, 190])
        self._moves += 1

    def finish(self, body: ParticleBody, distance: SignedDistance) -> None:
        """Add the finished body and three slices of the distance, and close the file."""
        self._show(body.points, [60, 160, 90])
        arrows = self._rr.Arrows3D(origins=body.points, vectors=1.5 * body.radius * body.normals, radii=0.04 * body.radius)
        self._log("normals", arrows)
        self._log("solid", self._mesh(body.triangles, [200, 200, 205, 255]), static=True)
        for axis, name in enumerate("xyz"):
            self._log(f"field/{name}", self._slice(distance, axis), static=True)
        self._stream.flush()
        self._stream.disconnect()

    def _log(self, name, item, static=False) -> None:
        self._rr.log(name, item, static=static, recording=self._stream)

    def _show(self, points, colour) -> None:
        self._rr.set_time("move", sequence=self._moves, recording=self._stream)
        self._log("particles", self._rr.Points3D(points.astype(np.float32), radii=self._radius, colors=[colour]))

    def _mesh(self, triangles, colour):
        corners = triangles.reshape(-1, 3)
        return self._rr.Mesh3D(
            vertex_positions=corners.astype(np.float32),
            triangle_indices=np.arange(len(corners)).reshape(-1, 3),
            vertex_normals=np.repeat(Surface.normals_of(triangles), 3, axis=0).astype(np.float32),
            albedo_factor=colour,
        )

    def _slice(self, distance: SignedDistance, axis: int):
        """A plane through the middle, coloured by side and, in bands, by distance."""
        corners = distance.surface.triangles.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        margin = 0.1 * float((high - low).max())
        low, high = low - margin, high + margin
        step = float((high - low).max()) / _SLICE
        u, v = (k for k in range(3) if k != axis)
        number = [max(2, int((high - low)[k] / step)) for k in (u, v)]
        places = np.empty((*number, 3))
        places[..., axis] = 0.5 * (low + high)[axis]
        along = [np.linspace(low[k], high[k], n) for k, n in ((u, number[0]), (v, number[1]))]
        places[..., u], places[..., v] = np.meshgrid(*along, indexing="ij")
        far = distance.query(places.reshape(-1, 3))[0]
        shade = (
            1.0
            - 0.6 * np.clip(np.abs(far) / (0.25 * float((high - low).max())), 0.0, 1.0)
            - 0.12 * (np.floor(np.abs(far) / margin * 5.0) % 2)
        )
        colour = np.where((far < 0.0)[:, None], _SOLID, _FREE) * shade[:, None]
        index = np.arange(number[0] * number[1]).reshape(number)
        a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
        return self._rr.Mesh3D(
            vertex_positions=places.reshape(-1, 3).astype(np.float32),
            triangle_indices=np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]),
            vertex_colors=colour.astype(np.uint8),
        )
