"""What Rerun shows of a world: grains, tools, wrenches and health on simulated time."""

from collections import Counter

import numpy as np
import rerun as rr
import trimesh

from sand_sim.assembly.tool_model import ToolModel
from sand_sim.border import Observation
from sand_sim.scene.walls import Wall, walls_of
from sand_sim.sinks.blueprint import make_blueprint, series_styles
from sand_sim.sinks.colours import colour_by_speed, fastest_shown
from sand_sim.sinks.wall_mesh import in_outline, plane_outline, wall_mesh
from sand_sim.world import World

_TIMELINE = "sim_time"
_AXES = "xyz"


class Drawing:
    """Draws observations on a stream of Rerun.

    Where time runs back, after a reset or when an earlier state is loaded, it goes on in a timeline of its own, ``sim_time_2``
    and so on; in one of them Rerun would mix what is then with what has been.

    Args:
        world: that is drawn, its walls at once.
        stream: to draw on.
        particles: also draw the particles of the tools.
    """

    def __init__(self, world: World, stream: rr.RecordingStream, particles: bool = False):
        self._fastest = fastest_shown(world.scene)
        self._time, self._runs, self._timeline = 0.0, 1, _TIMELINE
        self._plungers = [wall.name for wall in world.assembly.walls if wall.drive]
        self._recording, self._world, self._particles = stream, world, particles
        self._shown = ""
        self._draw_all_anew()
        self._draw_still()

    def write(self, observation: Observation) -> None:
        """Add one observation."""
        recording, grains, health = self._recording, observation.spheres, observation.health
        if observation.time < self._time:
            self._runs += 1
            self._timeline = f"{_TIMELINE}_{self._runs}"
            recording.reset_time()
            self._draw_all_anew()
        if self._shown != self._timeline:
            recording.send_blueprint(make_blueprint(self._world.scene, self._plungers, observation, self._timeline))
            self._shown = self._timeline
        self._time = observation.time
        recording.set_time(self._timeline, duration=observation.time)
        recording.log(
            "world/grains",
            rr.Points3D.from_fields(
                positions=grains.position.astype(np.float32), colors=colour_by_speed(grains.speed, self._fastest)
            ),
        )
        if not np.array_equal(grains.identity, self._identity):
            self._identity = grains.identity
            recording.log("world/grains", rr.Points3D.from_fields(radii=grains.radius.astype(np.float32)))
        for wall in observation.walls:
            if wall.name in self._plungers:
                recording.log(f"world/walls/{wall.name}", rr.Transform3D(translation=wall.position))
                recording.log(f"force/{wall.name}", rr.Scalars(float(np.linalg.norm(wall.force))))
        for model in self._world.tools:
            if self._drawn.get(model.tool.name) is not model:
                self._drawn[model.tool.name] = model
                self._draw_tool(model)
        for tool in observation.tools:
            pose = rr.Transform3D(translation=tool.position, quaternion=rr.Quaternion(xyzw=tool.orientation))
            recording.log(f"world/tools/{tool.name}", pose)
            for axis in range(3):
                recording.log(f"force/{tool.name}/{_AXES[axis]}", rr.Scalars(tool.world_force[axis]))
                recording.log(f"torque/{tool.name}/{_AXES[axis]}", rr.Scalars(tool.torque[axis]))
            recording.log(f"carried/{tool.name}", rr.Scalars(tool.carried))
        shown = {
            "overlap": health.deepest,
            "energy/kinetic": health.kinetic,
            "energy/elastic": health.elastic,
            "energy/dissipated": health.dissipated,
            "contacts": health.contacts,
            "fastest": health.fastest,
        }
        for name, value in shown.items():
            recording.log(f"health/{name}", rr.Scalars(value))

    def _draw_all_anew(self) -> None:
        """Next time draw also what has not changed."""
        self._identity = np.zeros(0, int)
        self._drawn: dict[str, ToolModel] = {}

    def _draw_still(self) -> None:
        """Draw what never changes: axes, walls, and how curves look."""
        recording, world = self._recording, self._world
        recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for curve, style in series_styles(world.scene, self._plungers).items():
            recording.log(curve, style, static=True)
        number = Counter()
        for boundary in world.scene.boundaries:
            number[boundary.name] += 1
            entity = f"world/walls/{boundary.name}" + (f"_{number[boundary.name]}" if number[boundary.name] > 1 else "")
            if boundary.low is not None:
                box = rr.Boxes3D(mins=[boundary.low], sizes=[np.subtract(boundary.high, boundary.low)], colors=[[150, 150, 160]])
                recording.log(entity, box, static=True)
                continue
            for wall in walls_of(boundary):
                recording.log(entity, self._wall(wall), static=True)
                if not wall.drive:
                    recording.log(entity, rr.Transform3D(translation=wall.point), static=True)
        for ground in world.assembly.grounds:
            mesh = _flat_mesh(ground.mesh, ground.place, [150, 135, 110, 255])
            recording.log(f"world/walls/{ground.name}", mesh, static=True)

    def _wall(self, wall: Wall) -> rr.Mesh3D | rr.LineStrips3D:
        """A wall around its point."""
        low, high = self._world.assembly.lattice.low, self._world.assembly.lattice.high
        if in_outline(wall, self._world.scene.gravity):
            corners = plane_outline(wall, low, high)
            return rr.LineStrips3D([np.concatenate([corners, corners[:1]])], colors=[[150, 150, 160]])
        corners, triangles = wall_mesh(wall, low, high)
        return rr.Mesh3D(vertex_positions=corners, triangle_indices=triangles, albedo_factor=[150, 150, 160, 90])

    def _draw_tool(self, model: ToolModel) -> None:
        """Draw the mesh and the particles that a tool has from now on."""
        name = f"world/tools/{model.tool.name}"
        self._recording.log(f"{name}/mesh", _flat_mesh(model.mesh, np.zeros(3), [140, 150, 165, 255]))
        if self._particles:
            points = rr.Points3D(model.body.points.astype(np.float32), radii=model.body.radius, colors=[[90, 120, 190]])
            self._recording.log(f"{name}/particles", points)


def _flat_mesh(mesh: trimesh.Trimesh, place: np.ndarray, colour: list[int]) -> rr.Mesh3D:
    """A mesh whose faces each have corners of their own, so that edges look sharp."""
    return rr.Mesh3D(
        vertex_positions=(np.asarray(mesh.triangles) + place).reshape(-1, 3).astype(np.float32),
        vertex_normals=np.repeat(np.asarray(mesh.face_normals, np.float32), 3, axis=0),
        albedo_factor=colour,
    )
