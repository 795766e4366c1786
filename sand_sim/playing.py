"""Play the trajectories of a scene: the poses that a client sends, frame by frame."""

from collections.abc import Iterator

from sand_sim.border import ToolPose
from sand_sim.scene.types import Scene
from sand_sim.track import pose_on_trajectory


def frame_times(scene: Scene, duration: float | None = None) -> Iterator[float]:
    """Ends of all frames of a scene [s]."""
    for k in range(round((duration or scene.duration) * scene.frame_rate)):
        yield (k + 1) / scene.frame_rate


def commands_at(scene: Scene, time: float) -> list[ToolPose]:
    """Poses that the tools with a trajectory have at a time [s]."""
    driven = [tool for tool in scene.tools if tool.trajectory]
    return [ToolPose(tool.name, *pose_on_trajectory(tool.trajectory, time), time) for tool in driven]
