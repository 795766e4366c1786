"""Robots digging and scooping sand, grain by grain."""

from sand_sim.border import CommandError, Observation, ToolPose
from sand_sim.scene.reading import load_scene, read_scene
from sand_sim.scene.types import Scene, SceneError
from sand_sim.world import World

__all__ = ["CommandError", "Observation", "Scene", "SceneError", "ToolPose", "World", "load_scene", "read_scene"]
