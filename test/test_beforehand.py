"""What is doubted about a world before its first step, and that it is not in order there."""

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
    assert any("particles of terrain 'ground' at once" in doubt for doubt in doubts) == fine


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
