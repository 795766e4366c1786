"""Places beyond rims, of sheets by their edges, of layers of loose triangles by asking around."""

import numpy as np
import pytest
from spread import distances

from sampler.particles.rims import beyond_edges, beyond_layers
from sampler.particles.skin import Skin

SPACING = 0.05
EDGES, LAYERS = "edges", "layers"


def rectangle(low, high, steps):
    """Vertices and faces of a rectangle in a plane of constant z."""
    grid = np.stack(np.meshgrid(*(np.linspace(a, b, steps) for a, b in zip(low, high, strict=True)), [0.1], indexing="ij"), -1)
    at = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return grid.reshape(-1, 3), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def places_beyond(kind, vertices, faces, around):
    if kind == EDGES:
        return beyond_edges(vertices, faces, around, SPACING)
    return beyond_layers(vertices[faces], around, SPACING)


@pytest.mark.parametrize("kind", [EDGES, LAYERS])
def test_all_along_a_rim_places_lie_half_a_spacing_beyond_it(kind):
    vertices, faces = rectangle((0.0, 0.0), (1.0, 0.6), 20)
    places = places_beyond(kind, vertices, faces, Skin(vertices[faces]))
    out = np.linalg.norm(np.maximum(np.abs(places[:, :2] - [0.5, 0.3]) - [0.5, 0.3], 0.0), axis=1)
    assert np.abs(places[:, 2] - 0.1).max() < 1e-6
    assert out == pytest.approx(0.5 * SPACING, rel=0.1)
    way = np.linspace(0.0, 1.0, 500)[:, None]
    corners = np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1], [1.0, 0.6, 0.1], [0.0, 0.6, 0.1]])
    rim = np.concatenate([a + way * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    assert distances(rim, places).max() < 0.75 * SPACING


@pytest.mark.parametrize("kind", [EDGES, LAYERS])
def test_where_another_surface_goes_on_there_are_none(kind):
    vertices, faces = rectangle((0.0, 0.0), (1.0, 0.6), 20)
    more, others = rectangle((1.0, 0.0), (1.5, 0.6), 9)
    places = places_beyond(kind, vertices, faces, Skin(np.concatenate([vertices[faces], more[others]])))
    beside = (places[:, 1] > 0.0) & (places[:, 1] < 0.6)
    assert places[beside, 0].max() < 0.0
    assert len(places) > 0.8 * 2.2 / SPACING


def test_round_a_closed_surface_there_are_none():
    way = np.linspace(0.0, 2.0 * np.pi, 65)
    ring = np.stack([0.2 * np.cos(way), 0.2 * np.sin(way)], axis=1)
    low, high = (np.column_stack([ring, np.full(65, z)]) for z in (0.0, 1.0))
    wall = np.concatenate([np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)])
    places = beyond_layers(wall, Skin(wall), SPACING)
    assert np.abs(np.abs(places[:, 2] - 0.5) - 0.5 - 0.5 * SPACING).max() < 0.1 * SPACING
