"""Grains that fly into each other, in a scene of every kind that has kernels of its own."""

import numpy as np
from scenes import floor

KINDS = {
    "grains that leave": {"velocity": [3.0, 0.0, 0.0], "domain": {"low": [-0.01] * 3, "high": [0.1, 0.09, 0.09]}},
    "rolling and cohesion": {
        "contact": {"rolling": "spring", "cohesion": "capillary"},
        "numbers": {"rolling_friction": 0.1},
        "liquid": {"saturation": 0.1, "surface_tension": 0.072, "contact_angle": 0.3},
    },
    "symplectic": {"integrator": "symplectic_euler"},
    "floor": {"boundaries": floor(-0.005), "gravity": [0.0, 0.0, -9.81]},
    "double": {"precision": "double"},
    "bin": {
        "boundaries": [{"type": "bin", "name": "bin", "material": "wall", "low": [-0.007] * 3, "high": [0.079, 0.079, 0.03]}],
        "gravity": [0.0, 0.0, -9.81],
    },
    "plunger": {
        "boundaries": [
            {
                "type": "plunger",
                "name": "press",
                "material": "wall",
                "point": [0.0, 0.0, -0.006],
                "normal": [0.0, 0.0, 1.0],
                "force": 20.0,
                "max_speed": 1.0,
            }
        ]
    },
    "bodies": {
        "bodies": {
            name: {
                "spheres": [[0.0, 0.0, 0.0, 0.006], [0.008, 0.0, 0.0, 0.006], [0.0, 0.008, 0.0, 0.005]],
                "material": "grain",
                "pose": {"position": [0.03, 0.03, height]},
            }
            for name, height in (("one", -0.013), ("two", 0.09))
        }
    },
}


def flying_grains(make_world, kind, **further):
    """343 grains of two sizes in all directions."""
    lattice = np.stack(np.meshgrid(range(7), range(7), range(7), indexing="ij"), -1).reshape(-1, 3)
    position = 0.0118 * lattice + np.random.default_rng(3).uniform(0.0, 0.0004, lattice.shape)
    radius = np.where(np.arange(len(lattice)) % 7 == 0, 0.0062, 0.0055)
    velocity = np.random.default_rng(4).uniform(-1.0, 1.0, lattice.shape) + KINDS[kind].get("velocity", 0.0)
    return make_world(position, radius, **{"precision": "single"} | KINDS[kind] | {"velocity": velocity} | further)


def same_state(a, b):
    """All of both states is equal to the bit, but for grains that have retired, whose order is of no interest."""
    kept_a, kept_b = a.save(), b.save()
    assert kept_a.keys() == kept_b.keys()
    active = int(kept_a["grains.number"])
    for name, value in kept_a.items():
        of_grains = name.startswith("grains.") and value.ndim
        cut = slice(active if of_grains else None)
        np.testing.assert_array_equal(
            value[cut] if value.ndim else value, kept_b[name][cut] if value.ndim else kept_b[name], name
        )
