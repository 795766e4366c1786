"""Tools and bodies made so finely that no grain passes."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from sand_sim import SceneError
from sand_sim.assembly.body_model import model_body
from sand_sim.assembly.tool_model import model_tool
from sand_sim.scene.filling import smallest_sphere
from sand_sim.scene.types import SHEETS, SMOOTH, Body, Fill, SizeDistribution, Tool

RADIUS = 0.004


def grains_of(tmp_path, how):
    """A fill of which the smallest sphere is so small [m], and that radius."""
    if how == "drawn":
        return Fill("bed", "sand", size=SizeDistribution("uniform", low=1e-4, high=1e-3)), 1e-4
    (tmp_path / "grains.csv").write_text("x,y,z,radius\n0,0,0.5,0.0001\n0,0,0.6,0.003\n")
    if how == "file":
        return Fill("bed", "sand", file=tmp_path / "grains.csv"), 1e-4
    return Fill("bed", "sand", shape="tetrahedron", file=tmp_path / "grains.csv"), 1e-4 * 4 ** (-1 / 3)  # at least, four apart


@pytest.mark.parametrize("how", ["drawn", "file", "clumps of a file"])
def test_no_grain_passes_wherever_it_comes_from(tmp_path, how):
    trimesh.creation.box((0.06, 0.06, 0.02)).export(tmp_path / "plate.stl")
    fill, smallest = grains_of(tmp_path, how)
    scene = SimpleNamespace(folder=tmp_path, fills=(Fill("coarse", "sand", size=SizeDistribution("constant", 0.01)), fill))
    rough = model_tool(Tool("plate", "plate.stl", "steel", RADIUS), scene, smallest_sphere(scene.fills)).body
    assert rough.coverage < RADIUS + smallest
    smooth = model_tool(Tool("plate", "plate.stl", "steel", RADIUS, contact=SMOOTH), scene, smallest_sphere(scene.fills)).body
    assert smooth.coverage > RADIUS + smallest  # its particles stop no grains


def test_a_tool_whose_grains_cannot_be_read_is_refused(tmp_path):
    trimesh.creation.box((0.06, 0.06, 0.02)).export(tmp_path / "plate.stl")
    scene = SimpleNamespace(folder=tmp_path, fills=(Fill("bed", "sand", file=tmp_path / "lost.csv"),))
    with pytest.raises(SceneError, match=r"lost\.csv' of 'bed' cannot be read"):
        model_tool(Tool("plate", "plate.stl", "steel", RADIUS), scene, smallest_sphere(scene.fills))


def test_no_grain_gets_into_a_body(tmp_path):
    trimesh.creation.box((0.06, 0.06, 0.02)).export(tmp_path / "crate.stl")
    fill, smallest = grains_of(tmp_path, "file")
    sand = SimpleNamespace(density=2000.0)
    scene = SimpleNamespace(folder=tmp_path, fills=(fill,), materials=[sand], material_index=lambda name: 0)
    body = model_body(Body("crate", "sand", "crate.stl", RADIUS), scene, smallest_sphere(scene.fills), lambda stage, share: None)
    places = trimesh.creation.box((0.06, 0.06, 0.02)).sample(3000)
    centres = body.shape.centres @ body.shape.axes.T + body.shape.middle
    farthest = np.linalg.norm(places[:, None] - centres, axis=2).min(axis=1).max()
    assert farthest < RADIUS + smallest


def test_whoever_writes_the_scene_may_decide_what_a_sheet_is(tmp_path):
    """A box without its lid: by default a sheet with an inside and an outside, else a solid, as tool and as body."""
    box = trimesh.creation.box((0.06, 0.06, 0.06))
    trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5]).export(tmp_path / "bin.stl")
    sand = SimpleNamespace(density=2000.0)
    scene = SimpleNamespace(folder=tmp_path, fills=(), materials=[sand], material_index=lambda name: 0)
    walls, solid = 5 * 0.06**2 * 2 * RADIUS, 0.06**3
    for sheets, volume in zip(SHEETS, (walls, solid, walls), strict=True):
        tool = model_tool(Tool("bin", "bin.stl", "steel", RADIUS, sheets=sheets), scene, None)
        assert tool.body.volume == pytest.approx(volume, rel=0.2)  # walls overlap in edges
        body = model_body(Body("bin", "sand", "bin.stl", RADIUS, sheets=sheets), scene, None, lambda stage, share: None)
        assert body.mass == pytest.approx(2000.0 * tool.body.volume)
