"""The time step: characteristic times, and what is said about a step of the user's own."""

import numpy as np
import pytest
from scenes import SceneMaker, floor

from sand_sim import SceneError, World, read_scene
from sand_sim.scene.time_step import contact_time, rayleigh_time
from sand_sim.scene.types import Material
from sand_sim.study.bed_cases import confined_scene
from sand_sim.study.bench import Bench

# E [Pa]: Hertz contact time of two grains of 1 mm at 0.1 m/s, Rayleigh time [s]; nu 0.25 gives the published figures.
TIMES = {7e10: (4.9e-6, 0.52e-6), 1e9: (26.2e-6, 4.45e-6), 1e8: (65.8e-6, 14.1e-6), 1e7: (165e-6, 44.6e-6), 1e6: (415e-6, 141e-6)}


@pytest.mark.parametrize("young", TIMES)
def test_characteristic_times(young):
    material = Material("sand", 2650.0, young, 0.25)
    radius = 5e-4
    mass = 2650.0 * 4 / 3 * np.pi * radius**3
    effective = young / (2.0 * (1.0 - 0.25**2))
    assert contact_time(radius / 2.0, mass / 2.0, effective, 0.1) == pytest.approx(TIMES[young][0], rel=0.03)
    assert rayleigh_time(radius, material) == pytest.approx(TIMES[young][1], rel=0.05)


def test_own_step_is_checked(make_world):
    safe = make_world([[0.0, 0.0, 0.0]], 0.005).assembly.time_step.safe
    assert make_world([[0.0, 0.0, 0.0]], 0.005, time_step=0.5 * safe).observe().health.doubts == ()
    doubtful = make_world([[0.0, 0.0, 0.0]], 0.005, time_step=2.0 * safe)
    assert "2.0 times the safe step" in doubtful.assembly.time_step.warning
    assert any("time step" in doubt for doubt in doubtful.observe().health.doubts)
    with pytest.raises(SceneError, match=r"solver.time_step: .* is 10.0 times the safe step .* use 'auto'"):
        make_world([[0.0, 0.0, 0.0]], 0.005, time_step=10.0 * safe)


