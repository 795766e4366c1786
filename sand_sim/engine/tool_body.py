"""Tools on the device: their particles, fixed in their own frames, and the cells these lie in."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from sand_sim.engine.smooth_tools import SLOTS, SmoothTools
from sand_sim.engine.tools import ToolTrack, tool_types
from sand_sim.precision import Precision
from sand_sim.reach import Reach, reach_of


@dataclass(frozen=True)
class ToolBody:
    """A tool as the solver sees it.

    Attributes:
        particles: centres in the tool frame, shape (n, 3) [m].
        radius: of every particle [m].
        material: index into the scene's materials.
        triangles: outward surface that grains touch instead of the particles, shape (m, 3, 3) [m]; None for a rough tool.
    """

    particles: np.ndarray
    radius: float
    material: int
    triangles: np.ndarray | None = None


class Tools:
    """All driven tools of a world.

    Attributes:
        number: how many.
        particles: centres in their tool's frame, vec3, shape (particles,) [m]; a smooth tool has the origin, once for each slot.
        tool_of: tool of each particle, int, shape (particles,).
        cell_starts: particles of cell k are ``cell_starts[k]`` to ``cell_starts[k + 1]``, int.
        shapes, states, tracks: structs of ``tools.py``, shape (tools,).
        travelled: bound of each tool's motion since the list was made, shape (tools,) [m].
        wrench: force and torque of the sand now, vec3d, shape (tools, 2).
        impulse: of both over the frame, in the axes of the world, then in those of the tool, vec3d, shape (tools, 4).
        twist: velocity of the frame's origin and spin over the last step, world frame, vec3d, shape (tools, 2) [m/s], [rad/s].
        way: the same of the frame's origin and turn, vec3d, shape (tools, 2) [m], [rad].
        work: of the tool on the sand up to the middle of the last step, shape (tools,) [J].
        smooth: surfaces of the smooth ones; None if there are none.
    """

    def __init__(self, bodies: list[ToolBody], reach: float, precision: Precision, device: str):
        shape_type, state_type = tool_types(precision)
        self.number = len(bodies)
        shapes, particles, starts, tool_of, first_slots = [], [], [0], [], []
        for index, body in enumerate(bodies):
            shape = shape_type()
            shape.material = body.material
            first_slots.append(sum(map(len, particles)))
            if body.triangles is not None:
                _note_reach(shape, reach_of(body.triangles.reshape(-1, 3), 0.0), precision)
                shapes.append(shape)
                particles.append(np.zeros((SLOTS, 3)))
                tool_of.append(np.full(SLOTS, index))
                continue
            points = np.asarray(body.particles, float)
            cell = (body.radius + reach) * 1.001
            low = points.min(axis=0) - 0.01 * cell
            counts = np.floor((points.max(axis=0) - low) / cell).astype(int) + 1
            cells = np.minimum(((points - low) / cell).astype(int), counts - 1)
            keys = (cells[:, 2] * counts[1] + cells[:, 1]) * counts[0] + cells[:, 0]
            order = np.argsort(keys, kind="stable")
            shape.radius = body.radius
            _note_reach(shape, reach_of(points, body.radius), precision)
            shape.low = precision.vec3(*low)
            shape.inverse_cell = 1.0 / cell
            shape.nx, shape.ny, shape.nz = (int(c) for c in counts)
            shape.first_key = len(starts) - 1
            shapes.append(shape)
            particles.append(points[order])
            tool_of.append(np.full(len(points), index))
            starts += list(starts[-1] + np.cumsum(np.bincount(keys, minlength=int(np.prod(counts)))))
        self.particles = wp.array(np.concatenate(particles), dtype=precision.vec3, device=device)
        self.tool_of = wp.array(np.concatenate(tool_of), dtype=int, device=device)
        self.cell_starts = wp.array(starts, dtype=int, device=device)
        self.shapes = wp.array(shapes, dtype=shape_type, device=device)
        self.states = wp.zeros(self.number, dtype=state_type, device=device)
        self.tracks = wp.zeros(self.number, dtype=ToolTrack, device=device)
        self.travelled = wp.zeros(self.number, dtype=wp.float64, device=device)
        self.wrench = wp.zeros((self.number, 2), dtype=wp.vec3d, device=device)
        self.impulse = wp.zeros((self.number, 4), dtype=wp.vec3d, device=device)
        self.twist = wp.zeros((self.number, 2), dtype=wp.vec3d, device=device)
        self.way = wp.zeros((self.number, 2), dtype=wp.vec3d, device=device)
        self.work = wp.zeros(self.number, dtype=wp.float64, device=device)
        surfaces = [body.triangles for body in bodies]
        self.smooth = None
        if any(triangles is not None for triangles in surfaces):
            self.smooth = SmoothTools(surfaces, first_slots, device)

    def set_tracks(self, tracks: list) -> None:
        """Give all tools their tracks (``tools.ToolTrack``)."""
        self.tracks.assign(wp.array(tracks, dtype=ToolTrack, device="cpu"))


def _note_reach(shape, reach: Reach, precision: Precision) -> None:
    shape.extent, shape.arms = reach.extent, precision.vec3(*reach.arms)
