"""Robot descriptions: where fixed links are, what is refused, and that a stranger's file can do no harm."""

import time
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import joint, link, moved, origin, part, robot

from sand_sim import SceneError, rotation
from sand_sim.assembly.urdf import load_robot, parse_robot
from sand_sim.node.frames import FrameTree

BOX = '<box size="1 2 3"/>'
HUGE = 10_000_001


def transform(xyz, rpy):
    """From a link's frame to its parent's by URDF: roll about x, then pitch about y, then yaw about z, all of them fixed."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = about_z @ about_y @ about_x, xyz
    return matrix


def test_chained_origins_are_the_product_of_their_matrices():
    random = np.random.default_rng(4)
    origins = [(random.normal(size=3), random.uniform(-np.pi, np.pi, 3)) for _ in range(4)]
    names = ["world", "base", "mast", "boom", "tip"]
    joints = [joint(a, b, origin(*place)) for a, b, place in zip(names, names[1:], origins, strict=False)]
    described = parse_robot(robot(*map(link, reversed(names)), *reversed(joints)))
    assert described.root == "world"
    frames = described.fixed_frames()
    assert [frame.name for frame in frames] == names[1:], "parents first, in whatever order the file has them"
    tree = FrameTree("world")
    for frame in frames:
        tree.put(frame)
    expected = np.eye(4)
    for name, place in zip(names[1:], origins, strict=True):
        expected = expected @ transform(*place)
        position, orientation = tree.in_root(name, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        assert position == pytest.approx(expected[:3, 3], abs=1e-12)
        assert rotation.to_matrices(orientation) == pytest.approx(expected[:3, :3], abs=1e-12)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic", "floating", "planar"])
def test_links_behind_a_movable_joint_are_not_fixed(kind):
    joints = joint("base", "mast"), joint("mast", "arm", kind=kind), joint("arm", "tip"), joint("base", "lamp")
    described = parse_robot(robot(*map(link, ("base", "mast", "arm", "tip", "lamp")), *joints))
    assert {frame.name for frame in described.fixed_frames()} == {"mast", "lamp"}
    assert described.joints["arm"].kind == kind


def turned_about(axis, angle):
    """Rodrigues' formula, as a matrix (4, 4)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    across, whole = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(4)
    whole[:3, :3] += np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    return whole


def shifted(vector):
    whole = np.eye(4)
    whole[:3, 3] = vector
    return whole


