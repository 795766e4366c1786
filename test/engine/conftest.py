"""Worlds of free rigid bodies."""

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
