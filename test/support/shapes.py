"""Meshes with known properties."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

MESHES = Path(os.environ.get("SAND_SIM_MESHES", Path(__file__).parents[3] / "shared" / "meshes"))
SOLIDS = ("franka_hand_col.stl", "robotiq140_base.stl")
THIN = ("ow_lander_scoop.stl", "excavator_bucket_mm.stl", "tray_bottom_mm.stl")


def robot_mesh(name):
    """Path of a public robot mesh; skips the test where there are none."""
    if not (MESHES / name).is_file():
        pytest.skip(f"no {MESHES / name}")
    return MESHES / name


def wavy_ball(level=4):
    """A smooth closed surface without symmetry."""
    ball = trimesh.creation.icosphere(subdivisions=level, radius=0.05)
    x, y, _ = ball.vertices.T / 0.05
    ball.vertices *= (1.0 + 0.25 * np.sin(2.5 * x) * np.cos(3.0 * y + 1.0))[:, None]
    return ball


def wedge(angle=0.1, length=0.1):
    """A prism with one acute edge [rad]."""
    half = length * np.tan(0.5 * angle)
    corners = [[0, 0, 0], [length, 0, half], [length, 0, -half], [0, length, 0], [length, length, half], [length, length, -half]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]])