def test_links_are_where_their_joints_put_them():
    """Products of matrices: a boom that turns, a stick that slides, a bucket that mimics the boom, a tip that is fixed."""
    places = [((0.1, 0.2, 0.3), (0.4, -0.5, 0.6)), ((0.5, 0.0, 0.1), (0.0, 0.3, 0.0)), ((0.0, 0.1, 0.0), (1.0, 0.0, 0.0))]
    tip = (0.0, 0.0, 0.2), (0.0, 0.0, 0.7)
    mimic = '<mimic joint="base_boom" multiplier="-2" offset="0.1"/>'
    described = parse_robot(
        robot(
            *map(link, ("base", "boom", "stick", "bucket", "tip")),
            moved("base", "boom", "revolute", "0 1 1", origin(*places[0])),
            moved("boom", "stick", "prismatic", "0 0 2", origin(*places[1])),
            moved("stick", "bucket", "continuous", None, origin(*places[2]), mimic),
            joint("bucket", "tip", origin(*tip)),
        )
    )
    angle, reach = 0.8, 0.25
    frames = {
        frame.name: frame
        for frame in described.frames_at({"base_boom": angle, "boom_stick": reach}, {"base_boom": 1.5, "boom_stick": 2.0})
    }
    assert [frames[name].time for name in ("boom", "stick", "bucket", "tip")] == [1.5, 2.0, 1.5, None]
    tree = FrameTree("base")
    for frame in frames.values():
        tree.put(frame)
    expected = transform(*places[0]) @ turned_about([0.0, 1.0, 1.0], angle)
    expected = expected @ transform(*places[1]) @ shifted([0.0, 0.0, reach])
    expected = expected @ transform(*places[2]) @ turned_about([1.0, 0.0, 0.0], -2.0 * angle + 0.1) @ transform(*tip)
    position, orientation = tree.in_root("tip", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    assert position == pytest.approx(expected[:3, 3], abs=1e-12)
    assert rotation.to_matrices(orientation) == pytest.approx(expected[:3, :3], abs=1e-12)


def test_links_whose_joints_are_not_told_are_nowhere():
    """Nor those behind joints that one number does not tell, or that mimic one another in a ring."""
    ring = '<mimic joint="{}"/>'
    described = parse_robot(
        robot(
            *map(link, ("base", "boom", "float", "one", "two")),
            moved("base", "boom", "revolute"),
            moved("base", "float", "floating"),
            moved("base", "one", "revolute", more=ring.format("base_two")),
            moved("base", "two", "revolute", more=ring.format("base_one")),
        )
    )
    assert described.frames_at({}, {}) == []
    assert [
        frame.name for frame in described.frames_at({"base_boom": 0.0, "base_float": 1.0}, {"base_boom": 0.0, "base_float": 0.0})
    ] == ["boom"]


def test_what_is_not_about_links_and_joints_is_passed_over():
    further = '<transmission name="t"><joint name="j"/></transmission><gazebo reference="a"/><material name="m"/>text'
    described = parse_robot(robot(link("a"), link("b"), joint("a", "b"), further))
    assert [frame.name for frame in described.fixed_frames()] == ["b"]
    assert parse_robot('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="a"/></robot>').root == "a"


def test_a_long_chain_is_read():
    names = [f"l{k}" for k in range(5000)]
    described = parse_robot(robot(*map(link, names), *(joint(*pair) for pair in pairwise(names))))
    assert len(described.fixed_frames()) == 4999


AB = link("a"), link("b")


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("", "is not valid XML"),
        ("<robot", "is not valid XML"),
        (b"\xff\xfe\xfa", "is not valid XML"),
        ('<?xml version="1.0" encoding="no-such"?><robot/>', "has no links"),
        (b'<?xml version="1.0" encoding="no-such"?><robot/>', "is not valid XML"),
        ("\ud800", "is not valid XML"),
        ("<sdf/>", "is no URDF: its outermost element is 'sdf', not 'robot'"),
        (robot(), "has no links"),
        (robot(*AB, joint("a", "b"), joint("b", "a")), "one link must hang on no other, there are 0"),
        (robot(*AB), "one link must hang on no other, there are 2: a, b"),
        (robot("<link/>"), "link: the attribute 'name' is missing"),
        (robot(link("a"), link("a")), "there are two links 'a'"),
        (robot(*AB, joint("a", "c")), "joint 'a_c', child: there is no link 'c'"),
        (robot(*AB, joint("a", "b"), joint("a", "b")), "link 'b' hangs on two joints"),
        (robot(*AB, link("c"), joint("b", "c"), joint("c", "b")), "link 'b' hangs on itself"),
        (robot(*AB, joint("a", "b", kind="welded")), "joint 'a_b': unknown type 'welded'; known are fixed, revolute"),
        (robot(*AB, '<joint name="j" type="fixed"><parent link="a"/></joint>'), "joint 'j': the element 'child' is missing"),
        (robot(*AB, joint("a", "b", '<origin xyz="1 2"/>')), "joint 'a_b', origin: xyz must be 3 finite numbers, got '1 2'"),
        (robot(*AB, joint("a", "b", '<origin rpy="0 nan 0"/>')), "rpy must be 3 finite numbers, got '0 nan 0'"),
        (robot(*AB, joint("a", "b", '<origin xyz="0 0 ${h}"/>')), "xacro file.xacro > file.urdf"),
        (robot(*AB, moved("a", "b", "revolute", "0 0 0")), "joint 'a_b', axis: must not be the zero vector"),
        (robot(*AB, moved("a", "b", "revolute", "0 1")), "joint 'a_b', axis: xyz must be 3 finite numbers, got '0 1'"),
        (robot(*AB, moved("a", "b", "revolute", more="<mimic/>")), "joint 'a_b', mimic: the attribute 'joint' is missing"),
        (robot(*AB, joint("a", "b", '<origin quat_xyzw="0 0 0 1"/>')), "unknown attribute 'quat_xyzw'; known are xyz, rpy"),
        ('<robot><xacro:include filename="x"/></robot>', "is not expanded yet; run: xacro file.xacro > file.urdf"),
        (robot(link("a\u202ey" + "x" * 1000), link("b")), "there are 2: a?yxxx"),
        (robot("<a>" * 101, "</a>" * 101), "more than 100 inside one another"),
        (robot("<a/>" * 200_001), "has more than 200000 elements"),
        ("<robot>" + " " * HUGE, "is larger than 10 MB"),
    ],
)
def test_what_is_wrong_is_named(content, named):
    with pytest.raises(SceneError) as caught:
        parse_robot(content)
    assert named in str(caught.value)
    assert len(str(caught.value)) < 400
    assert str(caught.value).isprintable()


