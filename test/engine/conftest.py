"""Worlds of free rigid bodies, and on devices of our own."""

import pytest
from body_worlds import MATERIALS

from sand_sim import World, read_scene


@pytest.fixture
def make_bodies(tmp_path):
    """A world of free rigid bodies."""

    def make(bodies, restitution=0.5, friction=0.5, precision="double", **further):
        numbers = {"restitution": restitution, "friction": friction}
        solver = {"precision": precision} | further.pop("solver", {})
        parsed = {
            "gravity": [0.0, 0.0, 0.0],
            "materials": MATERIALS,
            "pairs": [{"between": ["stone", "stone"]} | numbers, {"between": ["stone", "wall"]} | numbers],
            "bodies": {name: {"material": "stone"} | body for name, body in bodies.items()},
            "domain": {"low": [-1.0] * 3, "high": [1.0] * 3},
            "solver": solver,
        }
        return World(read_scene(parsed | further, tmp_path))

    return make


@pytest.fixture
def with_device(monkeypatch):
    """``with_device(device, make)`` makes a world on a device of our own."""

    def made(device, make):
        with monkeypatch.context() as patch:
            patch.setattr("sand_sim.assembly.assemble.open_device", lambda name, threads: device)
            return make()

    return made