LIMITS = {  # as docs/scenes.md has them: share, of what, and a scene in which it decides
    "contact time": (1.0 / 25.0, "contact", {"velocity": [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}),
    "Rayleigh time": (0.2, "rayleigh", {"contact": {"tangential": "none"}}),
    "stability of damped contacts": (1.0, "stable", {"restitution": 0.5}),
    "travel in one step": (0.05, "speed", {"velocity": [[40.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}),
}


@pytest.mark.parametrize("reason", LIMITS)
def test_the_smallest_limit_decides_by_its_share(make_world, reason):
    share, name, further = LIMITS[reason]
    chosen = make_world([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0]], 0.005, **{"restitution": 1.0} | further).assembly.time_step
    assert chosen.reason == reason
    whole = 0.005 / chosen.speed if name == "speed" else getattr(chosen, name)
    assert chosen.safe == pytest.approx(share * whole, rel=1e-12)


def test_frames_are_whole_numbers_of_steps(make_world):
    world = make_world([[0.0, 0.0, 0.0]], 0.005, frame_rate=50.0)
    assert world.frame_steps * world.time_step == pytest.approx(0.02, rel=1e-12)
    assert world.time_step <= world.assembly.time_step.safe


@pytest.mark.parametrize("restitution", [0.05, 0.3])
def test_a_crystal_on_linear_springs_comes_to_rest(tmp_path, restitution):
    """Twelve contacts each, as stiff when they only just touch as deep down; dashpots of friction made it jitter, unseen."""
    scene = confined_scene(Bench(tmp_path), 1e7, restitution, 50.0, 0.01)
    scene["contact"] = {"normal": "linear", "tangential": "linear"}
    for pair in scene["pairs"]:
        pair |= {"stiffness": 5e3, "shear_stiffness": 5e3}
    world = World(read_scene(scene, tmp_path))
    world.step(8000)
    health = world.observe().health
    assert health.kinetic < 1e-15 * health.elastic
    assert health.doubts == ()


STONE = {"density": 2500.0, "young": 1e9, "poisson": 0.25}
SOFT = {"stiffness": 1e3, "shear_stiffness": 300.0}  # at rest a few hundred times softer than the springs of such a stone


def tilted(degrees):
    """Gravity over a floor that slopes by so much."""
    return (9.81 * np.array([np.sin(np.radians(degrees)), 0.0, -np.cos(np.radians(degrees))])).tolist()


def crept(world, settle, time):
    """How far the first grain moves within a time [s], once it has settled [m]."""
    world.step(round(settle / world.time_step))
    before = world.observe().grains.position[0]
    world.step(round(time / world.time_step))
    observation = world.observe()
    assert observation.health.doubts == ()
    return np.abs(observation.grains.position[0] - before).max()


@pytest.mark.parametrize("tangential", ["mindlin", "mindlin_rescaled"])
def test_friction_of_stone_holds_on_soft_normal_springs(tmp_path, tangential):
    """Three feet on a slope of 22 degrees with mu = 0.5."""
    turns = 2.0 / 3.0 * np.pi * np.arange(3)
    feet = np.column_stack([0.008 * np.cos(turns), 0.008 * np.sin(turns), np.zeros(3), np.full(3, 0.005)])
    scene = {
        "gravity": tilted(22.0),
        "materials": {"stone": STONE},
        "pairs": [{"between": ["stone", "stone"], "restitution": 0.3, "friction": 0.5} | SOFT],
        "contact": {"normal": "linear", "tangential": tangential},
        "bodies": {"stool": {"material": "stone", "spheres": feet.tolist(), "pose": {"position": [0.0, 0.0, 0.005]}}},
        "boundaries": [{"type": "plane", "material": "stone", "point": [0, 0, 0], "normal": [0, 0, 1]}],
        "domain": {"low": [-0.1] * 3, "high": [0.1] * 3},
        "solver": {"precision": "double", "threads": 1},
    }
    assert crept(World(read_scene(scene, tmp_path)), 0.3, 0.2) < 1e-6 * 0.005


@pytest.mark.parametrize("tangential", ["linear", "mindlin"])
def test_rolling_spring_of_stone_holds_on_soft_normal_springs(make_world, tangential):
    """A sphere with mu_r = 0.5 on a slope whose tangent is 0.4."""
    world = make_world(
        [0.0, 0.0, 0.005],
        0.005,
        material=STONE,
        friction=0.8,
        numbers=SOFT | {"rolling_friction": 0.5},
        contact={"normal": "linear", "tangential": tangential, "rolling": "spring"},
        gravity=tilted(np.degrees(np.arctan(0.4))),
        boundaries=floor(),
        domain={"low": [-0.1] * 3, "high": [0.1] * 3},
        threads=1,
    )
    assert crept(world, 0.4, 0.2) < 1e-6 * 0.005


RATTLED = {  # restitution, laws, their numbers
    "rolling spring stiffer than the contact": (0.5, {"rolling": "spring"}, {"rolling_friction": 2.0}),
    "rolling spring with little damping beside it": (0.9, {"rolling": "spring"}, {"rolling_friction": 0.4}),
    "friction damped more than a viscoelastic contact": (0.1, {"normal": "viscoelastic"}, {"viscous_time": 1e-5}),
}


@pytest.mark.parametrize("name", RATTLED)
def test_nothing_rattles_in_a_corner(make_world, name):
    """A grain pressed 5 % of its radius into three walls comes to rest, whatever resists its turning."""
    restitution, contact, numbers = RATTLED[name]
    world = make_world(
        [0.00485, 0.00485, 0.00485],
        0.005,
        spin=[1.0, -2.0, 0.5],
        restitution=restitution,
        friction=0.8,
        numbers=numbers,
        contact=contact,
        gravity=[-4000.0] * 3,
        boundaries=[{"type": "box", "name": "box", "material": "wall", "low": [0, 0, 0], "high": [0.1] * 3, "open": ["top"]}],
        domain={"low": [-0.2] * 3, "high": [0.2] * 3},
        threads=1,
    )
    world.step(round(0.2 / world.time_step))
    grains = world.observe().grains
    assert max(grains.speed[0], 0.005 * np.abs(grains.spin).max()) < 1e-9


def test_softer_springs_leave_the_step_of_hertz_contacts(make_world):
    plain = make_world([0.0, 0.0, 0.005], 0.005, boundaries=floor())
    springs = {"contact": {"rolling": "spring", "twisting": "marshall"}, "numbers": {"rolling_friction": 0.3}}
    further = make_world([0.0, 0.0, 0.005], 0.005, boundaries=floor(), **springs)
    assert further.assembly.time_step.safe == plain.assembly.time_step.safe


@pytest.mark.parametrize("size", [{"uniform": [0.002, 0.004]}, {"table": {"radii": [0.002, 0.004], "weights": [1.0, 200.0]}}])
def test_chance_neither_sets_the_step_nor_what_may_be_added(tmp_path, size):
    """Three grains hardly ever draw the least radius that they may; whatever the seed, the step is made for it."""
    steps = []
    for seed in range(3):
        content = SceneMaker(tmp_path).scene(
            [[0.0, 0.0, 0.01]], 0.004, boundaries=floor(), domain={"low": [-0.1] * 3, "high": [0.1] * 3}
        )
        region = {"low": [-0.03, -0.03, 0.0], "high": [0.03, 0.03, 0.05]}
        content["fills"] = [{"material": "grain", "radius": size, "count": 3, "region": region, "seed": seed}]
        world = World(read_scene(content, tmp_path))
        assert world.observe().grains.radius.min() > 0.002
        world.add_grains([[0.0, 0.0, 0.07]], 0.002)
        steps.append(world.assembly.time_step.rayleigh)
    assert steps == pytest.approx([rayleigh_time(0.002, Material("grain", 2500.0, 1e7, 0.25))] * 3, rel=1e-12)


def test_the_step_takes_no_sphere_of_a_body_for_heavier_than_what_yields_there(make_world):
    """``1 / (1/m + (a x n) . I^-1 (a x n))`` for a push along n at the arm a, in the direction in which it yields most."""
    material = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
    arms = np.array([[0.0, 0.02, 0.0], [0.01, 0.0, -0.005]])
    plate = {"material": "wall", "spheres": np.column_stack([arms, [0.004, 0.003]]).tolist()}
    inertia = np.array([1e-8, 4e-8, 4e-8])
    plate |= {"mass": 1e-4, "inertia": inertia.tolist(), "pose": {"position": [0.1, 0.0, 0.0]}}
    meet = [("grain", "grain"), ("grain", "wall"), ("wall", "wall")]
    pairs = [{"between": list(names), "restitution": 0.5, "friction": 0.5} for names in meet]
    world = make_world([[0.0] * 3], 0.005, material=material, wall=material, pairs=pairs, bodies={"plate": plate})
    light = world.assembly.light
    assert light.materials[light.material_index("grain")].density == 2500.0
    middle = world.assembly.bodies[0].shape.middle
    ways = np.random.default_rng(8).normal(size=(3000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    least = []
    for arm, radius in zip(arms - middle, (0.004, 0.003), strict=True):
        yields = 1.0 / (1e4 + (np.cross(arm, ways) ** 2 / inertia).sum(axis=1))
        least.append(yields.min() / (4.0 / 3.0 * np.pi * radius**3))
    assert 0.5 * min(least) < light.materials[light.material_index("wall")].density <= 1.001 * min(least)
