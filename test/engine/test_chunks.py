"""Distances to several spheres at once: they have a vector form, and find what one at a time finds."""

from functools import partial

import numpy as np
import pytest
import warp as wp
from compiling import count_vector_loops

from sand_sim.engine import neighbours
from sand_sim.engine.chunks import CHUNK, build_find_near, build_note_hits
from sand_sim.engine.kernel import kernel
from sand_sim.engine.recipe import Recipe
from sand_sim.precision import DOUBLE, SINGLE

ROWS = 9  # of cells that a sphere looks at, each with a loop of its own


@pytest.mark.parametrize("precision", [SINGLE, DOUBLE], ids=lambda one: one.name)
def test_distances_have_a_vector_form(precision, monkeypatch, tmp_path):
    build = partial(neighbours.build_search.__wrapped__, Recipe(precision=precision), False, CHUNK)
    assert count_vector_loops(neighbours, build, monkeypatch, tmp_path) == ROWS


@pytest.mark.parametrize("precision", [SINGLE, DOUBLE], ids=lambda one: one.name)
def test_chunks_find_what_one_at_a_time_finds(precision):
    random, spheres = np.random.default_rng(4), 200
    place = wp.array(random.integers(-1000, 1000, (spheres, 4)), dtype=precision.whole4, device="cpu")
    allowed = wp.array(random.integers(0, 300, spheres), dtype=precision.whole, device="cpu")
    rows = np.sort(random.integers(0, spheres + 1, (500, 2)), axis=1)
    rows = rows[rows[:, 1] - rows[:, 0] < 3 * CHUNK]
    found = [look(precision, chunk, place, allowed, rows) for chunk in (1, CHUNK)]
    assert found[0] == found[1]
    assert len(rows) < sum(map(len, found[0])) < 0.9 * np.ptp(rows, axis=1).sum()


def look(precision, chunk, place, allowed, rows):
    """What the first sphere finds in each row."""
    find_near, note_hits, real = build_find_near(precision, chunk), build_note_hits(chunk), precision.real
    whole, whole4 = precision.whole, precision.whole4

    @kernel
    def search(place: wp.array(dtype=whole4), allowed: wp.array(dtype=whole), first: int, last: int, hits: wp.array(dtype=int)):
        found = int(0)
        for begin in range(first, last, wp.static(chunk)):
            base = wp.min(begin, place.shape[0] - wp.static(chunk))
            near = find_near(place, allowed, base, begin, last, place[0], real(900.0))
            note_hits(hits, 1 + found, base, near)
            found += wp.bit_count(near)
        hits[0] = found

    hits, all_found = wp.zeros(100, dtype=int, device="cpu"), []
    for first, last in rows:
        wp.launch(search, dim=1, inputs=[place, allowed, int(first), int(last), hits], device="cpu")
        number = int(hits.numpy()[0])
        all_found.append(hits.numpy()[1 : 1 + number].tolist())
    return all_found
