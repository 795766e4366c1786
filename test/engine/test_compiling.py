"""Compiling says how far it is, and can be given up."""

import pytest
from scenes import write_small_scene

from sand_sim import World
from sand_sim.scene.reading import load_scene


class GivenUpError(Exception):
    """Raised from within a progress callback."""


def test_progress_reaches_the_end(tmp_path):
    told = []
    World(load_scene(write_small_scene(tmp_path)), lambda stage, share: told.append((stage, share)))
    shares = [share for stage, share in told if stage == "compiling kernels"]
    assert len(shares) > 10
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_compiling_can_be_given_up(tmp_path):
    told = []

    def progress(stage: str, share: float) -> None:
        told.append(stage)
        if stage == "compiling kernels":
            raise GivenUpError

    with pytest.raises(GivenUpError):
        World(load_scene(write_small_scene(tmp_path)), progress)
    assert told.count("compiling kernels") == 1
