"""Links of a robot description as meshes, and as tools of a scene."""

import numpy as np
import pytest
import trimesh
import yaml
from robots import joint, link, origin, part, robot
from scenes import write_small_scene
from shapes import MESHES

from sampler import sample_body
from sand_sim import SceneError, World, load_scene
from sand_sim.assembly.link_mesh import make_link_mesh
from sand_sim.assembly.urdf import parse_robot


def mesh_of(*parts, find=None):
    return make_link_mesh(parse_robot(robot(link("a", *parts))), "a", find)


QUARTER = (0.0, 0.5 * np.pi, 0.0)  # about y: z becomes x, x becomes -z


def test_primitives_are_as_large_as_told_and_where_told():
    """A box, and a cylinder that is laid along x, in closed form."""
    box = mesh_of(part('<box size="0.1 0.2 0.4"/>', place=origin((1.0, 2.0, 3.0), QUARTER)))
    assert box.bounds == pytest.approx(np.array([[0.8, 1.9, 2.95], [1.2, 2.1, 3.05]]))
    assert box.volume == pytest.approx(0.008)
    cylinder = mesh_of(part('<cylinder radius="0.1" length="0.4"/>', place=origin((1.0, 0.0, 0.0), QUARTER)))
    assert cylinder.bounds == pytest.approx(np.array([[0.8, -0.1, -0.1], [1.2, 0.1, 0.1]]))
    assert cylinder.volume == pytest.approx(np.pi * 0.01 * 0.4, rel=0.002)
    sphere = mesh_of(part('<sphere radius="0.1"/>', place=origin((0.0, 0.0, 1.0))))
    assert np.linalg.norm(sphere.vertices - [0.0, 0.0, 1.0], axis=1) == pytest.approx(np.full(len(sphere.vertices), 0.1))
    assert sphere.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.001, rel=0.003)
    for mesh in (box, cylinder, sphere):
        assert mesh.is_watertight
        assert mesh.volume > 0.0


@pytest.mark.parametrize("scale", ["0.001 0.002 0.003", "0.001 -0.002 0.003", "-0.001 -0.002 0.003", "-0.001 -0.002 -0.003"])
def test_meshes_are_scaled_and_mirrored(tmp_path, scale):
    """A wedge in millimetres: corners where the factors put them, and outside out although it may be mirrored."""
    wedge = trimesh.Trimesh(
        [[0, 0, 0], [100, 0, 0], [0, 60, 0], [0, 0, 30]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], process=False
    )
    wedge.export(tmp_path / "wedge.stl")
    asked = []
    mesh = mesh_of(
        part(f'<mesh filename="package://digger/wedge.stl" scale="{scale}"/>', place=origin((1.0, 0.0, 0.0))),
        find=lambda uri: asked.append(uri) or tmp_path / "wedge.stl",
    )
    assert asked == ["package://digger/wedge.stl"]
    factors = np.array(scale.split(), float)
    tip = factors * [100.0, 60.0, 30.0]
    assert mesh.bounds == pytest.approx(np.sort([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0] + tip], axis=0))
    assert mesh.volume == pytest.approx(abs(tip.prod()) / 6.0)


def test_overlapping_parts_are_one_solid():
    """A bar through a board: the particles and the volume are those of the union."""
    mesh = mesh_of(part('<box size="0.1 0.04 0.04"/>'), part('<box size="0.04 0.06 0.1"/>', place=origin((0.02, 0.0, 0.0))))
    body = sample_body(mesh, 0.003)
    assert body.volume == pytest.approx(0.1 * 0.04 * 0.04 + 0.04 * 0.06 * 0.1 - 0.04**3, rel=0.002)
    inside = np.all(np.abs(body.points - [0.02, 0.0, 0.0]) < [0.0199, 0.0299, 0.0499], axis=1)
    inside |= np.all(np.abs(body.points) < [0.0499, 0.0199, 0.0199], axis=1)
    assert not inside.any()


def test_links_of_too_many_triangles_are_refused():
    with pytest.raises(SceneError, match=r"collision 391: makes more than 2000000 triangles"):
        mesh_of(*[part('<sphere radius="1"/>')] * 10_000)


def write_scene(folder, description, tool, **further):
    """The small scene with a link as its plate."""
    path = write_small_scene(folder, **further)
    (folder / "robot.urdf").write_text(description)
    parsed = yaml.safe_load(path.read_text())
    plate = parsed["tools"]["plate"]
    del plate["mesh"]
    parsed["tools"]["plate"] = plate | tool
    path.write_text(yaml.safe_dump(parsed))
    return path


PLATE = part('<mesh filename="plate.stl"/>')
ROBOT = robot(
    link("base"),
    link("plate_link", PLATE),
    joint("base", "plate_link", origin((9.0, 9.0, 9.0))),
    link("bare"),
    joint("base", "bare"),
)
TOOL = {"urdf": "robot.urdf", "link": "plate_link"}


