"""What a scene does not need is neither compiled nor allocated."""

import json

import numpy as np
import pytest
import trimesh
import yaml
from kernel_source import source
from scenes import floor, write_small_scene
from timing import quickest

from sand_sim.assembly.assemble import assemble
from sand_sim.cli.main import main
from sand_sim.engine.pair_tiles import build_pair_tiles
from sand_sim.interruption import InterruptedByUserError
from sand_sim.plan import make_plan, measure_cost
from sand_sim.scene.reading import load_scene, read_scene
from sand_sim.scene.shapes import TETRAHEDRON


@pytest.fixture
def plan_of(make_world):
    def plan(**further):
        position = 0.012 * np.stack(np.meshgrid(range(4), range(4), range(4), indexing="ij"), -1).reshape(-1, 3)
        return make_plan(make_world(position, 0.005, **further).assembly, measure=False)

    return plan


def names(plan, *parts):
    return [name for name in plan.arrays if any(part in name for part in parts) and not name.startswith("flags")]


def test_frictionless_spheres_keep_no_history_rotation_or_bodies(plan_of):
    plan = plan_of(contact={"tangential": "none"}, numbers={}, precision="single")
    assert not names(plan, "memory", "drawer", "spin", "couple", "moment", "bodies", "member", "felt", "wall", "tool", "material")
    assert not [kernel for kernel in plan.kernels if any(word in kernel for word in ("bod", "tool", "surface", "wrench"))]
    assert {"contact history", "rotation", "rigid bodies", "walls", "tools"} <= set(plan.left_out)


def test_each_feature_brings_its_own_arrays_and_nothing_else(plan_of):
    lean = plan_of(contact={"tangential": "none"}, precision="single")
    frictional = plan_of(precision="single")
    rolling = plan_of(contact={"rolling": "spring"}, numbers={"rolling_friction": 0.1}, precision="single")
    walled = plan_of(contact={"tangential": "none"}, boundaries=floor(), precision="single")
    assert lean.bytes_per_sphere < frictional.bytes_per_sphere < rolling.bytes_per_sphere
    assert {name.split(".")[-1] for name in set(frictional.arrays) - set(lean.arrays)} >= {"memory", "couple", "spin"}
    assert {name for name in set(walled.arrays) - set(lean.arrays) if "wall" not in name} == set()


def test_a_pull_that_ends_where_grains_part_is_not_remembered(plan_of):
    """A bridge of liquid and a stuck contact act across a gap, so that they must be; the pull of DMT does not."""
    numbers = {"adhesion": 0.01, "restitution": 0.5}
    dmt, jkr = (plan_of(contact={"tangential": "none", "cohesion": law}, numbers=numbers) for law in ("dmt", "jkr"))
    assert not names(dmt, "memory", "drawer")
    assert "contact history" in dmt.left_out
    assert names(jkr, "memory")
    assert "contact history" not in jkr.left_out


def test_frictionless_kernels_contain_no_code_of_what_was_left_out(make_world):
    """The source that Warp generates for the pair forces has fewer lines without rotation and friction."""

    def lines(**further):
        world = make_world([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]], 0.005, **further)
        world.step(1)
        return source(build_pair_tiles(world.assembly.recipe)).count("\n")

    assert lines(contact={"tangential": "none"}) < 0.7 * lines()


def test_measuring_can_be_given_up(tmp_path):
    asked, assembly = [], assemble(load_scene(write_small_scene(tmp_path)))

    def check():
        asked.append(True)
        if len(asked) == 3:
            raise InterruptedByUserError

    with pytest.raises(InterruptedByUserError):
        make_plan(assembly, check=check)


def test_what_was_guessed_of_a_mesh_is_told(tmp_path, capsys):
    scene = write_small_scene(tmp_path)
    plate = trimesh.load(tmp_path / "plate.stl")
    main(["plan", str(scene), "--no-measure"])
    assert "meshes:" not in capsys.readouterr().out
    plate.update_faces(np.arange(len(plate.faces)) > 1)
    plate.export(tmp_path / "plate.stl")
    main(["plan", str(scene), "--no-measure"])
    lines = capsys.readouterr().out.splitlines()
    told = lines[lines.index("meshes: what had to be mended or guessed") + 1]
    assert told.startswith("  tool 'plate' ")
    assert "holes were closed" in told or "taken for sheets" in told


