"""What a state must have in common with the world that it is loaded into, field by field and without a world for each."""

from dataclasses import replace

import pytest
import trimesh
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.assembly.body_model import model_body
from sand_sim.assembly.scene_identity import describe_scene, find_difference
from sand_sim.scene.types import Body, Boundary, Drive, Liquid, Rough, Settle, Terrain


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    return World(load_scene(write_small_scene(tmp_path_factory.mktemp("scene")))).assembly


def difference(assembly, other):
    return find_difference(describe_scene(assembly), describe_scene(other))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"gravity": (0.0, 0.1, -9.81)}, "gravity.1"),
        ({"liquid": Liquid(0.1)}, "liquid"),
        ({"settle": Settle(0.3)}, "settle.time"),
        ({"solver": {"skin": 0.001}}, "solver.skin"),
        ({"solver": {"integrator": "symplectic_euler"}}, "solver.integrator"),
        ({"contact": {"tangential": "none"}}, "contact.tangential"),
        ({"boundaries": (Boundary("plane", "steel", "floor", rough=Rough(0.005, 0.01)),)}, "boundaries.0.rough"),
        ({"boundaries": (Boundary("plunger", "steel", "ram", drive=Drive(0.1)),)}, "boundaries.0"),
        ({"boundaries": ()}, "boundaries"),
        ({"duration": 9.0}, ""),
        ({"frame_rate": 10.0}, ""),
        ({"solver": {"threads": 1, "device": "cpu"}}, ""),
        ({"name": "other"}, ""),
    ],
)
def test_each_field_that_grains_feel_counts_and_no_other(assembly, change, field):
    scene = assembly.scene
    parts = {name: replace(getattr(scene, name), **part) if isinstance(part, dict) else part for name, part in change.items()}
    found = difference(assembly, replace(assembly, scene=replace(scene, **parts)))
    assert found.startswith(field)
    assert bool(found) == bool(field)


def test_places_on_the_lattice_count(assembly):
    lattice = assembly.lattice
    for other in (replace(lattice, high=lattice.high + [0.01, 0, 0]), replace(lattice, reserve=0.3)):
        assert difference(assembly, replace(assembly, lattice=other)).startswith("domain")


def test_tools_count_by_their_triangles_and_what_else_grains_feel_of_them(assembly):
    (model,) = assembly.tools
    turned = trimesh.Trimesh(model.mesh.vertices, model.mesh.faces[:, ::-1], process=False)
    for other in (replace(model, mesh=turned), replace(model, tool=replace(model.tool, max_speed=0.5))):
        assert difference(assembly, replace(assembly, tools=[other])).startswith("tools.plate")
    assert difference(assembly, replace(assembly, tools=[replace(model, tool=replace(model.tool, trajectory=()))])) == ""


def test_files_of_bodies_and_terrains_count_by_what_is_in_them(assembly, tmp_path):
    file, scene = tmp_path / "clump.csv", assembly.scene
    clump = Body("clump", "sand", spheres=file)
    heights = Terrain(0.002, heights=tmp_path / "heights.csv", spacing=0.01)
    found = []
    for size in (0.01, 0.02):
        file.write_text(f"x,y,z,radius\n0,0,0,{size}\n")
        heights.heights.write_text(f"0,{size}\n0,0\n")
        model = model_body(clump, scene, None, lambda stage, share: None)
        found.append(describe_scene(replace(assembly, bodies=[model])))
        ground = Boundary("terrain", "steel", "ground", terrain=heights)
        found.append(describe_scene(replace(assembly, scene=replace(scene, boundaries=(ground,)))))
    assert find_difference(found[0], found[2]).startswith("bodies.clump.spheres")
    assert find_difference(found[1], found[3]).startswith("boundaries.0.terrain.heights")
    still = model_body(replace(clump, spheres=((0.0, 0.0, 0.0, 0.01),)), scene, None, lambda stage, share: None)
    moving = replace(still, body=replace(still.body, spin=(0.0, 1.0, 0.0)))
    told = [describe_scene(replace(assembly, bodies=[body])) for body in (still, moving)]
    assert find_difference(*told).startswith("bodies.clump.spin")
