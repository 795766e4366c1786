"""Rough boundaries: virtual spheres where a NumPy copy of the lattice puts them, and what they do to grains."""

import numpy as np
import pytest
from walls import DOMAIN, GRAVITY, LINEAR, POINT, TILTED, across, apart_from_each_other, overlaps, turned, wall

from sand_sim import SceneError

RADIUS, BALL, SPACING = 0.004, 0.003, 0.007


def row_spacing(lattice):
    return SPACING * np.sqrt(0.75) if lattice == "triangular" else SPACING


def plane_spheres(lattice):
    column, row = np.meshgrid(range(-40, 41), range(-40, 41), indexing="ij")
    shift = 0.5 * (row % 2) if lattice == "triangular" else 0.0
    first, second = across(TILTED)
    u, v = SPACING * (column + shift), row_spacing(lattice) * row
    return (POINT + u[..., None] * first + v[..., None] * second).reshape(-1, 3)


def ring_spheres(lattice, begin, end):
    rows = int(np.ceil(np.linalg.norm(end - begin) / row_spacing(lattice) - 1e-9)) + 1
    spheres = []
    for row, share in enumerate(np.linspace(0.0, 1.0, rows)):
        ring = begin + share * (end - begin)
        number = max(1, int(np.ceil(2.0 * np.pi * ring[0] / SPACING - 1e-9)))
        shift = 0.5 * (row % 2) if lattice == "triangular" else 0.0
        spheres.append(turned(ring[None], (np.arange(number) + shift) * 2.0 * np.pi / number))
    return np.concatenate(spheres)


SHAPES = {
    "plane": ({}, (0.0, 0.0), (0.06, 0.0)),
    "cone": ({"hole_radius": 0.01, "radius": 0.06, "height": 0.04}, (0.01, 0.0), (0.06, 0.04)),
    "hole_plate": ({"hole_radius": 0.0, "radius": 0.06}, (0.0, 0.0), (0.06, 0.0)),
    "cylinder": ({"radius": 0.05, "height": 0.06}, (0.05, 0.0), (0.05, 0.06)),
}


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-14), ("single", 1e-8)])
@pytest.mark.parametrize("lattice", ["triangular", "square"])
@pytest.mark.parametrize("kind", SHAPES)
def test_virtual_spheres_push_as_placed_ones(make_world, kind, lattice, precision, tolerance):
    """Forces on grains all over the surface, rims included, against all spheres of the lattice written out."""
    random = np.random.default_rng(1)
    fields, begin, end = SHAPES[kind]
    begin, end = np.array(begin), np.array(end)
    spheres = plane_spheres(lattice) if kind == "plane" else ring_spheres(lattice, begin, end)
    normal = np.array([-(end - begin)[1], (end - begin)[0]]) / np.linalg.norm(end - begin)
    share, off = random.uniform(-0.05, 1.05, (300, 1)), random.uniform(-0.0068, 0.0068, (300, 1))
    line = begin + share * (end - begin) + off * normal
    position = apart_from_each_other(turned(line, random.uniform(-np.pi, np.pi, 300)), 2.05 * RADIUS)
    rough = {"radius": BALL, "spacing": SPACING, "lattice": lattice}
    found = overlaps(make_world, [wall(kind, **fields, rough=rough)], position, RADIUS, precision=precision)
    expected = np.zeros_like(position)
    for grain, centre in enumerate(position):
        away = centre - spheres
        distance = np.linalg.norm(away, axis=1)
        expected[grain] = (np.clip(RADIUS + BALL - distance, 0.0, None)[:, None] * away / distance[:, None]).sum(axis=0)
    assert np.count_nonzero(expected.any(axis=1)) > 50
    assert np.abs(found - expected).max() < tolerance


def test_endless_cylinder_is_rough_all_along(make_world):
    """Rings at whole row spacings from its point, every other one turned by half a spacing."""
    rough = {"radius": BALL, "spacing": SPACING}
    number = int(np.ceil(2.0 * np.pi * 0.05 / SPACING))
    row = np.arange(-30, 31, 3)
    line = np.column_stack([np.full(len(row), 0.05 - RADIUS - BALL + 1e-4), row * row_spacing("triangular")])
    at = turned(line, np.pi / number * (row % 2))
    found = overlaps(make_world, [wall("cylinder", radius=0.05, rough=rough)], at, RADIUS)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.full(len(at), 1e-4), rel=1e-6)


