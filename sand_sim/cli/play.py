"""Send the poses of a scene's trajectories to a running node, as a ROS client of its own."""

import argparse

from sand_sim.config_folder import find_scene
from sand_sim.interruption import Interruption
from sand_sim.scene.reading import load_scene
from sand_sim.scene.types import SceneError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own, such as dig")
    parser.add_argument("--node", default="sand_sim", help="name of the node, after its namespace if it has one")
    parser.add_argument("--clock", default="/clock", help="topic on which the node tells simulated time")
    parser.add_argument("--frame-id", default="", help="frame that the poses are in (default: the node's world frame)")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    scene = load_scene(find_scene(options.scene))
    try:
        from sand_sim.node.player import play
    except ModuleNotFoundError as error:
        raise SceneError(f"'play' needs ROS 2, and {error.name} cannot be imported; try 'run', which does not") from None
    return play(scene, options.node.strip("/"), options.frame_id, options.clock, interruption)