LAUGHS = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(12))


@pytest.mark.parametrize(
    "declared",
    [
        f'<!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]>',
        '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE robot SYSTEM "http://192.0.2.1/robot.dtd">',
        "<!DOCTYPE robot>",
    ],
)
def test_entities_and_document_types_are_refused(declared):
    begin = time.monotonic()
    with pytest.raises(SceneError, match="has a document type"):
        parse_robot(f'{declared}<robot><link name="&l12;&secret;"/></robot>')
    assert time.monotonic() - begin < 1.0


def test_files_are_read_and_named(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(robot(link("höhe")))
    assert load_robot(path).root == "höhe"
    path.write_text("<robot>")
    with pytest.raises(SceneError, match=r"robot\.urdf: is not valid XML"):
        load_robot(path)
    with pytest.raises(SceneError, match="cannot be read: No such file"):
        load_robot(tmp_path / "none.urdf")


@pytest.mark.parametrize(
    ("parts", "named"),
    [
        ([], "link 'a' has neither collision nor visual geometry"),
        (["<collision/>"], "link 'a', collision 1: its geometry must be one mesh, box, cylinder or sphere, got none"),
        ([part("<capsule/>")], "got capsule"),
        ([part(BOX), part(BOX * 2)], "collision 2: its geometry must be one mesh, box, cylinder or sphere, got box, box"),
        ([part("<box/>")], "collision 1, box: the attribute 'size' is missing"),
        ([part('<box size="1 2"/>')], "size must be 3 finite numbers, got '1 2'"),
        ([part('<sphere radius="-1"/>')], "sphere: radius must be positive [m], got [-1.0]"),
        ([part('<cylinder radius="1" length="0"/>')], "cylinder: radius and length must be positive [m], got [1.0, 0.0]"),
        ([part('<cylinder radius="1" length="inf"/>')], "length must be a finite number, got 'inf'"),
        ([part("<mesh/>")], "mesh: the attribute 'filename' is missing"),
        ([part('<mesh filename="a.stl" scale="0.001"/>')], "scale must be 3 finite numbers, got '0.001'"),
        ([part('<mesh filename="a.stl" scale="1 0 1"/>')], "scale must not be zero, got '1 0 1'"),
        ([part(BOX, place='<origin xyz="a b c"/>')], "collision 1, origin: xyz must be 3 finite numbers, got 'a b c'"),
    ],
)
def test_wrong_geometries_are_named_when_they_are_asked_for(parts, named):
    described = parse_robot(robot(link("a", *parts)))
    with pytest.raises(SceneError) as caught:
        described.geometries("a")
    assert named in str(caught.value)


def test_an_unknown_link_is_answered_with_the_known_ones():
    described = parse_robot(robot(link("base"), *(link(f"l{k}") + joint("base", f"l{k}") for k in range(40))))
    with pytest.raises(SceneError, match=r"there is no link 'bucket'; known are base, l0, l1, .*, \.\.\.$"):
        described.geometries("bucket")


def test_what_collides_comes_before_what_is_seen():
    described = parse_robot(robot(link("a", part("<capsule/>", "visual"), part(BOX), part('<sphere radius="2"/>'))))
    assert [geometry.kind for geometry in described.geometries("a")] == ["box", "sphere"]
    described = parse_robot(robot(link("a", part(BOX, "visual"))))
    assert described.geometries("a")[0].numbers == pytest.approx([1.0, 2.0, 3.0])


WORD = st.sampled_from(
    ["robot", "link", "joint", "origin", "name", "xyz", "rpy", "fixed", "a", "b", "1 2 3", "nan", "1e999", "${x}"]
)
ELEMENTS = st.recursive(
    st.builds(
        lambda tag, attributes: (tag, attributes, []), WORD.filter(str.isalpha), st.dictionaries(WORD.filter(str.isalpha), WORD)
    ),
    lambda inner: st.tuples(
        WORD.filter(str.isalpha), st.dictionaries(WORD.filter(str.isalpha), WORD), st.lists(inner, max_size=4)
    ),
)


def built(tree):
    tag, attributes, children = tree
    element = ElementTree.Element(tag, attributes)
    element.extend(map(built, children))
    return element


@settings(max_examples=500, deadline=None)
@given(st.text() | st.binary() | st.lists(ELEMENTS).map(lambda trees: ElementTree.tostring(built(("robot", {}, trees)))))
def test_whatever_comes_is_read_or_refused(content):
    try:
        described = parse_robot(content)
        described.fixed_frames()
        described.geometries(described.root)
    except SceneError as error:
        assert str(error).isprintable()
