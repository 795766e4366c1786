"""What goes in and out beside poses and plain wrenches: velocities, frames, TF, filtered wrenches, contacts, heights."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import MapMetaData
from node_client import NO_TURN, START
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from msg_adapters import tf2_msgs
from msg_adapters.builtin_interfaces import stamp_to_time
from msg_adapters.geometry_msgs import command_to_twist, frame_to_transform, wrench_to_arrays
from msg_adapters.sensor_msgs import cloud_to_points, image_to_heights
from sand_sim import rotation
from sand_sim.border import Frame, ToolVelocity
from sand_sim.node import bed_outputs
from sand_sim.node.low_pass import LowPass
from sand_sim.node.tool_inputs import ToolInputs, fixed_frames

TOOL = "/sand_sim/tools/plate"
PRESSED = [0.015, 0.015, 0.0238]
TURNED = rotation.from_rpy(0.0, 0.0, 0.5 * np.pi)


def hear(client, kind, topic, depth=100):
    heard = []
    client.node.create_subscription(kind, topic, heard.append, depth)
    return heard


@pytest.mark.parametrize("held", [{"pacing": "lockstep"}, {"pacing": "fast", "paused": True}])
def test_whoever_comes_late_hears_the_time_the_bed_and_where_tools_are_though_nothing_moves(client, start_node, held):
    start_node(**held)
    client.wait_for(lambda: client.clocks)
    clocks, clouds = hear(client, Clock, "/clock"), hear(client, PointCloud2, "/sand_sim/points")
    frames, poses = hear(client, WrenchStamped, f"{TOOL}/wrench"), hear(client, PoseStamped, f"{TOOL}/pose_actual")
    client.wait_for(lambda: clocks and clouds and poses)
    assert stamp_to_time(clocks[-1].clock) == 0.0
    at = poses[-1].pose.position
    assert [at.x, at.y, at.z] == pytest.approx(START)
    assert len(cloud_to_points(clouds[-1])) == 32
    assert not frames


def press(client, orientation=NO_TURN):
    """Put the plate on the bed and press."""
    for at, position in ((0.3, START), (0.5, PRESSED), (0.6, PRESSED)):
        client.send(position, at=at, orientation=orientation)
        client.wait_for(lambda: client.time > at - 1e-5)  # noqa: B023


def test_tools_tell_what_they_feel_and_carry(client, start_node):
    node = start_node(pacing="lockstep", contacts_rate=50.0)
    filtered, poses = hear(client, WrenchStamped, f"{TOOL}/wrench_filtered"), hear(client, PoseStamped, f"{TOOL}/pose_actual")
    carried, swept = hear(client, Float64, f"{TOOL}/carried"), hear(client, Float64, f"{TOOL}/swept")
    clouds, markers = hear(client, PointCloud2, f"{TOOL}/contacts"), hear(client, MarkerArray, f"{TOOL}/contact_markers")
    client.connect()
    client.wait_for(lambda: client.node.count_publishers(f"{TOOL}/contact_markers"))
    press(client)
    report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
    for heard in (filtered, poses, carried, swept, clouds, markers):
        client.wait_for(lambda: heard)  # noqa: B023
    client.wait_for(lambda: stamp_to_time(poses[-1].header.stamp) > 0.59)
    at = poses[-1].pose.position
    assert [at.x, at.y, at.z] == pytest.approx(report.position)
    assert poses[-1].header.frame_id == "world"
    assert carried[-1].data == pytest.approx(report.carried, abs=1e-9)
    assert swept[-1].data == pytest.approx(report.swept, rel=1e-6, abs=1e-12)
    last = node.simulation.request(node.simulation.world.observe).result(30.0)
    full = replace(last, tools=(replace(report, carried=1.25, swept=2.5),))  # as such a small tool never is
    node.simulation.request(lambda: node._movers[0].publish(full)).result(30.0)
    client.wait_for(lambda: (carried[-1].data, swept[-1].data) == (1.25, 2.5))

    raw, smooth = (
        np.array([wrench_to_arrays(message)[0][2] for message in heard[-20:]]) for heard in (client.wrenches, filtered)
    )
    assert smooth[-1] == pytest.approx(raw[-1], rel=0.1)
    assert np.abs(np.diff(smooth)).max() < 0.8 * np.abs(np.diff(raw)).max()

    client.wait_for(lambda: stamp_to_time(clouds[-1].header.stamp) > 0.59)
    contacts = cloud_to_points(clouds[-1])
    pushed = contacts["fz"].sum()
    assert pushed == pytest.approx(raw[-1], rel=0.2), "of the last step, where the wrench is the mean over the frame"
    assert np.all(contacts["overlap"] > 0.0)
    seen = node.simulation.request(lambda: node.simulation.world.tool_contacts("plate")).result(30.0)
    assert np.array_equal(contacts["id"], seen.identity)
    for head, values in (("", seen.point), ("f", seen.force), ("n", seen.normal)):
        columns = np.column_stack([contacts[f"{head}{axis}"] for axis in "xyz"])
        assert columns == pytest.approx(values, rel=1e-4, abs=1e-6 * np.abs(values).max())
    client.wait_for(lambda: stamp_to_time(markers[-1].markers[0].header.stamp) > 0.59)
    lines = np.array([[p.x, p.y, p.z] for p in markers[-1].markers[0].points]).reshape(-1, 2, 3)
    assert lines[:, 0] == pytest.approx(seen.point, rel=1e-4)
    ways, sizes = lines[:, 1] - lines[:, 0], np.linalg.norm(seen.force, axis=1)
    assert np.einsum("ij,ij->i", ways, seen.force) == pytest.approx(np.linalg.norm(ways, axis=1) * sizes, rel=1e-3)


@pytest.mark.parametrize("axes", ["tool", "world"])
def test_wrenches_of_a_turned_tool_are_in_the_axes_that_are_asked_for(client, start_node, axes):
    """Plain and filtered, against the history of the run, which has forces in the world's axes and torques in the tool's."""
    node = start_node(pacing="lockstep", **{"tools.plate.wrench_frame": axes})
    filtered = hear(client, WrenchStamped, f"{TOOL}/wrench_filtered")
    client.connect()
    client.wait_for(lambda: client.node.count_publishers(f"{TOOL}/wrench_filtered"))
    press(client, rotation.from_rpy(np.pi, 0.0, 0.4))
    client.wait_for(lambda: all(heard and stamp_to_time(heard[-1].header.stamp) > 0.59 for heard in (client.wrenches, filtered)))
    client.wait_for(lambda: node.recorder.log.rows[-1]["time"] > 0.59)  # written after it has been told
    history, smooth = node.recorder.log.columns(), LowPass(10.0)
    turns = history["plate.orientation"]
    torques = [rotation.rotate(turn, torque) for turn, torque in zip(turns, history["plate.torque"], strict=True)]
    plain = np.stack([history["plate.force"], torques], axis=1)
    steps = np.diff(history["time"], prepend=0.0)
    expected = {"plain": plain[-1], "smooth": [smooth.filter(one, step) for one, step in zip(plain, steps, strict=True)][-1]}
    assert plain[-1][0][2] > 0.5, "the bed pushes up, whichever way the tool is turned"
    assert np.linalg.norm(plain[-1][1]) > 1e-4
    for message, kind in ((client.wrenches[-1], "plain"), (filtered[-1], "smooth")):
        meant = expected[kind] if axes == "world" else rotation.rotate(rotation.inverse(turns[-1]), expected[kind])
        assert message.header.frame_id == ("world" if axes == "world" else "plate")
        assert np.array(wrench_to_arrays(message)) == pytest.approx(meant, rel=1e-6, abs=1e-9)
    frame = node._movers[0].frame(node.recorder.log.last)  # as TF tells it
    assert (frame.name, frame.parent, frame.time) == ("plate", "world", pytest.approx(0.6, abs=1e-5))
    assert frame.position == pytest.approx(PRESSED)
    assert frame.orientation == pytest.approx(turns[-1])
    assert client.call(Trigger, "reset").success
    client.wait_for(lambda: all(stamp_to_time(heard[-1].header.stamp) == 0.0 for heard in (client.wrenches, filtered)))
    anew = [np.array(wrench_to_arrays(heard[-1])) for heard in (client.wrenches, filtered)]
    assert anew[1] == pytest.approx(anew[0], abs=1e-9), "nothing is left of what was before the reset"


def test_heights_and_their_grid(client, start_node):
    start_node(pacing="lockstep", heights_cell=0.0101, heights_rate=50.0)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    images, grids = hear(client, Image, "/sand_sim/heights"), hear(client, MapMetaData, "/sand_sim/heights_grid", latched)
    client.connect()
    client.wait_for(lambda: client.node.count_publishers("/sand_sim/heights") and grids)
    client.send(START, at=0.1)
    client.wait_for(lambda: images)
    heights, grid = image_to_heights(images[-1]), grids[-1]
    assert (grid.height, grid.width) == heights.shape
    assert grid.resolution == pytest.approx(0.0101)
    assert np.nanmax(heights) == pytest.approx(0.02, abs=0.001), "two layers of grains 10 mm thick"
    assert np.isfinite(heights).sum() >= 9


@pytest.mark.parametrize("edge", [0.0, 0.0202])
def test_a_cloud_shows_the_box_that_is_asked_for_and_the_topmost_of_each_voxel(client, start_node, edge):
    box = [-0.2, 0.005, -0.01, 0.012, 0.025, 0.3]  # two places along x, two along y, all heights
    node = start_node(pacing="lockstep", points_region=box, points_voxel=edge, points_fields=["id", "mass", "position"])
    client.wait_for(lambda: client.clouds)
    points = cloud_to_points(client.clouds[-1])
    seen = node.simulation.request(node.simulation.world.observe).result(30.0).grains
    inside = np.all((seen.position > box[:3]) & (seen.position < box[3:]), axis=1)
    assert 4 <= inside.sum() < len(seen) / 2
    if edge:
        top = {}
        for row in np.flatnonzero(inside):  # of those at one height the first
            voxel = tuple(np.floor(seen.position[row] / edge))
            if voxel not in top or seen.position[row, 2] > seen.position[top[voxel], 2]:
                top[voxel] = row
        assert len(top) < inside.sum()
        inside = np.isin(np.arange(len(seen)), list(top.values()))
    assert points["id"].tolist() == seen.identity[inside].tolist()
    assert points["mass"] == pytest.approx(seen.mass[inside])
    assert points["z"] == pytest.approx(seen.position[inside, 2])


def test_a_height_map_that_nobody_has_asked_for_is_no_larger_than_it_may_be(client, start_node, monkeypatch):
    monkeypatch.setattr(bed_outputs, "_MOST_CELLS", 8)
    start_node(pacing="lockstep")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    grids = hear(client, MapMetaData, "/sand_sim/heights_grid", latched)
    client.wait_for(lambda: grids)
    assert grids[-1].height == grids[-1].width == 3, "in whole cells"


def test_poses_in_fixed_frames(client, start_node):
    parameters = {
        "frame_names": ["base", "mast"],
        "frames.base.pose": [1.0, 0.0, 0.0, 0.0, 0.0, 0.5 * np.pi],
        "frames.mast.pose": [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        "frames.mast.parent": "base",
    }
    node = start_node(pacing="lockstep", **parameters)
    client.connect()
    # The mast stands at (1, 0, 0.5) and is turned left by a right angle.
    x, y, z = START
    back = rotation.inverse(TURNED)
    client.send([y, 1.0 - x, z - 0.5], at=0.1, frame="mast", orientation=back)
    client.send(START, at=0.2, frame="moon")
    client.wait_for(lambda: client.time > 0.0999)
    report = node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]
    assert report.position == pytest.approx(START, abs=1e-9)
    assert report.orientation == pytest.approx(NO_TURN, abs=1e-9)
    client.wait_for(lambda: node.simulation.rejected == {"unknown_frame": 1})
    assert "header.frame_id: frame 'moon' does not hang on 'world'; known are base, mast, world" in node.simulation.last_rejection


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        (
            {"frame_names": ["base"], "frames.base.pose": [0.0, 0.0, 0.0, 0.0, 0.0, 90.0]},
            r"parameter frames.base.pose: .* in degrees it would be \[0.0, 0.0, 1.5708\]",
        ),
        ({"frame_names": ["base"], "frames.base.parent": "moon"}, "frames.base.parent: frame 'base' does not hang on 'world'"),
        ({"frame_names": ["world"]}, "frames.world: frame 'world' in 'world': needs two different names"),
        ({"frame_names": ["base"], "frames.base.pose": [1.0]}, "frames.base.pose: must be 6 finite numbers"),
        ({"frame_id": "/map"}, "frame_id: must name a frame, without a '/' before it, not '/map'"),
        ({"frame_id": ""}, "frame_id: must name a frame, without a '/' before it, not ''"),
        ({"tools.plate.frame": ""}, "tools.plate.frame: must name a frame"),
        ({"tools.plate.frame": "/plate"}, "tools.plate.frame: must name a frame, without a '/' before it, not '/plate'"),
        ({"tools.plate.frame": "world"}, "tools.plate.frame: 'world' is the world frame; give the tool a frame of its own"),
        ({"frame_names": ["plate"]}, "tools.plate.frame: 'plate' is a frame of frame_names already; give the tool its own"),
        ({"frame_id": "plate"}, "tools.plate.frame: 'plate' is the world frame; give the tool a frame of its own"),
        ({"heights_cell": 1e-6}, "heights_cell: 1e-06 m makes too many cells for a map; give at least 1.4e-05 m"),
        ({"tools.plate.source": "telepathy"}, "tools.plate.source: unknown 'telepathy'; known are pose, twist, tf"),
    ],
)
def test_inputs_that_cannot_be_are_named(ros, start_node, parameters, named):
    with pytest.raises(ValueError, match=named):
        start_node(pacing="lockstep", **parameters)


def test_velocities_drive_a_tool(client, start_node):
    parameters = {
        "tools.plate.source": "twist",
        "tools.plate.frame": "tcp",
        "frame_names": ["base"],
        "frames.base.pose": [0.0, 0.0, 0.0, 0.0, 0.0, 0.5 * np.pi],
    }
    node = start_node(pacing="lockstep", **parameters)
    twists = client.node.create_publisher(TwistStamped, f"{TOOL}/twist", 100)
    client.wait_for(twists.get_subscription_count)
    forward = np.array([0.1, 0.0, 0.0])

    def drive(at, frame, linear, angular=(0.0, 0.0, 0.0)):
        twists.publish(command_to_twist(ToolVelocity("plate", np.array(linear), np.array(angular), time=at), frame))
        client.wait_for(lambda: client.time > at - 1e-5)
        return node.simulation.request(node.simulation.world.observe).result(30.0).tools[0]

    assert drive(0.1, "world", forward, (0.0, 0.0, 5.0 * np.pi)).position == pytest.approx(START + [0.01, 0.0, 0.0], abs=1e-5)
    report = drive(0.2, "plate", forward)
    assert report.position == pytest.approx(START + [0.01, 0.01, 0.0], abs=3e-5), "it has turned left"
    assert drive(0.3, "base", forward).position == pytest.approx(START + [0.01, 0.02, 0.0], abs=5e-5)
    assert drive(0.4, "tcp", forward).position == pytest.approx(START + [0.01, 0.03, 0.0], abs=7e-5), "the same as 'plate'"
    assert drive(0.5, "base", np.zeros(3), (0.5, 0.0, 0.0)).spin == pytest.approx([0.0, 0.5, 0.0], abs=1e-6)
    twists.publish(command_to_twist(ToolVelocity("plate", forward, np.zeros(3), time=0.6), "moon"))
    client.wait_for(lambda: node.simulation.rejected == {"unknown_frame": 1})


@pytest.fixture
def follow(monkeypatch):
    """``follow(last)`` lets the plate follow ``tcp``; the messages of TF are not among the wheels: without the middleware."""
    monkeypatch.setattr(tf2_msgs, "TFMessage", SimpleNamespace)
    heard, submitted, rejected = {}, [], []

    def subscribe(kind, topic, callback, latched=False):
        heard[topic] = callback

    parameters = {
        "frame_id": "world",
        "frame_names": [""],
        "stamps": "simulated",
        "tools.plate.source": "tf",
        "tools.plate.start": "scene",
        "tools.plate.frame": "tcp",
    }
    scene = SimpleNamespace(tools=[SimpleNamespace(name="plate")])
    world = SimpleNamespace(scene=scene)
    common = {"world": world, "courses": SimpleNamespace(), "pacing": "realtime", "frame": 0.02}
    simulation = SimpleNamespace(submit=submitted.append, reject=rejected.append, **common)

    def tell(topic, *frames):
        heard[topic](SimpleNamespace(transforms=[frame_to_transform(frame) for frame in frames]))

    def start(last=lambda: None, frames=()):
        known = fixed_frames(parameters, frames)
        ToolInputs(SimpleNamespace(subscription=subscribe), parameters, simulation, lambda: True, known, last)
        return tell, submitted, rejected

    return start


@pytest.mark.parametrize("last", [None, SimpleNamespace(time=1.0)])
def test_a_tool_follows_its_frame_in_tf(follow, last):
    tell, submitted, rejected = follow(lambda: last)
    tell("/tf", Frame("tcp", "arm", np.array([0.0, 0.0, 0.1]), NO_TURN, 0.5))
    assert not submitted, "not connected to the world yet"
    tell("/tf_static", Frame("base", "world", np.array([1.0, 0.0, 0.0]), NO_TURN))
    tell("/tf", Frame("arm", "base", np.array([0.0, 0.0, 1.0]), TURNED, 0.6), Frame("wheel", "base", np.zeros(3), NO_TURN, 0.7))
    assert len(submitted) == 1
    assert submitted[0].position == pytest.approx([1.0, 0.0, 1.1])
    assert submitted[0].orientation == pytest.approx(TURNED)
    assert submitted[0].time == pytest.approx(0.6)
    tell("/tf", Frame("wheel", "base", np.zeros(3), NO_TURN, 0.8))
    assert len(submitted) == 1, "none of its business"
    tell("/tf", Frame("arm", "base", np.array([0.0, np.nan, 1.0]), TURNED, 0.9))
    assert [error.reason for error in rejected] == ["not_finite"]
    assert len(submitted) == 1


def test_what_the_robot_description_fixes_stays_whatever_tf_tells(follow):
    tell, submitted, rejected = follow(frames=[Frame("base", "world", np.array([1.0, 0.0, 0.0]), NO_TURN)])
    for topic in ("/tf", "/tf_static"):
        tell(topic, Frame("base", "world", np.array([9.0, 0.0, 0.0]), NO_TURN, 0.4))
    tell("/tf", Frame("tcp", "base", np.array([0.0, 0.0, 0.1]), NO_TURN, 0.5))
    assert [command.position.tolist() for command in submitted] == [[1.0, 0.0, 0.1]]
    assert not rejected


def test_what_does_not_concern_a_frame_that_never_moves_sends_no_tool(follow):
    tell, submitted, _ = follow()
    tell("/tf_static", Frame("tcp", "world", np.array([1.0, 0.0, 0.0]), NO_TURN))
    for k in range(3):
        tell("/tf", Frame("wheel", "world", np.zeros(3), NO_TURN, 0.1 * k))
    assert [command.time for command in submitted] == [None]


def test_frames_stamped_ahead_do_not_stand_for_what_the_arm_tells(follow):
    """As that of the odometry in the map, which localisation tells twice a second for the second to come."""
    last = SimpleNamespace(time=0.0)
    tell, submitted, _ = follow(lambda: last)
    for k in range(100):
        last.time = 0.01 * k
        if k % 50 == 0:
            tell("/tf", Frame("odom", "world", np.zeros(3), NO_TURN, last.time + 1.0))
        tell("/tf", Frame("tcp", "odom", np.array([0.0, 0.0, last.time]), NO_TURN, last.time))
    assert len(submitted) == 100
    assert [command.position[2] for command in submitted[1:]] == pytest.approx([command.time for command in submitted[1:]])
