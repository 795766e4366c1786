"""Launch the node on a scene: ``ros2 launch sand_sim sand_sim.launch.py scene:=dig pacing:=realtime``."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = {
    "scene": ("dig", "Scene file, or the name of one of the package's own scenes.", str),
    "pacing": ("realtime", "realtime, fast or lockstep.", str),
    "real_time_factor": ("1.0", "Simulated over wall seconds in realtime pacing.", float),
    "frame_id": ("world", "Name of the world frame in all messages.", str),
    "recording": ("", "Rerun recording to write (.rrd); empty for none.", str),
    "view": ("false", "Open the Rerun viewer.", bool),
}


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node with them."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text, _) in ARGUMENTS.items()
    ]
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, _, kind) in ARGUMENTS.items()}
    node = Node(package="sand_sim", executable="sand_sim_node", name="sand_sim", output="screen", parameters=[parameters])
    return LaunchDescription([*declared, node])
