"""Robots digging and scooping sand, grain by grain."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sand_sim.border import CommandError, Observation, ToolPose, ToolVelocity
    from sand_sim.engine.explicit_dem import UnstableError
    from sand_sim.following import follow
    from sand_sim.scene.reading import load_scene, read_scene
    from sand_sim.scene.types import Scene, SceneError
    from sand_sim.tool_motion.playing import frame_times
    from sand_sim.world import World

__all__ = [
    "CommandError",
    "Observation",
    "Scene",
    "SceneError",
    "ToolPose",
    "ToolVelocity",
    "UnstableError",
    "World",
    "follow",
    "frame_times",
    "load_scene",
    "read_scene",
]

_HOMES = {
    "CommandError": "border",
    "Observation": "border",
    "Scene": "scene.types",
    "SceneError": "scene.types",
    "ToolPose": "border",
    "ToolVelocity": "border",
    "UnstableError": "engine.explicit_dem",
    "World": "world",
    "follow": "following",
    "frame_times": "tool_motion.playing",
    "load_scene": "scene.reading",
    "read_scene": "scene.reading",
}


def __getattr__(name: str):
    """Import public names when they are first used, so that programs can catch Ctrl-C before the long imports begin."""
    if name not in _HOMES:
        raise AttributeError(f"module 'sand_sim' has no attribute '{name}'")
    return getattr(import_module(f"sand_sim.{_HOMES[name]}"), name)