def test_what_is_guessed_of_a_mass_is_told_of_bodies_alone(tmp_path):
    bars = [trimesh.creation.box(np.roll((0.06, 0.01, 0.01), k)) for k in range(2)]
    trimesh.util.concatenate(bars).export(tmp_path / "cross.stl")
    common = {"mesh": "cross.stl", "material": "sand", "particle_radius": 0.003}
    place = {"pose": {"position": [0.1, 0.1, 0.1]}}
    heavy = {"mass": 0.1, "inertia": [1e-5, 1e-5, 1e-5], "pose": {"position": [0.1, 0.1, 0.2]}}
    scene = load_scene(write_small_scene(tmp_path, bodies={"cross": common | place, "given": common | heavy}))
    assembly = assemble(scene)
    assert list(assembly.mesh_warnings) == ["body 'cross'"]
    assert assembly.warnings[-1].startswith("body 'cross': parts of the surface are buried in others; volume and inertia")


def test_smooth_tools_are_left_out_where_all_are_rough(tmp_path):
    path = write_small_scene(tmp_path)
    parsed = yaml.safe_load(path.read_text())
    rough = make_plan(assemble(read_scene(parsed, tmp_path)), measure=False)
    parsed["tools"]["plate"]["contact"] = "smooth"
    ground = {"type": "terrain", "name": "ground", "material": "steel", "mesh": "plate.stl", "particle_radius": 0.01}
    parsed["boundaries"].append(ground | {"pose": {"position": [0.0, 0.0, -0.02]}, "contact": "smooth"})
    smooth = make_plan(assemble(read_scene(parsed, tmp_path)), measure=False)
    assert {"touch_smooth", "carry_touch"} == set(smooth.kernels) - set(rough.kernels)
    assert set(rough.kernels) <= set(smooth.kernels) | {"put_back"}
    assert {name.split(".")[-1] for name in set(smooth.arrays) - set(rough.arrays)} >= {"touch", "corners", "boxes"}
    assert "true surfaces of tools" in rough.left_out
    assert "true surfaces of tools" not in smooth.left_out
    assert rough.tools == {"plate": "rough"}
    assert smooth.tools == {"plate": "smooth"}
    assert rough.boxes == smooth.boxes
    np.testing.assert_allclose(rough.boxes["plate"], [[-0.03, -0.03, -0.002], [0.03, 0.03, 0.002]], atol=1e-8)
    assert (rough.terrains, smooth.terrains) == ({}, {"ground": "smooth"})


def test_clumps_are_counted_as_grains_and_spheres(tmp_path):
    path = write_small_scene(tmp_path)
    fill = {"material": "sand", "shape": TETRAHEDRON, "radius": 0.004, "count": 20}
    fill["region"] = {"low": [-0.05, -0.05, 0.0], "high": [0.05, 0.05, 0.1]}
    parsed = yaml.safe_load(path.read_text()) | {"fills": [fill]}
    plan = make_plan(assemble(read_scene(parsed, tmp_path)))
    assert (plan.grains, plan.spheres) == (20, 80)
    assert "move bodies" in plan.kept
    assert plan.duration > 0.0


def test_a_run_of_one_grain_costs_what_a_step_takes_without_any(make_world):
    """A share of a step of 2,197 grains was told, which is less than a hundredth of it; machines that others use get a tenth."""
    world, steps = make_world([[0.0, 0.0, 0.0]], 0.005, boundaries=floor(-0.1), threads=1), 2000
    taken = quickest(lambda: world.step(steps)) / steps
    assert 0.1 * taken < make_plan(world.assembly).sphere_step < 10.0 * taken


def test_a_cost_is_that_of_as_many_threads_as_are_quickest(make_world, monkeypatch):
    """Where other programs keep a core busy a run soon steps on one thread; on all of them a sample was told twice as dear."""
    assembly = make_world([[0.0, 0.0, 0.0]], 0.005, threads=2).assembly
    monkeypatch.setattr("sand_sim.plan.sample_cost", lambda assembly, device, check: {2: 2e-7, 1: 1e-7}[device.lanes])
    assert measure_cost(assembly) == 1e-7


def test_verb_prints_text_and_json(tmp_path, capsys):
    path = write_small_scene(tmp_path)
    assert main(["plan", str(path), "--no-measure"]) == 0
    text = capsys.readouterr().out
    for word in ("stages kept", "left out", "bytes per sphere", "kernels", "time step", "plate  ", "to (0.03, 0.03, 0.002) m"):
        assert word in text
    assert main(["plan", str(path), "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["spheres"] == 32
    assert plan["sphere_step"] > 0.0
