"""Services that change the world: states, grains, meshes; and a node that goes on where another was killed."""

import signal
import time

import numpy as np
import pytest
import trimesh

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE, START, Client, ask, drive
from processes import kill
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from scenes import write_small_scene
from std_srvs.srv import Trigger

from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import wrench_to_arrays
from msg_adapters.sensor_msgs import cloud_to_points
from sand_sim import load_scene


def position_of(client, node):
    return node.simulation.request(node.simulation.world.observe).result(30.0).grains.position


def test_plungers_are_driven_otherwise(client, start_node):
    """In lockstep, so that from the answer on all steps are driven so."""
    lid = {"type": "plunger", "name": "lid", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.0}
    floor = {"name": "floor", "type": "plane", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 1]}
    node = start_node({"boundaries": [floor, lid]}, pacing="lockstep")
    client.connect()
    assert ask(client, "drive_plunger", plunger="lid", velocity=0.1) == (True, "plunger 'lid' is driven")
    assert client.call(Trigger, "step").success
    seen = node.simulation.request(node.simulation.world.observe).result(30.0)
    assert seen.wall("lid").position[2] == pytest.approx(0.2 - 0.1 * seen.time, abs=1e-9)
    assert ask(client, "drive_plunger", plunger="lid") == (
        False,
        "plunger 'lid': give exactly one of 'force' [N] and 'velocity' [m/s]",
    )


def test_states_are_saved_and_loaded(client, start_node, tmp_path):
    node = start_node(pacing="lockstep", states=str(tmp_path / "kept"))
    client.connect()
    client.send(START - [0.0, 0.0, 0.02], at=0.1)
    client.wait_for(lambda: client.time > 0.0999)
    good, told = ask(client, "save_state", name="before")
    assert good, told
    assert (tmp_path / "kept" / "before.state").is_file()
    kept = position_of(client, node)
    client.send(START - [0.0, 0.0, 0.0362], at=0.3)
    client.wait_for(lambda: client.time > 0.2999)
    assert not np.array_equal(position_of(client, node), kept)
    assert ask(client, "load_state", name="before") == (True, "t = 0.100000 s")
    client.wait_for(lambda: client.time == pytest.approx(0.1, abs=1e-4))
    assert np.array_equal(position_of(client, node), kept)
    for name in ("../before", "/etc/passwd", "", ".hidden", "a/b"):
        good, told = ask(client, "load_state", name=name)
        assert not good
        assert "no path" in told
    good, told = ask(client, "load_state", name="never")
    assert not good
    assert "never.state" in told
    (tmp_path / "kept" / "broken.state").write_bytes((tmp_path / "kept" / "before.state").read_bytes()[:-100])
    good, told = ask(client, "load_state", name="broken")
    assert not good
    assert "broken.state" in told
    assert np.array_equal(position_of(client, node), kept)
    assert node.simulation.fault is None


def test_a_state_is_named_after_its_scene(client, start_node, tmp_path):
    start_node({"name": "wet bed"}, pacing="lockstep", states=str(tmp_path / "states"))
    assert ask(client, "save_state") == (True, str(tmp_path / "states" / "wet bed.state"))
    assert ask(client, "load_state")[0]


def test_a_change_between_frames_adds_no_wrench(client, start_node):
    """The mean over a frame is told once; what grains come to at the same stamp is seen in the cloud."""
    start_node(pacing="lockstep")
    client.connect()
    client.send(START - [0.0, 0.0, 0.0362], at=0.2)
    client.wait_for(lambda: client.time > 0.1999)
    assert ask(client, "spawn_grains", position=[0.1, 0.1, 0.1], radius=0.005)[0]
    client.wait_for(lambda: len(cloud_to_points(client.clouds[-1])) == 33)
    client.send(START - [0.0, 0.0, 0.0362], at=0.22)
    client.wait_for(lambda: client.time > 0.2199 and stamp_to_time(client.wrenches[-1].header.stamp) > 0.2199)
    stamps = [stamp_to_time(message.header.stamp) for message in client.wrenches]
    assert len(set(stamps)) == len(stamps)


