"""Parameters: described, ranged, changeable where physics allows, refused with a reason elsewhere."""

import pytest
import trimesh
import yaml

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import START
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from scenes import write_small_scene

from sand_sim.node.parameters import DECLARATIONS

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def set_one(node, name, value):
    return node.set_parameters([Parameter(name, value=value)])[0]


def test_all_are_described_and_numbers_have_ranges(ros, start_node):
    node = start_node(pacing="lockstep")
    for declaration in DECLARATIONS:
        descriptor = node.describe_parameter(declaration.name)
        assert len(descriptor.description) > 10
        ranges = len(descriptor.floating_point_range) + len(descriptor.integer_range)
        assert ranges == (type(declaration.default) in (int, float))
        assert bool(declaration.choices) == ("One of" in descriptor.additional_constraints)
    assert node.describe_parameter("points_rate").floating_point_range[0].to_value == 1000.0
    assert node.describe_parameter("tools.plate.source").description


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("points_rate", -1.0, "points_rate out of range"),
        ("points_rate", float("nan"), "points_rate"),
        ("pacing", "slow", "pacing: unknown 'slow'; known are realtime, fast, lockstep"),
        ("points_fields", ["x", "colour"], "points_fields: unknown 'colour'; known are x, y, z"),
        ("points_fields", ["x", "x"], "points_fields: must name something, and nothing twice"),
        ("points_region", [0.0, 1.0], "points_region: must be 6 finite numbers"),
        ("points_region", [0.0, 0.0, 0.0, 1.0, 1.0, -1.0], "points_region: each of the first three"),
        ("scene", "hopper", "scene: fixed while the node is configured; clean up"),
        ("tools.plate.source", "twist", "tools.plate.source: fixed while the node is configured"),
        ("tools.plate.wrench_frame", "moon", "unknown 'moon'; known are tool, world"),
    ],
)
def test_what_cannot_be_is_refused_with_a_reason(ros, start_node, name, value, reason):
    node = start_node(pacing="lockstep")
    before = node.get_parameter(name).value
    result = set_one(node, name, value)
    assert not result.successful
    assert reason in result.reason
    assert node.parameters[name] == node.get_parameter(name).value == before


def test_pacing_changes_while_it_runs(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    assert set_one(node, "pacing", "fast").successful
    client.wait_for(lambda: client.time > 0.1)
    assert set_one(node, "pacing", "lockstep").successful
    now = node.simulation.request(lambda: node.simulation.world.time).result(30.0)
    client.send(START, at=now + 0.1)
    client.wait_for(lambda: client.time > now + 0.0999)
    assert node.simulation.world.time == pytest.approx(now + 0.1, abs=1e-4)


def test_limits_on_stamps_change_while_it_runs(client, start_node):
    node = start_node(pacing="lockstep")
    client.connect()
    client.send(START, at=100.0)
    client.wait_for(lambda: node.simulation.rejected == {"future": 1})
    assert set_one(node, "stamp_furthest", 0.05).successful
    client.send(START, at=0.06)
    client.send(START, at=0.04)
    client.wait_for(lambda: client.time > 0.0399)
    assert node.simulation.rejected == {"future": 2}


def test_two_tools_do_not_share_a_frame(ros, start_node, tmp_path):
    plate = yaml.safe_load(write_small_scene(tmp_path).read_text())["tools"]["plate"]
    blade = plate | {"trajectory": [{"time": 0.0, "position": [0.015, 0.015, 0.12]}]}
    with pytest.raises(ValueError, match=r"parameter tools.plate.frame: 'edge' is the frame of tool 'blade' already"):
        start_node({"tools": {"blade": blade, "plate": plate}}, **{"tools.blade.frame": "edge", "tools.plate.frame": "edge"})


def test_quality_of_service_is_overridden_topic_by_topic(ros, start_node):
    override = {"qos_overrides./sand_sim/points.publisher.reliability": "best_effort"}
    node = start_node(pacing="lockstep", **override)
    (points,) = node.get_publishers_info_by_topic("/sand_sim/points")
    assert points.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    for topic in ("/sand_sim/heights", "/clock", "/sand_sim/tools/plate/wrench"):
        (other,) = node.get_publishers_info_by_topic(topic)
        assert other.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_parameters_that_nobody_declares_are_named(client, start_node):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    known = {"use_sim_time": False, "qos_overrides./sand_sim/points.publisher.reliability": "best_effort"}
    gone = {"qos_overrides./sand_sim/tools/spade/wrench.publisher.reliability": "best_effort"}  # of another scene's tool
    misspelt = {"scene_file": "hopper", "tools.plaet.source": "twist", "zzz": 1, "frames.base.pose": [0.0] * 6}
    node = start_node(pacing="lockstep", **known, **gone, **misspelt)
    meant = {"scene_file": "scene", "tools.plaet.source": "tools.plate.source", "zzz": "", "frames.base.pose": "frame_names"}
    assert node.parameters.misspelt() == meant
    client.wait_for(lambda: any("is ready" in message for message in heard))
    assert [message for message in heard if "there is no parameter" in message] == [
        "there is no parameter 'scene_file'; is 'scene' meant?",
        "there is no parameter 'tools.plaet.source'; is 'tools.plate.source' meant?",
        "there is no parameter 'zzz'",
        "there is no parameter 'frames.base.pose'; is 'frame_names' meant?",
    ]


@pytest.mark.parametrize(("publish_clock", "warnings"), [(False, 1), (True, 0)])
def test_a_clock_that_is_not_followed_is_told_of(client, start_node, publish_clock, warnings):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    start_node(pacing="lockstep", use_sim_time=True, publish_clock=publish_clock)
    client.wait_for(lambda: any("is ready" in message for message in heard))
    assert len([message for message in heard if message.startswith("use_sim_time: the node follows no other /clock")]) == warnings


def test_what_was_guessed_of_a_mesh_is_told(client, start_node, tmp_path):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    tray = trimesh.creation.box((0.06, 0.06, 0.004))
    tray.update_faces(tray.face_normals[:, 2] < 0.5)
    tray.export(tmp_path / "tray.stl")
    tools = {"tray": {"mesh": "tray.stl", "material": "steel", "particle_radius": 0.003, "pose": {"position": [0, 0, 0.1]}}}
    start_node({"tools": tools}, pacing="lockstep")
    client.wait_for(lambda: any(message.startswith("tool 'tray': 1 components are open surfaces") for message in heard))


def test_a_cloud_that_cannot_be_thinned_out_names_the_parameter(client, start_node):
    heard = []
    client.node.create_subscription(Log, "/rosout", lambda log: heard.append(log.msg), LATCHED)
    node = start_node(pacing="lockstep", points_voxel=1e-9)
    told = "a cloud could not be told: parameter points_voxel: edge: 1e-09 m is too small"
    client.wait_for(lambda: any(told in message for message in heard))
    assert set_one(node, "points_voxel", 0.0).successful
    client.wait_for(lambda: client.clouds)
