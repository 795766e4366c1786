"""Forces of many contacts at once: every law has a vector form, and gives what it gives one contact at a time."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import warp as wp
from compiling import count_vector_loops

from sand_sim.contact.model import SLOTS, ContactModel
from sand_sim.contact.response import memory_type
from sand_sim.engine import pair_tiles
from sand_sim.engine.pair_forces import build_pair_forces
from sand_sim.engine.recipe import Recipe
from sand_sim.integrator import EULER
from sand_sim.precision import DOUBLE

LAWS = {f"{slot} {law}": ContactModel(**{slot: law}) for slot, laws in SLOTS.items() for law in laws}
DIFFERENT = {model: name for name, model in LAWS.items()}
RECIPES = {name: Recipe(contact=model) for model, name in DIFFERENT.items()} | {
    "all": Recipe(contact=ContactModel(rolling="spring", twisting="marshall", cohesion="capillary"), materials=True),
    "rolling and cohesion": Recipe(contact=ContactModel(rolling="spring", cohesion="dmt")),
    "rescaled and twisting": Recipe(contact=ContactModel(tangential="mindlin_rescaled", twisting="marshall")),
    "euler": Recipe(integrator=EULER),
}
RECIPES |= {f"{name}, double": replace(RECIPES[name], precision=DOUBLE) for name in ("tangential linear", "all")}
every_recipe = pytest.mark.parametrize("name", RECIPES)


@every_recipe
def test_laws_have_a_vector_form(name, monkeypatch, tmp_path):
    """One loop, that with the laws, becomes a vector loop."""
    build = partial(pair_tiles.build_pair_tiles.__wrapped__, RECIPES[name])
    assert count_vector_loops(pair_tiles, build, monkeypatch, tmp_path) == 1


@every_recipe
def test_many_at_once_give_what_one_gives(name):
    """Contacts that slide, stick, have just met, part and miss each other; not a whole number of tiles of them."""
    recipe, random, pairs = RECIPES[name], np.random.default_rng(3), 1000
    precision, memory = recipe.precision, memory_type(recipe.contact, recipe.precision)
    real, quantum, radius = precision.numpy_real, 2.0**-24, 2**14
    directions = random.normal(size=(pairs, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    apart = 2 * radius * (1.0 - random.choice([-1e-4, 0.0, 1e-7, 1e-4, 1e-2], pairs))
    place = np.zeros((2 * pairs, 4), precision.numpy_whole)
    place[:, 3] = radius
    place[pairs:, :3] = np.round(directions * apart[:, None])
    still = random.choice([0.0, 1e-6, 1.0], 2 * pairs)[:, None]
    moving = {key: (still * random.normal(size=(2 * pairs, 3))) for key in ("motion", "spin", "half_motion", "half_spin")}
    four = {key: np.column_stack([moving[key], np.full(2 * pairs, 2.3e-6)]).astype(real) for key in ("motion", "spin")}
    table = recipe.contact.types(precision).pair()
    for field in recipe.contact.types(precision).pair.vars:
        setattr(table, field, random.uniform(0.1, 1.0) * (1e6 if "young" in field or field == "shear" else 1.0))
    kept = random.normal(size=(pairs, memory._length_)) * random.choice([0.0, 1e-8, 1e-5], pairs)[:, None]
    given = [
        wp.array(np.array([0, pairs], np.int32), dtype=int, device="cpu"),
        1,
        wp.array(np.arange(pairs, dtype=np.int32), dtype=int, device="cpu"),
        wp.array(np.arange(pairs, 2 * pairs, dtype=np.int32), dtype=int, device="cpu"),
        wp.array(place, dtype=precision.whole4, device="cpu"),
        wp.array(four["motion"], dtype=precision.vec4, device="cpu"),
        wp.array(four["spin"], dtype=precision.vec4, device="cpu"),
        wp.array(moving["half_motion"].astype(real), dtype=precision.vec3, device="cpu"),
        wp.array(moving["half_spin"].astype(real), dtype=precision.vec3, device="cpu"),
        wp.zeros(2 * pairs, dtype=int, device="cpu"),
        wp.array([table], dtype=recipe.contact.types(precision).pair, device="cpu"),
        1,
        quantum,
        1e-5,
    ]

    def results(build):
        remembered = wp.array(kept.astype(real), dtype=memory, device="cpu")
        force, couple, moment = (wp.zeros(pairs, dtype=precision.vec4, device="cpu") for _ in range(3))
        deepest, energy = (wp.zeros(1, dtype=precision.real, device="cpu") for _ in range(2))
        wp.launch(build(recipe), 1, [0, *given, remembered, force, couple, moment, deepest, energy], device="cpu")
        return [array.numpy() for array in (force, couple, moment, remembered, deepest)]

    one, many = results(build_pair_forces), results(pair_tiles.build_pair_tiles)
    assert 0.3 < np.mean(np.any(one[0] != 0.0, axis=1)) < 1.0
    for a, b in zip(one, many, strict=True):
        assert np.all(np.isfinite(a))
        np.testing.assert_allclose(b, a, rtol=1e3 * precision.epsilon, atol=1e2 * precision.epsilon * np.abs(a).max())
