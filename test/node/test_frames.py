"""Frames in frames, against homogeneous matrices."""

import numpy as np
import pytest

from sand_sim import rotation
from sand_sim.border import CommandError, Frame
from sand_sim.node.frames import FrameTree

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def matrix(position, orientation):
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation.to_matrices(orientation), position
    return result


def test_a_pose_comes_down_a_chain_of_frames():
    random = np.random.default_rng(1)
    tree, expected, parent = FrameTree("world"), np.eye(4), "world"
    for name in ("base", "arm", "wrist"):
        position, orientation = random.normal(size=3), rotation.at_random(1, random)[0]
        tree.put(Frame(name, parent, position, 3.0 * orientation))  # any length
        expected, parent = expected @ matrix(position, orientation), name
    position, orientation = random.normal(size=3), rotation.at_random(1, random)[0]
    found = tree.in_root("wrist", position, orientation)
    assert matrix(*found) == pytest.approx(expected @ matrix(position, orientation), abs=1e-12)
    assert [frame.name for frame in tree.chain("wrist")] == ["wrist", "arm", "base"]


def test_a_pose_in_the_root_stays():
    position, orientation = FrameTree("world").in_root("world", np.ones(3), NO_TURN)
    assert np.array_equal(position, np.ones(3))
    assert np.array_equal(orientation, NO_TURN)


def test_frames_that_do_not_hang_on_the_root_are_named():
    tree = FrameTree("world")
    tree.put(Frame("a", "b", np.zeros(3), NO_TURN))
    tree.put(Frame("b", "a", np.zeros(3), NO_TURN))
    for name in ("a", "moon", ""):
        with pytest.raises(CommandError, match=f"frame '{name}' does not hang on 'world'") as caught:
            tree.in_root(name, np.zeros(3), NO_TURN)
        assert caught.value.reason == "unknown_frame"


def test_where_a_chain_of_frames_is_broken_is_told():
    tree = FrameTree("world")
    tree.put(Frame("arm", "base", np.zeros(3), NO_TURN))
    tree.put(Frame("wrist", "arm", np.zeros(3), NO_TURN))
    with pytest.raises(CommandError, match="'wrist' does not hang on 'world': nothing tells where 'base' is; known are arm"):
        tree.in_root("wrist", np.zeros(3), NO_TURN)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (Frame("", "world", np.zeros(3), NO_TURN), "bad_frame"),
        (Frame("a", "a", np.zeros(3), NO_TURN), "bad_frame"),
        (Frame("world", "a", np.zeros(3), NO_TURN), "bad_frame"),
        (Frame("a", "world", np.array([0.0, np.nan, 0.0]), NO_TURN), "not_finite"),
        (Frame("a", "world", np.zeros(3), np.zeros(4)), "zero_quaternion"),
    ],
)
def test_bad_frames_are_refused(frame, reason):
    tree = FrameTree("world")
    with pytest.raises(CommandError) as caught:
        tree.put(frame)
    assert caught.value.reason == reason


def test_a_flood_of_frames_is_stopped():
    tree = FrameTree("world")
    with pytest.raises(CommandError, match="known already"):
        for k in range(20_000):
            tree.put(Frame(f"f{k}", "world", np.zeros(3), NO_TURN))
    tree.put(Frame("f1", "f2", np.zeros(3), NO_TURN))


def test_length_of_a_quaternion_does_not_matter():
    tree, turned = FrameTree("world"), rotation.from_rpy(0.0, 0.0, 0.5 * np.pi)
    for size in (1e-3, 1.0, 1e200):
        tree.put(Frame("a", "world", np.zeros(3), size * turned))
        assert tree.in_root("a", np.array([1.0, 0.0, 0.0]), NO_TURN)[0] == pytest.approx([0.0, 1.0, 0.0])


def test_names_that_miss_little_are_told_what_to_say():
    tree = FrameTree("world")
    for name in ("", "/world"):
        with pytest.raises(CommandError, match=f"frame '{name}' does not hang on 'world'; say 'world'"):
            tree.in_root(name, np.zeros(3), NO_TURN)
