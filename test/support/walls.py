"""Walls about a tilted axis, and what they push grains with."""

import numpy as np

GRAVITY = 9.81
STIFFNESS = 1000.0
TILTED = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
POINT = np.array([0.01, 0.02, -0.03])
LINEAR = {
    "contact": {"normal": "linear", "tangential": "none"},
    "numbers": {"stiffness": STIFFNESS},
    "restitution": 1.0,
    "friction": 0.0,
    "threads": 1,
}
DOMAIN = {"low": [-0.3] * 3, "high": [0.3] * 3}


def wall(kind, axis=TILTED, point=POINT, **fields):
    direction = "normal" if kind in ("plane", "hole_plate", "plunger") else "axis"
    name = {"name": fields.pop("name", kind)}
    return {"type": kind, "material": "wall", "point": list(map(float, point)), direction: list(map(float, axis))} | name | fields


def overlaps(make_world, boundaries, position, radius, **further):
    """What the walls push each of some grains at rest with, as overlap times normal, shape (n, 3) [m]."""
    further = LINEAR | {"domain": DOMAIN, "time_step": 1e-6, "integrator": "symplectic_euler"} | further
    world = make_world(position, radius, boundaries=boundaries, **further)
    world.step(1)
    grains = world.observe().grains
    return grains.velocity * grains.mass[:, None] / (1e-6 * STIFFNESS)


def across(axis):
    nearest = np.eye(3)[np.argmin(np.abs(axis))]
    first = nearest - nearest @ axis * axis
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def turned(line, angles, axis=TILTED, point=POINT):
    """Points of the half plane, shape (n, 2), at angles about the axis, in the world frame."""
    first, second = across(axis)
    radial = np.cos(angles)[..., None] * first + np.sin(angles)[..., None] * second
    return point + line[..., :1] * radial + line[..., 1:] * axis


def apart_from_each_other(position, distance):
    kept = []
    for candidate in position:
        if all(np.linalg.norm(candidate - other) > distance for other in kept):
            kept.append(candidate)
    return np.array(kept)
