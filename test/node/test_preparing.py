"""What a node says while it prepares itself."""

import sys

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.parameter import Parameter
from scenes import write_small_scene

from sand_sim.node import preparing
from sand_sim.node.node import SandSimNode
from sand_sim.node.preparing import Preparation


def test_a_long_start_tells_how_far_it_is(monkeypatch):
    now, lines = [100.0], []
    monkeypatch.setattr(preparing.time, "monotonic", lambda: now[0])
    prepare = Preparation(lambda: None, lines.append)
    for stage, share, later in (("sampling", 1.0, 0.1), ("compiling", 0.2, 2.5), ("compiling", 0.3, 0.1), ("settling", 0.5, 2.5)):
        now[0] += later
        prepare(stage, share)
    assert lines == ["compiling, 20%", "settling, 50%"]


def test_the_start_ends_where_the_user_wants_to_stop():
    def check():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Preparation(check, print)("compiling", 0.5)


def test_a_file_of_parameters_for_another_name_is_not_taken_for_the_own_scene_in_silence(ros, tmp_path):
    file = tmp_path / "parameters.yaml"
    for name, silent in (("sand_sim_node", False), ("sand_sim", True), ("/**", True)):
        file.write_text(f"{name}: {{ros__parameters: {{scene: mine.yaml}}}}\n")
        node = SandSimNode(cli_args=["--ros-args", "--params-file", str(file)])
        told = node.parameters.unsaid()
        node.destroy_node()
        assert (
            not told
            if silent
            else "the package's own 'dig'; what a file of parameters says counts only under '/sand_sim'" in told
        )


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"tools.plate.source": "tf"}, "parameter tools.plate.source: 'tf' needs the package tf2_msgs, which is not installed"),
        (
            {"frame_names": ["base"], "frames.base.parent": "odom"},
            r"parameter frames.base.parent: .* nothing tells where 'odom' is",
        ),
        ({"recording": "run.rrd"}, "recording: Rerun cannot be imported"),
        ({"checkpoints": True, "states": "/dev/null/states"}, "checkpoint folder /dev/null/states: "),
    ],
)
def test_what_cannot_be_is_refused_before_the_work_begins(ros, tmp_path, monkeypatch, parameters, told):
    monkeypatch.setattr("msg_adapters.tf2_msgs.TFMessage", None)
    monkeypatch.setitem(sys.modules, "rerun", None)
    stages = []
    given = parameters | {"scene": str(write_small_scene(tmp_path))}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = SandSimNode(lambda stage, share: stages.append(stage), parameter_overrides=overrides)
    try:
        with pytest.raises(ValueError, match=told):
            node.start()
    finally:
        node.destroy_node()
    assert not stages
