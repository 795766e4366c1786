"""What tools and boundaries look like, for RViz: told to whoever listens, plungers as they move."""

from collections import Counter
from itertools import combinations

import numpy as np
import trimesh
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.visualization_msgs import lines_to_marker, triangles_to_marker
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.border import Observation
from sand_sim.node.connections import Connections
from sand_sim.node.parameters import Parameters
from sand_sim.node.rate import Rate
from sand_sim.scene.types import Boundary
from sand_sim.scene.walls import Wall, walls_of
from sand_sim.sinks.wall_mesh import in_outline, plane_outline, wall_mesh
from sand_sim.world import World

_TOOL, _WALL, _GROUND = (0.55, 0.59, 0.65, 1.0), (0.59, 0.59, 0.63, 0.35), (0.59, 0.53, 0.43, 1.0)
_LINE = 0.002  # width of lines, of the diagonal of the domain


class ShapeOutputs:
    """Publishes the meshes of tools in their frames, and boundaries in the world frame.

    Args:
        connections: where publishers are made.
        parameters: of the node, those of its tools declared.
        world: that is shown.
    """

    def __init__(self, connections: Connections, parameters: Parameters, world: World):
        self._parameters, self._world = parameters, world
        self._shapes = connections.publisher(MarkerArray, "~/shapes", latched=True)
        self._told: list[ToolModel] | None = None
        driven = [boundary for boundary in world.scene.boundaries if boundary.drive]
        self._driven = {wall.name: wall for boundary in driven for wall in walls_of(boundary)}
        self._plungers = connections.publisher(MarkerArray, "~/plungers", latched=True) if driven else None
        self._plungers_rate = Rate()

    def tell(self, observation: Observation) -> None:
        """Tell the shapes to the first that listens, and when a tool has another mesh; 100,000 triangles take a second."""
        tools = list(self._world.tools)
        known = self._told is not None and all(old is new for old, new in zip(self._told, tools, strict=True))
        if not known and self._shapes.get_subscription_count():
            self._shapes.publish(MarkerArray(markers=[*map(self._tool, tools), *self._boundaries()]))
            self._told = tools
        self._tell_plungers(observation)

    def publish(self, observation: Observation) -> None:
        """Tell where plungers are; called in the stepping thread once a frame."""
        if self._plungers_rate.due(observation.time, self._parameters["points_rate"]):
            self._tell_plungers(observation)

    def _tell_plungers(self, observation: Observation) -> None:
        if self._plungers and self._plungers.get_subscription_count():
            walls = [wall for wall in observation.walls if wall.name in self._driven]
            self._plungers.publish(MarkerArray(markers=[self._wall(self._driven[w.name], w.position) for w in walls]))

    def _tool(self, model: ToolModel) -> Marker:
        frame = self._parameters[f"tools.{model.tool.name}.frame"]
        return triangles_to_marker(model.mesh.triangles, f"tools/{model.tool.name}", frame, _TOOL)

    def _boundaries(self) -> list[Marker]:
        """Those that lie in the domain."""
        markers = []
        for boundary in self._world.scene.boundaries:
            if boundary.low is not None:
                markers.append(self._box(boundary))
            elif not boundary.drive:
                markers += [self._wall(wall, wall.point) for wall in walls_of(boundary)]
        for ground in self._world.assembly.grounds:
            triangles = ground.mesh.triangles + ground.place
            markers.append(triangles_to_marker(triangles, f"boundaries/{ground.name}", self._parameters["frame_id"], _GROUND))
        markers = [marker for marker in markers if marker.points]
        number = Counter()
        for marker in markers:  # RViz would show but one of those with the same name and number
            marker.id = number[marker.ns]
            number[marker.ns] += 1
        return markers

    def _wall(self, wall: Wall, place: np.ndarray) -> Marker:
        """A wall with its point in a place."""
        lattice, name, frame = self._world.assembly.lattice, f"boundaries/{wall.name}", self._parameters["frame_id"]
        if in_outline(wall, self._world.scene.gravity):
            corners = plane_outline(wall, lattice.low, lattice.high) + place
            return self._lines(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), name)
        corners, triangles = wall_mesh(wall, lattice.low, lattice.high)
        return triangles_to_marker((corners + place)[triangles], name, frame, _WALL)

    def _box(self, boundary: Boundary) -> Marker:
        corners = trimesh.bounds.corners([boundary.low, boundary.high])
        edges = [ends for ends in combinations(corners, 2) if np.count_nonzero(np.not_equal(*ends)) == 1]
        return self._lines(np.array(edges), f"boundaries/{boundary.name}")

    def _lines(self, ends: np.ndarray, name: str) -> Marker:
        lattice = self._world.assembly.lattice
        width = _LINE * float(np.linalg.norm(np.subtract(lattice.high, lattice.low)))
        return lines_to_marker(ends, name, self._parameters["frame_id"], _WALL[:3], width)