def test_grains_come_and_go(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    good, told = ask(client, "spawn_grains", position=[0.1, 0.1, 0.05, 0.1, 0.12, 0.05], radius=0.005, velocity=[0.0, 0.0, -0.1])
    assert (good, told) == (True, "2 grains, id 32 to 33")
    new = node.simulation.request(node.simulation.world.observe).result(30.0).grains
    assert new.position[32:] == pytest.approx(np.array([[0.1, 0.1, 0.05], [0.1, 0.12, 0.05]]), abs=1e-6)
    assert new.velocity[32:] == pytest.approx(np.array([[0.0, 0.0, -0.1]] * 2), abs=1e-6)
    client.wait_for(lambda: client.clouds and len(cloud_to_points(client.clouds[-1])) == 34)
    assert client.call(Trigger, "step").success
    good, told = ask(client, "remove_grains", low=[0.05, 0.05, 0.0], high=[0.2, 0.2, 0.2])
    assert (good, told) == (True, "2 grains")
    assert ask(client, "remove_grains", id=[0, 1]) == (True, "2 grains")
    client.wait_for(lambda: len(cloud_to_points(client.clouds[-1])) == 30)
    for arguments, reason in (
        ({"position": [0.03, 0.03, 0.005], "radius": 0.005}, "overlap"),
        ({"position": [0.0, 0.0], "radius": 0.005}, "argument 'position': must be x y z"),
        ({"position": [0.1, 0.1, 0.05], "radius": float("nan")}, "finite"),
        ({"position": [0.1, 0.1, 0.05]}, "argument 'radius' is missing"),
        ({"position": [0.1, 0.1, 0.05], "radius": "big"}, "argument 'radius': must be double, not string"),
        ({"position": [9.9, 0.1, 0.05], "radius": 0.005}, "domain"),
        (
            {"position": [0.1, 0.1, 0.05] * 3, "radius": 0.005, "velocity": [0.0, 0.0, -0.1] * 2},
            "argument 'velocity': must be x y z of one or of all 3 grains, not of 2",
        ),
        ({"position": [0.1, 0.1, 0.05], "radius": 0.005, "colour": "red"}, "unknown argument 'colour'"),
    ):
        good, told = ask(client, "spawn_grains", **arguments)
        assert not good
        assert reason in told
    assert not ask(client, "remove_grains")[0]
    for long in ("low", "high"):
        box = {"low": [0.0] * 3, "high": [0.2] * 3}
        told = ask(client, "remove_grains", **box | {long: 2 * box[long]})
        assert told == (False, f"argument '{long}': must be x y z of 1, not 6 numbers")
    assert not ask(client, "remove_grains", id=[4000])[0]
    odd = SetParametersAtomically.Request(parameters=[ParameterMessage(name="radius", value=ParameterValue(type=200))])
    assert "there is no type 200" in client.call(SetParametersAtomically, "spawn_grains", odd).result.reason
    assert node.simulation.fault is None
    assert client.call(Trigger, "reset").success
    client.wait_for(lambda: len(cloud_to_points(client.clouds[-1])) == 32)


def test_a_tool_gets_another_mesh(client, start_node, tmp_path):
    node = start_node(pacing="lockstep")
    client.connect()
    trimesh.creation.box((0.03, 0.03, 0.004)).export(tmp_path / "small_plate.stl")
    good, told = ask(client, "set_tool_mesh", tool="plate", mesh="small_plate.stl")
    assert (good, told) == (True, "tool 'plate' has mesh small_plate.stl")
    assert node.simulation.world.tools[0].mesh.extents == pytest.approx([0.03, 0.03, 0.004])
    open_box = trimesh.creation.box((0.03, 0.03, 0.004))
    open_box.update_faces(open_box.face_normals[:, 2] < 0.5)
    open_box.export(tmp_path / "tray.stl")
    good, told = ask(client, "set_tool_mesh", tool="plate", mesh="tray.stl")
    assert good
    assert "; 1 components are open surfaces; they are taken for sheets" in told
    for arguments, reason in (
        ({"tool": "spade", "mesh": "small_plate.stl"}, "spade"),
        ({"tool": "plate", "mesh": "../../../etc/passwd"}, "argument 'mesh'"),
        ({"tool": "plate", "mesh": "/etc/passwd"}, "outside the folders"),
        ({"tool": "plate", "mesh": "missing.stl"}, "there is no file"),
        ({"tool": "plate", "mesh": "small_plate.stl", "scale": 0.0}, "scale"),
        ({"tool": "plate", "mesh": "bed.npz"}, "bed.npz"),
    ):
        good, told = ask(client, "set_tool_mesh", **arguments)
        assert not good
        assert reason in told
    assert client.call(Trigger, "step").success


def test_a_killed_node_goes_on_from_its_checkpoint(start_process, ros, tmp_path):
    """Driven by the same poses, the wrenches after it are those of a run that was never broken off."""
    path = write_small_scene(tmp_path)
    scene = load_scene(path)

    def run(kill_at=None, **parameters):
        client = Client()
        process = start_process(scene=path, pacing="lockstep", points_rate=0.0, **parameters)
        try:
            client.connect()
            client.wait_for(lambda: client.clocks or client.call(Trigger, "step").success)
            begin = client.time
            drive(client, scene, begin, kill_at or 0.4)
            if kill_at:
                time.sleep(0.3)
                kill(process)
            else:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=PATIENCE)
        finally:
            client.close()
        return begin, {stamp_to_time(m.header.stamp): np.concatenate(wrench_to_arrays(m)) for m in client.wrenches}

    _, whole = run()
    states = {"states": tmp_path / "states", "checkpoints": True, "checkpoint_period": 0.0}
    run(kill_at=0.24, **states)
    begin, rest = run(resume=True, **states)
    assert 0.1 < begin <= 0.26
    assert max(rest) == pytest.approx(0.4)
    later = [at for at in rest if at > begin + 0.021]
    assert len(later) > 5
    for at in later:
        assert np.array_equal(rest[at], whole[at]), at
    assert any(np.abs(rest[at]).max() > 0.5 for at in later)
