"""Lifecycle: configure, activate, deactivate, clean up, and whatever a client asks in the wrong moment."""

import gc
import threading
import time
import weakref

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from node_client import START
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from scenes import write_small_scene
from std_srvs.srv import Trigger

from sand_sim.node.node import SandSimNode


def change(client, label):
    request = ChangeState.Request(transition=Transition(id=getattr(Transition, f"TRANSITION_{label.upper()}"), label=""))
    return client.call(ChangeState, "change_state", request).success


def state(client):
    return client.call(GetState, "get_state").current_state.label


def test_a_life(client, start_node, tmp_path):
    node = start_node(autostart=False, pacing="lockstep")
    assert state(client) == "unconfigured"
    assert client.node.count_publishers("/sand_sim/points") == 0
    assert change(client, "configure")
    assert state(client) == "inactive"
    client.connect()
    client.send(START, at=0.1)
    client.wait_for(lambda: node.simulation.rejected == {"inactive": 1})
    answer = client.call(Trigger, "step")
    assert not answer.success
    assert "inactive" in answer.message
    assert node.simulation.world.time == 0.0

    assert change(client, "activate")
    client.send(START, at=0.1)
    client.wait_for(lambda: client.time > 0.0999)
    client.send(START, at=5.0)
    assert change(client, "deactivate")
    held = node.simulation.request(lambda: node.simulation.world.time).result(30.0)
    assert held < 5.0
    assert change(client, "activate")
    client.wait_for(lambda: client.time > held + 0.01)

    assert change(client, "deactivate")
    assert change(client, "cleanup")
    assert state(client) == "unconfigured"
    client.wait_for(lambda: client.node.count_publishers("/sand_sim/points") == 0)
    (tmp_path / "second").mkdir()
    second = write_small_scene(tmp_path / "second", name="second")
    assert node.set_parameters([Parameter("scene", value=str(second))])[0].successful
    assert change(client, "configure")
    assert change(client, "activate")
    assert node.simulation.world.scene.name == "second"
    client.wait_for(client.poses.get_subscription_count)
    client.send(START, at=0.02)
    client.wait_for(lambda: node.simulation.world.time == pytest.approx(0.02, abs=1e-4))
    assert change(client, "active_shutdown")
    assert node.done


def test_each_run_of_a_node_has_files_of_its_own(client, start_node, tmp_path):
    recording, output = tmp_path / "a.rrd", tmp_path / "out"
    node = start_node(autostart=False, pacing="lockstep", recording=str(recording), output=str(output))
    for _ in range(3):
        for transition in ("configure", "activate"):
            assert change(client, transition)
        assert client.call(Trigger, "step").success
        for transition in ("deactivate", "cleanup"):
            assert change(client, transition)
    assert all((tmp_path / file).stat().st_size for file in ("a.rrd", "a.2.rrd", "a.3.rrd"))
    assert all((output / folder / "small.json").stat().st_size for folder in (".", "2", "3"))
    assert not node.incomplete


def test_impossible_transitions_are_refused(client, start_node):
    node = start_node(pacing="lockstep")
    for label in ("configure", "activate", "cleanup", "unconfigured_shutdown"):
        assert not change(client, label), label
    bad = ChangeState.Request(transition=Transition(id=200, label="explode"))
    assert not client.call(ChangeState, "change_state", bad).success
    assert state(client) == "active"
    assert client.call(Trigger, "step").success
    assert node.configured
    heard = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), latched)
    for label in ("configure", "explode"):
        told = f"transition '{label}' is not possible now; possible are deactivate, shutdown"
        client.wait_for(lambda: told in heard)  # noqa: B023


@pytest.mark.parametrize("transition", ["deactivate", "active_shutdown"])
def test_what_was_asked_before_a_transition_is_answered_before_its_service_goes(client, start_node, transition):
    node = start_node(pacing="lockstep")
    go_on = threading.Event()
    node.simulation.request(go_on.wait)  # as a frame that takes long
    step = client.ask(Trigger, "step")
    client.wait_for(lambda: node.simulation._step in [act for act, _ in node.simulation._requests])
    number = getattr(Transition, f"TRANSITION_{transition.upper()}")
    transit = client.ask(ChangeState, "change_state", ChangeState.Request(transition=Transition(id=number)))
    threading.Timer(0.5, go_on.set).start()
    client.wait_for(transit.done)
    assert transit.result().success
    if transition == "deactivate":
        assert change(client, "cleanup")
    client.wait_for(step.done, patience=10.0)
    assert step.result().success


