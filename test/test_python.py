"""A world as programs use it: what makes no sense is refused in words."""

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import CommandError, ToolPose, World, load_scene


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return World(load_scene(write_small_scene(tmp_path_factory.mktemp("scene"))))


@pytest.mark.parametrize(("kind", "known"), [("tool", "plate"), ("wall", "floor"), ("body", "none")])
def test_reports_that_are_not_there_are_told(world, kind, known):
    """``StopIteration`` would end the generator of whoever asks, in silence."""
    with pytest.raises(KeyError, match=f"there is no {kind} 'spade'; there are {known}"):
        getattr(world.observe(), kind)("spade")