@pytest.mark.parametrize(("degrees", "rough", "rests"), [(15.0, True, True), (40.0, True, False), (15.0, False, False)])
def test_frictionless_grain_interlocks_on_a_rough_slope(make_world, degrees, rough, rests):
    """Between three spheres it rests up to ``tan = s / (2 sqrt(3) h)`` at least and ``2 s / (2 sqrt(3) h)`` at most, h above."""
    height = np.sqrt((RADIUS + BALL) ** 2 - SPACING**2 / 3.0)
    assert np.tan(np.radians(15.0)) < SPACING / (2.0 * np.sqrt(3.0) * height) < np.tan(np.radians(40.0)) / 2.0 + 1e-2
    slope = np.radians(degrees)
    up, down = np.array([np.sin(slope), 0.0, np.cos(slope)]), np.array([np.cos(slope), 0.0, -np.sin(slope)])
    first, second = across(up)
    hollow = 0.5 * SPACING * first + row_spacing("triangular") / 3.0 * second + (height if rough else RADIUS) * up
    world = make_world(
        [hollow],
        RADIUS,
        gravity=[0.0, 0.0, -GRAVITY],
        material={"density": 2500.0, "young": 1e8, "poisson": 0.25},
        restitution=0.3,
        friction=0.0,
        boundaries=[wall("plane", up, [0.0, 0.0, 0.0], **({"rough": {"radius": BALL, "spacing": SPACING}} if rough else {}))],
        domain=DOMAIN,
        threads=1,
    )
    world.step(round(0.2 / world.time_step))
    observation = world.observe()
    moved = (observation.grains.position[0] - hollow) @ down
    if not rests:
        assert moved > SPACING
        if not rough:
            assert moved == pytest.approx(0.5 * GRAVITY * np.sin(slope) * world.time**2, rel=1e-3)
        return
    assert abs(moved) < 1e-5
    assert observation.health.fastest < 1e-6
    weight = observation.grains.mass[0] * GRAVITY
    assert observation.wall("plane").force == pytest.approx([0.0, 0.0, -weight], abs=1e-4 * weight)
    assert observation.health.contacts in (2, 3)


def test_rough_funnel_has_no_doubled_ring_at_its_seam(make_world):
    """A grain outside, at a sphere of the ring that bin and funnel share, feels it once."""
    rough = {"radius": BALL, "spacing": SPACING}
    up = [0.0, 0.0, 1.0]
    bin_wall = wall("cylinder", up, [0, 0, 0.03], radius=0.05, height=0.06, rough=rough, name="bin")
    funnel = wall("cone", up, [0, 0, 0], hole_radius=0.02, radius=0.05, height=0.03, rough=rough)
    position = [[0.05 + RADIUS + BALL - 1e-4, 0.0, 0.03]]
    both = overlaps(make_world, [bin_wall, funnel], position, RADIUS)[0]
    alone = overlaps(make_world, [bin_wall], position, RADIUS)[0]
    assert alone == pytest.approx([1e-4, 0.0, 0.0], abs=1e-9)
    assert both == pytest.approx(alone, abs=1e-9)


def test_gaps_that_grains_fall_through_are_refused(make_world):
    with pytest.raises(SceneError, match=r"boundaries: rough.spacing of 'plane', 0.02 m, leaves gaps for grains of radius 0.004"):
        make_world([[0, 0, 0]], RADIUS, boundaries=[wall("plane", rough={"radius": 0.003, "spacing": 0.02})], **LINEAR)


@pytest.mark.parametrize("ball", [BALL, 2.0 * RADIUS])
def test_a_virtual_sphere_is_met_as_one_that_never_moves(make_world, ball):
    """Hertz's force with the radius of both, friction half an overlap inside of the grain, and overlaps by the smaller radius."""
    overlap, young, poisson = 3e-4, 1e7, 0.25
    rough = {"radius": ball, "spacing": 1.9 * ball, "lattice": "square"}
    world = make_world(
        [[0.0, 0.0, RADIUS + ball - overlap]],
        RADIUS,
        spin=[0.0, 1.0, 0.0],
        material={"density": 2500.0, "young": young, "poisson": poisson},
        boundaries=[wall("plane", [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], rough=rough)],
        domain=DOMAIN,
        integrator="symplectic_euler",
        time_step=1e-8,
    )
    before = world.observe()
    expected = 4.0 / 3.0 * young / (1.0 - poisson**2) * np.sqrt(RADIUS * ball / (RADIUS + ball)) * overlap**1.5
    assert before.wall("plane").force[2] == pytest.approx(-expected, rel=1e-6)
    assert before.health.contacts == 1
    world.step(10)
    after = world.observe()
    mass = after.grains.mass[0]
    push = mass * (after.grains.velocity - before.grains.velocity)[0, 0]
    couple = 0.4 * mass * RADIUS**2 * (after.grains.spin - before.grains.spin)[0, 1]
    assert push > 0.0
    assert -couple / push == pytest.approx(RADIUS - 0.5 * overlap, rel=1e-3)
    assert after.health.deepest == pytest.approx(overlap / min(RADIUS, ball), rel=1e-3)
