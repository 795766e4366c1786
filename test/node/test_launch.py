"""What the launch file, the RViz configuration and the parameter file name exists; launch itself is not among the wheels."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2")

from sand_sim.config_folder import config_folder
from sand_sim.node.parameters import DECLARATIONS

ROOT = Path(__file__).parents[2]
NAMES = {declaration.name for declaration in DECLARATIONS}


class Noted:
    """Stands for any class of launch: keeps what it is made of."""

    def __init__(self, *arguments, **named):
        self.arguments, self.named = arguments, named


class Value(Noted):
    """Stands for ``ParameterValue``, which reads a type from a substitution, but takes nothing else that is not of that type."""

    def __init__(self, value, *, value_type):
        if not isinstance(value, value_type) and type(value).__name__ != "LaunchConfiguration":
            raise TypeError(f"value='{value}' is not an instance of {value_type}")
        super().__init__(value, value_type=value_type)


@pytest.fixture
def launch_file(monkeypatch):
    for module, names in {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "OpaqueFunction"],
        "launch.conditions": ["IfCondition"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["LifecycleNode", "Node"],
        "launch_ros.parameter_descriptions": ["ParameterFile", "ParameterValue"],
    }.items():
        made = ModuleType(module)
        for name in names:
            setattr(made, name, type(name, (Value if name == "ParameterValue" else Noted,), {}))
        monkeypatch.setitem(sys.modules, module, made)
    path = ROOT / "launch" / "sand_sim.launch.py"
    spec = importlib.util.spec_from_file_location("sand_sim_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def started(launch_file, **given):
    """The node that is started with some arguments, and what is declared."""
    (entries,) = launch_file.generate_launch_description().arguments
    declared = {entry.arguments[0]: entry.named for entry in entries if type(entry).__name__ == "DeclareLaunchArgument"}
    values = {name: entry["default_value"] for name, entry in declared.items()} | given
    (opaque,) = (entry for entry in entries if type(entry).__name__ == "OpaqueFunction")
    launch_file.LaunchConfiguration.perform = lambda self, context: context[self.arguments[0]]
    (node,) = opaque.named["function"](values)
    return node, declared


def test_launch_arguments_are_parameters_of_the_node(launch_file):
    node, declared = started(launch_file, **dict.fromkeys(launch_file.PARAMETERS, "1"))
    assert all(entry["description"] for entry in declared.values())
    assert set(node.named["parameters"][1]) == set(launch_file.PARAMETERS) <= NAMES
    for signal in ("sigterm", "sigkill"):
        assert float(node.named[f"{signal}_timeout"]) >= 30.0, "a second signal would end it before it has written its files"
    assert Path(declared["params_file"]["default_value"]).is_file()
    defaults = {declaration.name: declaration.default for declaration in DECLARATIONS}
    for name, (text, kind) in launch_file.PARAMETERS.items():
        assert isinstance(defaults[name], kind)
        assert str(defaults[name]).lower() in text.lower() or name == "autostart"


def test_arguments_that_are_not_given_leave_the_parameter_file_alone(launch_file):
    given = {"scene": "hopper", "real_time_factor": "2.0"}
    node, _ = started(launch_file, **given)
    asked = {name: value.arguments[0] for name, value in node.named["parameters"][1].items()}
    assert {name: value.perform(given) for name, value in asked.items()} == given


def test_what_is_launched_is_a_dependency_of_the_package(launch_file):
    (entries,) = launch_file.generate_launch_description().arguments
    started = {entry.named["package"] for entry in entries if type(entry).__name__ == "Node"}
    needed = {entry.text for entry in ElementTree.parse(ROOT / "package.xml").getroot().iter("exec_depend")}
    assert started
    assert {*started, "launch", "launch_ros"} <= needed


def test_parameter_file_names_parameters_with_their_defaults():
    given = yaml.safe_load((config_folder() / "ros" / "node.yaml").read_text())["/**"]["ros__parameters"]
    defaults = {declaration.name: declaration.default for declaration in DECLARATIONS}
    assert given == {name: defaults[name] for name in given}


def test_rviz_shows_topics_of_the_node():
    displays = yaml.safe_load((config_folder() / "ros" / "sand_sim.rviz").read_text())["Visualization Manager"]["Displays"]
    topics = {display["Topic"]["Value"] for display in displays if "Topic" in display}
    names = "points", "heights", "shapes", "plungers", "tools/bucket/contact_markers", "tools/bucket/wrench_filtered"
    assert topics == {f"/sand_sim/{name}" for name in names}