def test_frames_that_have_changed_are_looked_at_again(client, start_node):
    node = start_node(pacing="lockstep")
    for frame, tool in (("world", "world"), ("plate", "plate")):
        if node.configured:
            assert change(client, "deactivate")
            assert change(client, "cleanup")
        for name, value in (("frame_id", frame), ("tools.plate.frame", tool)):
            assert node.set_parameters([Parameter(name, value=value)])[0].successful
        assert not change(client, "configure")
        told = f"parameter tools.plate.frame: '{tool}' is the world frame; give the tool a frame of its own"
        assert str(node.failure) == told
    assert node.set_parameters([Parameter("tools.plate.frame", value="spade")])[0].successful
    assert change(client, "configure")


def test_a_scene_that_cannot_be_leaves_the_node_unconfigured(client, start_node, tmp_path):
    node = start_node(autostart=False, pacing="lockstep")
    good = node.get_parameter("scene").value
    assert node.set_parameters([Parameter("scene", value="no_such_scene")])[0].successful
    assert not change(client, "configure")
    assert state(client) == "unconfigured"
    assert "no_such_scene" in str(node.failure)
    assert client.node.count_publishers("/sand_sim/points") == 0
    assert node.set_parameters([Parameter("scene", value=good)])[0].successful
    assert change(client, "configure")
    assert state(client) == "inactive"


def test_pausing_and_activity_both_hold(client, start_node):
    node = start_node(pacing="fast", paused=True)
    client.connect()
    assert client.call(Trigger, "resume").success
    client.wait_for(lambda: node.simulation.world.time > 0.0)
    assert client.call(Trigger, "pause").success
    assert change(client, "deactivate")
    assert not client.call(Trigger, "resume").success
    assert change(client, "activate")
    assert node.simulation.paused, "as it was before"


def test_a_run_stops_at_its_duration(client, start_node):
    """However long it takes until whoever runs the node ends it."""
    node = start_node(pacing="fast", duration=0.1)
    client.wait_for(lambda: node.done)
    time.sleep(0.3)
    assert node.simulation.world.time == pytest.approx(0.1, abs=1e-4)


def test_a_destroyed_node_leaves_the_graph(client, tmp_path):
    """At once, not when garbage is collected: whoever asks by its name would be told of the one that is gone."""
    node = SandSimNode(parameter_overrides=[Parameter("scene", value=str(write_small_scene(tmp_path)))])
    gc.disable()
    try:
        node.start()
        client.wait_for(lambda: "sand_sim" in client.node.get_node_names())
        node.destroy_node()
        client.wait_for(lambda: "sand_sim" not in client.node.get_node_names(), patience=5.0)
    finally:
        gc.enable()


def test_a_world_that_is_cleaned_up_goes_with_its_threads(ros, tmp_path):
    """At once, not when garbage is collected: the next one is made beside it, and a test beside nodes that have ended."""
    node = SandSimNode(parameter_overrides=[Parameter("scene", value=str(write_small_scene(tmp_path)))])
    gc.collect()
    gc.disable()
    try:
        node.start()
        assert node.simulation.step().result(30.0) is None
        world = node.simulation.world
        left = [weakref.ref(one) for one in (node.simulation, world, world.assembly.solver.device)]
        del world
        node.trigger_deactivate()
        node.trigger_cleanup()
        assert [one() for one in left] == [None, None, None]
    finally:
        gc.enable()
        node.destroy_node()


def test_time_that_a_run_is_held_is_not_counted(client, start_node):
    node = start_node()
    client.wait_for(lambda: client.time > 0.05)
    log = node.recorder.log
    for hold, go_on in ((("pause", Trigger), ("resume", Trigger)), (("deactivate", None), ("activate", None))):
        begin, before = time.monotonic(), log.rows[-1]["wall"]
        for name, kind in (hold, go_on):
            assert client.call(kind, name).success if kind else change(client, name)
            if name == hold[0]:
                time.sleep(0.5)
        rows = len(log.rows)
        client.wait_for(lambda rows=rows: len(log.rows) > rows)
        assert log.rows[-1]["wall"] - before < time.monotonic() - begin - 0.45
