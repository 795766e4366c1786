"""What RViz is told to draw: tools in their frames, boundaries, and plungers where they are."""

import numpy as np
import pytest
import trimesh

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import Marker, MarkerArray

PLANE = {"type": "plane", "name": "floor", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 1]}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def hear(client, topic):
    heard = []
    client.node.create_subscription(MarkerArray, topic, heard.append, LATCHED)
    return heard


def corners(marker):
    return np.array([[point.x, point.y, point.z] for point in marker.points])


def by_name(message):
    return {(marker.ns, marker.id): marker for marker in message.markers}


def test_tools_and_boundaries_are_told_to_whoever_comes_and_anew_when_a_tool_has_another_mesh(client, start_node, tmp_path):
    heights = tmp_path / "ground.npz"
    np.savez(heights, heights=np.full((9, 9), -0.03))
    boundaries = [
        PLANE,
        {**PLANE, "point": [0, 0, -0.01]},
        {**PLANE, "name": "side", "point": [-0.1, 0, 0], "normal": [1, 0, 0]},
        {**PLANE, "name": "far", "point": [0, 0, -7]},
        {"type": "box", "name": "bin", "material": "steel", "low": [-0.1, -0.1, 0], "high": [0.1, 0.15, 0.2], "open": ["top"]},
        {"type": "bin", "name": "tray", "material": "steel", "low": [-0.1, 0.15, 0], "high": [0.1, 0.19, 0.05]},
        {"type": "cylinder", "name": "drum", "material": "steel", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.19},
        {
            "type": "terrain",
            "name": "ground",
            "material": "steel",
            "heights": str(heights),
            "spacing": 0.02,
            "particle_radius": 0.01,
        },
    ]
    node = start_node({"boundaries": boundaries}, pacing="lockstep", frame_id="map", **{"tools.plate.frame": "hand"})
    shapes = hear(client, "/sand_sim/shapes")
    client.wait_for(lambda: shapes)
    late = hear(client, "/sand_sim/shapes")
    client.wait_for(lambda: late)
    markers = by_name(shapes[0])
    plate = markers.pop(("tools/plate", 0))
    assert (plate.header.frame_id, plate.frame_locked, plate.type) == ("hand", True, Marker.TRIANGLE_LIST)
    mesh = node.simulation.world.tools[0].mesh
    assert corners(plate).reshape(-1, 3, 3) == pytest.approx(np.asarray(mesh.triangles))
    assert {marker.header.frame_id for marker in markers.values()} == {"map"}
    kinds = {name: marker.type for name, marker in markers.items()}
    lines, faces = Marker.LINE_LIST, Marker.TRIANGLE_LIST
    assert kinds == {
        ("boundaries/floor", 0): faces,
        ("boundaries/floor", 1): faces,
        ("boundaries/side", 0): lines,
        ("boundaries/bin", 0): lines,
        ("boundaries/tray", 0): lines,
        ("boundaries/drum", 0): faces,
        ("boundaries/ground", 0): faces,
    }, "one outside of the domain is not drawn"
    drawn = {name[0].rpartition("/")[2] + "_2" * name[1]: corners(marker) for name, marker in markers.items()}
    for name, z in (("floor", 0.0), ("floor_2", -0.01)):
        assert drawn[name].min(axis=0) == pytest.approx([-0.2, -0.2, z])
        assert drawn[name].max(axis=0) == pytest.approx([0.25, 0.25, z])
    assert drawn["side"][:, 0] == pytest.approx(-0.1)
    assert drawn["bin"].shape == (24, 3)
    lengths = np.linalg.norm(np.diff(drawn["bin"].reshape(-1, 2, 3), axis=1), axis=2)
    assert np.sort(lengths.ravel()) == pytest.approx([0.2] * 8 + [0.25] * 4)
    assert np.linalg.norm(drawn["drum"][:, :2], axis=1) == pytest.approx(0.19)
    assert drawn["ground"][:, 2].max() == pytest.approx(-0.03)

    small = trimesh.creation.box((0.03, 0.03, 0.004))
    small.export(tmp_path / "small_plate.stl")
    node.simulation.change(lambda: node.simulation.world.set_tool_mesh("plate", "small_plate.stl")).result(30.0)
    client.wait_for(lambda: len(shapes) > 1)
    assert np.ptp(corners(by_name(shapes[-1])["tools/plate", 0]), axis=0) == pytest.approx([0.03, 0.03, 0.004])


def test_plungers_are_told_where_they_are(client, start_node):
    press = {"type": "plunger", "name": "press", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.1}
    node = start_node({"boundaries": [PLANE, press]}, pacing="lockstep")
    shapes, plungers = hear(client, "/sand_sim/shapes"), hear(client, "/sand_sim/plungers")
    client.wait_for(lambda: shapes and plungers)
    assert ("boundaries/press", 0) not in by_name(shapes[0])
    assert corners(plungers[0].markers[0])[:, 2] == pytest.approx(0.2)
    for _ in range(5):
        node.simulation.step().result(30.0)
    client.wait_for(lambda: corners(plungers[-1].markers[0])[0, 2] < 0.19 + 1e-6)
    assert corners(plungers[-1].markers[0])[:, 2] == pytest.approx(0.2 - 0.1 * node.simulation.world.time, abs=1e-5)
