"""Clumps that a fill draws: how they are laid out, turned and set in motion, and how small the parts of fills are."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sand_sim import rotation
from sand_sim.scene.filling import fill_grains, own_frames, smallest_of_materials, smallest_sphere
from sand_sim.scene.shapes import TETRAHEDRON, shape_named
from sand_sim.scene.types import Fill, Material, SizeDistribution
from sand_sim.scene.walls import Wall

SAND = Material("sand", 2600.0, 1e7, 0.25)
LOW, HIGH = (0.0, 0.1, -0.1), (0.2, 0.3, 0.1)


def clumps(**further):
    size = SizeDistribution("table", radii=(0.0027, 0.005), weights=(1.0, 1.0))
    usual = {"name": "bed", "material": "sand", "size": size, "low": LOW, "high": HIGH, "shape": TETRAHEDRON, "count": 400}
    return Fill(**(usual | further))


def test_clumps_overlap_neither_one_another_nor_walls_and_stay_in_their_region():
    """However they are turned; those of more than half of the size get no place of half the size."""
    pipe = Wall("cylinder", "pipe", "steel", np.array([0.1, 0.2, 0.0]), np.array([0.0, 0.0, 1.0]), 0.09)
    table = fill_grains(clumps(), SAND, 0, [pipe])
    reach = (np.linalg.norm(table.offset, axis=1) + table.radius).reshape(400, -1).max(axis=1)
    apart = np.linalg.norm(table.bodies.position[:, None] - table.bodies.position, axis=2) - reach[:, None] - reach
    assert apart[~np.eye(400, dtype=bool)].min() >= -1e-12
    assert np.all(pipe.distance(table.position) >= table.radius - 1e-9)
    assert np.all(table.position - table.radius[:, None] >= np.array(LOW) - 1e-12)
    assert np.all(table.position + table.radius[:, None] <= np.array(HIGH) + 1e-12)


def test_clumps_are_turned_at_random_each_for_itself():
    """Of 400 the mean of a unit vector is no longer than ``3/sqrt(400)``."""
    turns = rotation.to_matrices(fill_grains(clumps(), SAND, 0, []).bodies.orientation)
    assert len(np.unique(turns.round(6), axis=0)) == 400
    assert np.linalg.norm(turns.mean(axis=0), axis=0).max() < 3.0 / np.sqrt(400)


def test_a_fill_gives_clumps_its_velocity_and_no_spin():
    table = fill_grains(clumps(velocity=(0.1, -0.2, 0.3)), SAND, 0, [])
    assert table.bodies.velocity == pytest.approx(np.tile([0.1, -0.2, 0.3], (400, 1)))
    assert table.velocity == pytest.approx(np.tile([0.1, -0.2, 0.3], (1600, 1)))
    assert not table.bodies.spin.any()


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_motion_and_orientation_of_clumps_come_from_files(tmp_path, kind):
    """A quarter turn about x, written with twice the length, beside no turn; each column with a number of its own."""
    columns = {
        "position": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]],
        "radius": [0.004, 0.005],
        "velocity": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        "spin": [[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]],
        "orientation": [[0.0, 0.0, 0.0, 1.0], [np.sqrt(2.0), 0.0, 0.0, np.sqrt(2.0)]],
    }
    path = tmp_path / f"grains.{kind}"
    if kind == "npz":
        np.savez(path, **columns)
    else:
        rows = np.column_stack([np.array(column, float) for column in columns.values()])
        np.savetxt(path, rows, delimiter=",", header="x,y,z,radius,vx,vy,vz,wx,wy,wz,qx,qy,qz,qw", comments="", fmt="%.17g")
    table = fill_grains(Fill("bed", "sand", file=path, shape=TETRAHEDRON), SAND, 0, [])
    assert table.bodies.velocity == pytest.approx(np.array(columns["velocity"]))
    assert table.bodies.spin == pytest.approx(np.array(columns["spin"]))
    shape = shape_named(TETRAHEDRON, "")
    given = shape.centres @ shape.axes.T  # in the frame that the shape was given in
    for k, turn in enumerate((np.eye(3), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))):
        scale = columns["radius"][k] / shape.equal_radius
        arm = scale * given @ turn.T
        assert table.position[4 * k : 4 * k + 4] == pytest.approx(columns["position"][k] + arm, abs=1e-12)
        moving = np.array(columns["velocity"][k]) + np.cross(columns["spin"][k], arm)
        assert table.velocity[4 * k : 4 * k + 4] == pytest.approx(moving, abs=1e-9)


def test_orientations_are_told_in_the_frame_of_each_shape_of_its_own(tmp_path):
    """Rods along two skew axes, between which spheres lie, which are no bodies, and behind them one of the scene's bodies."""
    fills, shapes = [], []
    for name, axis, count in (("one", [1.0, 2.0, 3.0], 3), ("two", [-2.0, 1.0, 0.5], 2)):
        path = tmp_path / f"{name}.csv"
        rows = np.outer([-0.002, 0.0, 0.003], axis / np.linalg.norm(axis))
        np.savetxt(path, np.column_stack([rows, [0.002, 0.003, 0.002]]), delimiter=",", header="x,y,z,radius", comments="")
        fills.append(clumps(shape=path, count=count))
        shapes.append(shape_named(path, ""))
    fills.insert(1, clumps(shape="sphere", count=4))
    frames = own_frames(fills, [fill_grains(fill, SAND, 0, []) for fill in fills], 6)
    expected = [shapes[0].axes.T] * 3 + [shapes[1].axes.T] * 2 + [np.eye(3)]
    assert not np.allclose(shapes[0].axes, shapes[1].axes)
    assert rotation.to_matrices(frames) == pytest.approx(np.array(expected), abs=1e-9)


def test_the_smallest_sphere_of_each_material_is_the_least_that_may_be_drawn_of_it(tmp_path):
    """Of a normal distribution its lower limit; parts of clumps are smaller than the spheres of their volume."""
    normal = SizeDistribution("normal", mean=0.004, deviation=0.0005, low=0.0032, high=0.005)
    np.savez(tmp_path / "grains.npz", position=np.eye(3), radius=[0.004, 0.003, 0.005])
    shape = shape_named(TETRAHEDRON, "")
    part = shape.radii.min() / shape.equal_radius
    assert part < 0.9
    of_file = Fill("file", "file", file=tmp_path / "grains.npz")
    fills = [clumps(shape="sphere", material="normal", size=normal), clumps(material="clump"), of_file]
    assert smallest_sphere(fills[:1]) == 0.0032
    assert smallest_sphere(fills[1:2]) == pytest.approx(0.0027 * part)
    assert smallest_sphere([clumps(size=SizeDistribution("constant", mean=0.005))]) == pytest.approx(0.005 * part)
    assert smallest_sphere([of_file]) == 0.003
    assert smallest_sphere([replace(of_file, shape=TETRAHEDRON)]) == pytest.approx(0.003 * part)
    assert smallest_sphere([]) is None
    drawn = SimpleNamespace(material=np.array([2, 0, 0, 1, 2]), radius=np.array([0.003, 0.0041, 0.0038, 0.004, 0.005]))
    smallest = smallest_of_materials(fills, drawn, ["normal", "clump", "file"])
    assert smallest == pytest.approx({"normal": 0.0032, "clump": 0.0027 * part, "file": 0.003})
