"""Launch the node on a scene, with RViz if asked: ``ros2 launch sand_sim sand_sim.launch.py scene:=dig rviz:=true``."""

from pathlib import Path

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue

from launch import LaunchDescription

# Name: default, description, type; passed on as parameters of the node.
PARAMETERS = {
    "scene": ("dig", "Scene file, or the name of one of the package's own scenes.", str),
    "pacing": ("realtime", "realtime, fast or lockstep.", str),
    "real_time_factor": ("1.0", "Simulated over wall seconds in realtime pacing.", float),
    "frame_id": ("world", "Name of the world frame in all messages.", str),
    "publish_clock": ("true", "Publish simulated time on /clock.", bool),
    "autostart": ("true", "Configure and activate at once; otherwise wait for lifecycle transitions.", bool),
    "recording": ("", "Rerun recording to write (.rrd); empty for none.", str),
    "output": ("", "Folder for summary, history and figure at the end; empty for none.", str),
    "view": ("false", "Open the Rerun viewer.", bool),
}
ENDING = "60"  # [s] that the node may take to write recording, history and figure
CONFIG = Path(__file__).parent.parent / "config"
OTHERS = {
    "name": ("sand_sim", "Name of the node."),
    "namespace": ("", "Namespace of the node."),
    "params_file": (str(CONFIG / "ros" / "node.yaml"), "Further parameters, those above taking precedence."),
    "rviz": ("false", "Open RViz with tools, grains and contact forces; set up for /sand_sim, a bucket, and world."),
}


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node with them."""
    described = {name: (default, text) for name, (default, text, _) in PARAMETERS.items()} | OTHERS
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in described.items()]
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, _, kind) in PARAMETERS.items()}
    simulation = LifecycleNode(
        package="sand_sim",
        executable="sand_sim_node",
        name=LaunchConfiguration("name"),
        namespace=LaunchConfiguration("namespace"),
        output="screen",
        sigterm_timeout=ENDING,  # a second signal means: at once, and what is being written is lost
        sigkill_timeout=ENDING,
        parameters=[ParameterFile(LaunchConfiguration("params_file"), allow_substs=True), parameters],
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(CONFIG / "ros" / "sand_sim.rviz")],
        parameters=[{"use_sim_time": True}],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription([*declared, simulation, rviz])
