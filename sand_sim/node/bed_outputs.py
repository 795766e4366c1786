"""What is told of the bed: clouds of grains and height maps, made in a thread of their own."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from nav_msgs.msg import MapMetaData
from sensor_msgs.msg import Image, PointCloud2

from msg_adapters.nav_msgs import grid_to_metadata
from msg_adapters.sensor_msgs import grains_to_cloud, heights_to_image
from sand_sim.border import Observation
from sand_sim.node.connections import Connections
from sand_sim.node.parameters import Parameters
from sand_sim.node.rate import Rate
from sand_sim.readout.cloud_selection import select_box, select_every, select_voxels
from sand_sim.readout.height_map import bed_grid, make_height_map
from sand_sim.world import World

_MOST_WAITING = 5  # as many as are kept for a reader
_MOST_CELLS = 10_000_000  # of a height map, 40 MB
_COARSE_POINTS = 0.01  # resolution of points over the smallest radius


class BedOutputs:
    """Publishes what is heard by anyone, at its rate.

    Args:
        connections: where publishers are made.
        parameters: of the node.
        world: that is shown, with at least one grain or fill.
        on_error: called with what goes wrong in the thread.

    Raises:
        ValueError: if the height map that is asked for would have too many cells.

    Attributes:
        dropped: observations that were not told because the thread was busy with earlier ones.
    """

    def __init__(self, connections: Connections, parameters: Parameters, world: World, on_error: Callable[[Exception], None]):
        self._parameters, self._world, self._on_error = parameters, world, on_error
        self._points = connections.publisher(PointCloud2, "~/points")
        self._heights = connections.publisher(Image, "~/heights")
        self._grid = connections.publisher(MapMetaData, "~/heights_grid", latched=True)
        self._points_rate, self._heights_rate = Rate(), Rate()
        self._low, self._cell, self._shape = _grid(world, parameters["heights_cell"])
        self._grid.publish(grid_to_metadata(self._low, self._cell, self._shape))
        self.dropped = 0
        self._waiting: deque[tuple[Observation, bool, bool]] = deque()
        self._busy = False
        self._lock = threading.Lock()
        self._worker = ThreadPoolExecutor(1, "sand_sim clouds")

    def publish(self, observation: Observation) -> None:
        """Tell what is due; called in the stepping thread once a frame."""
        points = self._points_rate.due(observation.time, self._parameters["points_rate"])
        heights = self._heights_rate.due(observation.time, self._parameters["heights_rate"])
        self.tell(observation, points, heights)

    def tell(self, observation: Observation, points: bool = True, heights: bool = True) -> None:
        """Hand over to the thread what somebody listens to."""
        points = points and self._points.get_subscription_count() > 0
        heights = heights and self._heights.get_subscription_count() > 0
        if not (points or heights):
            return
        with self._lock:
            if len(self._waiting) == _MOST_WAITING:
                self._waiting.popleft()
                self.dropped += 1
            self._waiting.append((observation, points, heights))
            if not self._busy:
                self._busy = True
                self._worker.submit(self._work)

    def close(self) -> None:
        """Wait until all has been told."""
        self._worker.shutdown()

    def _work(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    self._busy = False
                    return
                observation, points, heights = self._waiting.popleft()
            try:
                if points:
                    self._publish_points(observation)
                if heights:
                    self._publish_heights(observation)
            except Exception as error:
                self._on_error(error)

    def _publish_points(self, observation: Observation) -> None:
        parameters, grains = self._parameters, observation.spheres
        region, edge, step = (parameters[f"points_{name}"] for name in ("region", "voxel", "decimation"))
        if any(region):
            grains = select_box(grains, region[:3], region[3:])
        if edge:
            try:
                grains = select_voxels(grains, edge)
            except ValueError as error:
                raise ValueError(f"parameter points_voxel: {error}") from None
        if step > 1:
            grains = select_every(grains, step)
        self._points.publish(
            grains_to_cloud(grains, observation.time, parameters["frame_id"], tuple(parameters["points_fields"]))
        )

    def _publish_heights(self, observation: Observation) -> None:
        heights = make_height_map(observation.spheres, self._low, self._cell, self._shape).heights
        self._heights.publish(heights_to_image(heights, observation.time, self._parameters["frame_id"]))


def coarse_points(world: World) -> list[str]:
    """A warning where the single precision of messages rounds points far from the origin more than the simulation does."""
    lattice, smallest = world.assembly.lattice, min(world.assembly.smallest.values())
    resolution = float(np.spacing(np.float32(np.abs([lattice.low, lattice.high]).max())))
    if resolution <= _COARSE_POINTS * smallest:
        return []
    told = f"this far from the origin ~/points are rounded to {resolution:.2g} m, the simulation is not"
    return [f"{told}; put the scene nearer to the origin of its frame"]


def _grid(world: World, asked: float) -> tuple[np.ndarray, float, tuple[int, int]]:
    """Low corner, cell and shape of the height map; where no cell is asked for, one large enough for ``_MOST_CELLS``."""
    scene, grains = world.scene, world.observe().grains
    low, cell, shape = bed_grid(scene, grains, asked or None)
    least = cell * float(np.sqrt(np.prod(shape, dtype=float) / _MOST_CELLS))
    if least <= cell:
        return low, cell, shape
    if asked:
        raise ValueError(f"parameter heights_cell: {asked:g} m makes too many cells for a map; give at least {1.1 * least:.2g} m")
    return bed_grid(scene, grains, 1.01 * least)
