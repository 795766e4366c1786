"""What is doubted about a world before its first step, and that it is not in order there."""

import re

import numpy as np
import pytest
import trimesh
from scenes import floor

SPEED, RADIUS = 1.0, 0.005


def bounce(make_world, boundary, radius=RADIUS, **further):
    """A grain falls on a surface at z = 0: its restitution, and what was doubted beforehand.

    Args:
        make_world: the fixture.
        boundary: the surface.
        radius: of the grain [m].
        further: for the scene.
    """
    world = make_world(
        [[0.001, 0.002, 3.0 * radius]],
        radius,
        velocity=[0.0, 0.0, -SPEED],
        boundaries=[boundary],
        contact={"tangential": "none"},
        material={"density": 2500.0, "young": 1e8, "poisson": 0.25},
        wall={"density": 2500.0, "young": 1e8, "poisson": 0.25},
        domain={"low": [-0.1, -0.1, -0.05], "high": [0.1, 0.1, 0.15]},
        **further,
    )
    doubts = world.observe().health.doubts
    world.step(round(5.0 * radius / SPEED / world.time_step))
    return np.linalg.norm(world.observe().grains.velocity[0]) / SPEED, doubts


@pytest.mark.parametrize(("spacing", "fine"), [(0.004, False), (0.001, True)])
def test_rough_wall_too_fine_is_doubted(make_world, spacing, fine):
    restitution, doubts = bounce(make_world, floor()[0] | {"rough": {"radius": 0.5 * spacing, "spacing": spacing}})
    assert (restitution < 0.45) == fine
    assert any("virtual spheres of 'floor' at once" in doubt for doubt in doubts) == fine


@pytest.mark.parametrize(("particle", "fine"), [(0.005, False), (0.001, True)])
def test_terrain_too_fine_is_doubted(make_world, tmp_path, particle, fine):
    plate = trimesh.creation.box((0.06, 0.06, 0.01))
    plate.apply_translation([0.0, 0.0, -0.005])
    plate.export(tmp_path / "plate.stl")
    terrain = {"type": "terrain", "name": "ground", "material": "wall", "mesh": "plate.stl", "particle_radius": particle}
    restitution, doubts = bounce(make_world, terrain)
    assert (restitution < 0.48) == fine
    told = [doubt for doubt in doubts if "particles of terrain 'ground' at once" in doubt]
    assert (told != []) == fine
    assert all("take contact: smooth, or a particle_radius of at least" in doubt for doubt in told)
    restitution, doubts = bounce(make_world, terrain | {"contact": "smooth"})
    assert restitution == pytest.approx(0.5, abs=0.01)
    assert doubts == ()


def test_the_largest_grain_decides_whether_a_surface_is_too_fine(make_world):
    """Beside fine grains, for which the surface is coarse enough."""
    world = make_world(
        [[0.0, 0.0, 0.05], [0.03, 0.0, 0.05]],
        [RADIUS, 0.0005],
        velocity=[0.0, 0.0, -SPEED],
        boundaries=[floor()[0] | {"rough": {"radius": 0.0005, "spacing": 0.001}}],
        domain={"low": [-0.1, -0.1, -0.05], "high": [0.1, 0.1, 0.15]},
    )
    assert any("virtual spheres of 'floor' at once" in doubt for doubt in world.observe().health.doubts)


@pytest.mark.parametrize("young", [1e8, 3e5])
def test_the_advice_on_too_fine_a_surface_helps(make_world, young):
    """Stiff grains sink in little; soft ones touch many particles even where these are half as large as they are."""

    def doubts(particle):
        rough = {"radius": particle, "spacing": 1.5 * particle}
        world = make_world(
            [[0.001, 0.002, 3.0 * RADIUS]],
            RADIUS,
            velocity=[0.0, 0.0, -SPEED],
            boundaries=[floor()[0] | {"rough": rough}],
            material={"density": 2500.0, "young": young, "poisson": 0.25},
            domain={"low": [-0.1, -0.1, -0.05], "high": [0.1, 0.1, 0.15]},
        )
        return [doubt for doubt in world.observe().health.doubts if "virtual spheres of 'floor' at once" in doubt]

    [told] = doubts(0.0002)
    advised = float(re.search(r"of at least (\S+) m", told).group(1))
    assert doubts(0.8 * advised) != []
    assert doubts(advised) == []


def stack(layers, overlap):
    """Places of a column of grains on the floor that overlap by a share of the radius, and the floor by half of it: as hard."""
    heights = RADIUS * (1.0 - 0.5 * overlap + (2.0 - overlap) * np.arange(layers))
    return np.column_stack([np.zeros((layers, 2)), heights])


@pytest.mark.parametrize("young", [1e7, 7e10])
def test_slight_overlap_of_stiff_grains_is_doubted(make_world, young):
    """The same overlap is next to nothing among soft grains, but shoots stiff ones away."""
    grain = {"density": 2500.0, "young": young, "poisson": 0.25}
    further = {"gravity": [0.0, 0.0, -9.81], "restitution": 0.9, "friction": 0.0}
    world = make_world(stack(3, 0.01), RADIUS, boundaries=floor(), material=grain, **further)
    expected = np.sqrt(2.0 * 9.81 * np.ptp(stack(3, 0.01)[:, 2]))
    doubted = any(
        "grains overlap one another by 1 % of a radius at the start" in doubt for doubt in world.observe().health.doubts
    )
    fastest = 0.0
    for _ in range(60):
        world.step(20)
        fastest = max(fastest, world.observe().health.fastest)
    assert doubted == (young > 1e9) == (fastest > expected)


def test_grains_that_are_held_together_are_not_doubted(make_world):
    """Between two walls, without gravity: much is stored and nothing moves."""
    places = stack(4, 0.05)
    lid = {
        "type": "plane",
        "name": "lid",
        "material": "wall",
        "point": [0, 0, places[-1, 2] + places[0, 2]],
        "normal": [0, 0, -1],
    }
    grain = {"density": 2500.0, "young": 7e10, "poisson": 0.25}
    world = make_world(places, RADIUS, boundaries=[*floor(), lid], material=grain)
    assert world.observe().health.elastic > 0.0
    assert world.observe().health.doubts == ()


def test_what_grains_overlap_most_is_named(make_world, tmp_path):
    trimesh.creation.box((0.02, 0.02, 0.002)).export(tmp_path / "plate.stl")
    tool = {"mesh": "plate.stl", "material": "wall", "particle_radius": 0.002, "pose": {"position": [0.0, 0.0, 0.05]}}
    above = 0.051 + 0.002 + RADIUS
    further = {"boundaries": floor(), "tools": {"plate": tool}, "domain": {"low": [-0.1] * 3, "high": [0.1] * 3}}
    for places, what in [
        ([[0.0, 0.0, 0.8 * RADIUS], [0.0, 0.0, 2.75 * RADIUS]], "wall 'floor' by 20 %"),
        ([[0.0, 0.0, 0.98 * RADIUS], [0.0, 0.0, 2.8 * RADIUS]], "one another by 18 %"),
        ([[0.0, 0.0, above - 0.3 * RADIUS], [0.0, 0.0, 0.9 * RADIUS]], "tool 'plate' by"),
    ]:
        doubts = make_world(places, RADIUS, **further).observe().health.doubts
        assert any(doubt.startswith(f"grains overlap {what}") for doubt in doubts), doubts
