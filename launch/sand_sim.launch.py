"""Launch the node on a scene, with RViz if asked: ``ros2 launch sand_sim sand_sim.launch.py scene:=dig rviz:=true``."""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue

from launch import LaunchDescription

# Name: description, type; passed on as parameters of the node if given, so that a parameter file may set them, too.
PARAMETERS = {
    "scene": ("Scene file, or the name of one of the package's own scenes; dig if not given.", str),
    "pacing": ("realtime, fast or lockstep; realtime if not given.", str),
    "real_time_factor": ("Simulated over wall seconds in realtime pacing; 1.0 if not given.", float),
    "frame_id": ("Name of the world frame in all messages; world if not given.", str),
    "publish_clock": ("Publish simulated time on /clock; true if not given.", bool),
    "autostart": ("Configure and activate at once, as if not given; false waits for lifecycle transitions.", bool),
    "recording": ("Rerun recording to write (.rrd); none if not given.", str),
    "output": ("Folder for summary, history and figure at the end; none if not given.", str),
    "view": ("Open the Rerun viewer; false if not given.", bool),
}
ENDING = "60"  # [s] that the node may take to write recording, history and figure
CONFIG = Path(__file__).parent.parent / "config"
OTHERS = {
    "name": ("sand_sim", "Name of the node."),
    "namespace": ("", "Namespace of the node."),
    "params_file": (str(CONFIG / "ros" / "node.yaml"), "Further parameters; arguments that are given take precedence."),
    "rviz": ("false", "Open RViz with tools, boundaries, grains and contact forces; set up for /sand_sim, a bucket, and world."),
}


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the node with them."""
    described = {name: ("", text) for name, (text, _) in PARAMETERS.items()} | OTHERS
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in described.items()]
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(CONFIG / "ros" / "sand_sim.rviz")],
        parameters=[{"use_sim_time": True}],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription([*declared, OpaqueFunction(function=start_node), rviz])


def start_node(context) -> list[LifecycleNode]:
    """The node, with the arguments that were given."""
    asked = {name: LaunchConfiguration(name) for name in PARAMETERS}  # substitutions: launch turns no plain text into numbers
    given = {name: ParameterValue(ask, value_type=PARAMETERS[name][1]) for name, ask in asked.items() if ask.perform(context)}
    node = LifecycleNode(
        package="sand_sim",
        executable="sand_sim_node",
        name=LaunchConfiguration("name"),
        namespace=LaunchConfiguration("namespace"),
        output="screen",
        sigterm_timeout=ENDING,  # a second signal means: at once, and what is being written is lost
        sigkill_timeout=ENDING,
        parameters=[ParameterFile(LaunchConfiguration("params_file"), allow_substs=True), given],
    )
    return [node]
