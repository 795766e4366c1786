"""Kernels compile for NVIDIA GPUs. That needs no GPU: the compiler comes with Warp."""

from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import pytest
from cuda_compiling import ARCHITECTURES, compile_all
from many_threads import ManyThreads

from sand_sim import load_scene
from sand_sim.assembly.assemble import assemble
from sand_sim.contact.model import SLOTS, ContactModel
from sand_sim.engine import energy, motion, neighbours, pair_forces, plungers, recipe, surface_contacts, tool_contacts
from sand_sim.engine.body_motion import build_move_bodies, build_see_bodies
from sand_sim.engine.survey import list_kernels
from sand_sim.integrator import INTEGRATORS
from sand_sim.precision import PRECISIONS

CONFIG = Path(__file__).parents[2] / "config"
SCENES = [path.stem for path in sorted(CONFIG.glob("*.yaml"))]
ALL = (recipe.PLANE, recipe.CYLINDER, recipe.SHELL, recipe.ROUGH, recipe.PLUNGER)


@cache
def launched(name, contact="rough"):
    """Kernels that a shipped scene launches on a device of many threads."""
    scene = load_scene(CONFIG / f"{name}.yaml")
    scene = replace(scene, tools=tuple(replace(tool, contact=contact) for tool in scene.tools))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sand_sim.assembly.assemble.open_device", lambda name, threads: ManyThreads())
        solver = assemble(scene).solver
    return list_kernels(solver.arrays, solver.stages, solver.device)


def test_kernels_of_the_dig_compile(tmp_path):
    compile_all(launched("dig"), (90,), tmp_path)


@pytest.mark.slow
def test_kernels_of_smooth_tools_compile(tmp_path):
    compile_all(launched("dig", "smooth"), ARCHITECTURES, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_kernels_of_every_scene_compile(name, tmp_path):
    compile_all(launched(name), ARCHITECTURES, tmp_path)


MODELS = {f"{slot} {law}": ContactModel(**{slot: law}) for slot, laws in SLOTS.items() for law in laws}
RECIPES = {name: recipe.Recipe(contact=model) for name, model in MODELS.items()}
RECIPES |= {f"integrator {name}": recipe.Recipe(integrator=name) for name in INTEGRATORS}
RECIPES |= {
    "many materials": recipe.Recipe(materials=True),
    "bodies": recipe.Recipe(bodies=True),
    "bodies in many materials": recipe.Recipe(bodies=True, materials=True, integrator=INTEGRATORS[-1]),
    "frictionless bodies": recipe.Recipe(bodies=True, contact=ContactModel(tangential="none")),
    "all surfaces": recipe.Recipe(surfaces=frozenset(ALL)),
} | {f"surface {kind}": recipe.Recipe(surfaces=frozenset({kind, recipe.PLANE})) for kind in ALL}


def kernels_of(one):
    """Kernels that depend on the recipe."""
    forces = (pair_forces.build_pair_forces, surface_contacts.build_surface_forces, tool_contacts.build_tool_forces)
    searches = (partial(neighbours.build_search, chunk=1), surface_contacts.build_surface_search, tool_contacts.build_tool_search)
    made = [build(one, second) for build in (*forces, *searches) for second in (False, True)]
    made += [motion.build_move_grains(one, True, True), energy.build_grain_energy(one), tool_contacts.build_wrench_blocks(one)]
    made += [plungers.build_plunger_blocks(one), energy.build_contact_energy(one.precision)]
    if one.integrator == recipe.VERLET:
        made.append(motion.build_complete_step(one, True, True))
    if one.bodies:
        made += [build_move_bodies(one), build_see_bodies(one), energy.build_body_energy(one.precision)]
    return made


@pytest.mark.slow
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("name", RECIPES)
def test_kernels_of_every_law_compile(name, precision, tmp_path):
    one = replace(RECIPES[name], precision=PRECISIONS[precision])
    if not one.surfaces:
        one = replace(one, surfaces=frozenset({recipe.PLANE}))
    compile_all(kernels_of(one), ARCHITECTURES, tmp_path)