def test_a_link_is_the_same_tool_as_its_mesh(tmp_path):
    (tmp_path / "mesh").mkdir()
    (tmp_path / "link").mkdir()
    meshed = World(load_scene(write_small_scene(tmp_path / "mesh")))
    linked = World(load_scene(write_scene(tmp_path / "link", ROBOT, TOOL)))
    ours, theirs = (world.assembly.tools[0].body.points for world in (linked, meshed))
    assert np.array_equal(ours, theirs), "in the link's own frame, wherever the robot has it"


@pytest.mark.parametrize(
    ("description", "tool", "named"),
    [
        (ROBOT, {}, "tools.plate: give exactly one of 'mesh' and 'link'"),
        (ROBOT, {"mesh": "plate.stl", "link": "plate_link"}, "tools.plate: give exactly one of 'mesh' and 'link'"),
        (ROBOT, {"mesh": "plate.stl", "urdf": "robot.urdf"}, "tools.plate.urdf: needs a 'link' instead of a 'mesh'"),
        (ROBOT, {"urdf": "robot.urdf"}, "tools.plate: give exactly one of 'mesh' and 'link'"),
        (ROBOT, TOOL | {"scale": 0.001}, "tools.plate.scale: a URDF is in metres and scales its meshes itself"),
        (ROBOT, {"link": "plate_link"}, "tools.plate.link: no robot description is known; name its file in tools.plate.urdf"),
        (ROBOT, TOOL | {"urdf": "no.urdf"}, "tools.plate.urdf: URDF 'no.urdf': there is no file"),
        (ROBOT, TOOL | {"urdf": "package://no_such/r.urdf"}, "tools.plate.urdf: URDF 'package://no_such/r.urdf': no ROS package"),
        (ROBOT, TOOL | {"link": "tip"}, "tools.plate.link: there is no link 'tip'; known are bare, base, plate_link"),
        (ROBOT, TOOL | {"link": "bare"}, "tools.plate.link: link 'bare' has neither collision nor visual geometry"),
        ("<robot>", TOOL, "robot.urdf: is not valid XML"),
        (ROBOT.replace("plate.stl", "none.stl"), TOOL, "link 'plate_link', collision 1: mesh 'none.stl': there is no file"),
        (
            ROBOT.replace("plate.stl", "/etc/passwd"),
            TOOL,
            "mesh '/etc/passwd': lies outside the folders that meshes may come from",
        ),
        (ROBOT.replace("plate.stl", "package://numpy/a.stl"), TOOL, "mesh 'package://numpy/a.stl': no ROS package 'numpy'"),
        (ROBOT.replace("plate.stl", "robot.urdf"), TOOL, "link 'plate_link', collision 1: mesh robot.urdf: "),
        (
            ROBOT.replace('stl"', 'stl" scale="1 1"'),
            TOOL,
            "tools.plate.link: link 'plate_link', collision 1, mesh: scale must be 3",
        ),
    ],
)
def test_what_is_wrong_with_a_link_is_named(tmp_path, description, tool, named):
    with pytest.raises(SceneError) as caught:
        World(load_scene(write_scene(tmp_path, description, tool)))
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not (MESHES / "franka_hand_col.stl").is_file(), reason="real meshes are not here")
def test_real_meshes_under_two_joints(tmp_path):
    """The hull of a hand and a base, each moved as the description says."""
    hand, base = (trimesh.load_mesh(MESHES / f"{name}.stl") for name in ("franka_hand_col", "robotiq140_base"))
    parts = [
        part('<mesh filename="franka_hand_col.stl"/>', place=origin((0.0, 0.0, 0.1))),
        part('<mesh filename="robotiq140_base.stl"/>', "visual"),
    ]
    described = parse_robot(robot(link("base"), link("hand", *parts), joint("base", "hand")))
    mesh = make_link_mesh(described, "hand", lambda uri: MESHES / uri)
    assert mesh.bounds == pytest.approx(hand.bounds + [0.0, 0.0, 0.1])
    assert len(mesh.faces) == len(hand.faces) != len(base.faces), "what is only seen does not collide"


def test_another_mesh_takes_the_place_of_a_link(tmp_path):
    """Also in a state that is put back into a world that has never had it."""
    trimesh.creation.box((0.03, 0.03, 0.004)).export(tmp_path / "small_plate.stl")
    path = write_scene(tmp_path, ROBOT, TOOL)
    world = World(load_scene(path))
    world.set_tool_mesh("plate", "small_plate.stl")
    other = World(load_scene(path))
    other.restore(world.save())
    for one in (world, other):
        assert one.tools[0].mesh.extents == pytest.approx([0.03, 0.03, 0.004])
    other.reset()
    assert other.tools[0].mesh.extents == pytest.approx([0.06, 0.06, 0.004])
