"""Walls with holes and ends: closest points, rims, seams, sliding, and that nothing gets through."""

import numpy as np
import pytest
from kernel_source import source
from scenes import record
from walls import DOMAIN, GRAVITY, LINEAR, STIFFNESS, apart_from_each_other, overlaps, turned, wall

from sand_sim import CommandError, World, read_scene
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.surface_contacts import build_surface_forces, build_surface_search

SHELLS = {
    "cone": ({"hole_radius": 0.02, "radius": 0.06, "height": 0.03}, (0.02, 0.0), (0.06, 0.03)),
    "hole_plate": ({"hole_radius": 0.02, "radius": 0.06}, (0.02, 0.0), (0.06, 0.0)),
    "cylinder": ({"radius": 0.05, "height": 0.06}, (0.05, 0.0), (0.05, 0.06)),
}


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("kind", SHELLS)
def test_shells_push_from_their_closest_point(make_world, kind, precision):
    """Both sides, rims included, against the nearest of some million points of the surface."""
    radius, random = 0.005, np.random.default_rng(3)
    fields, begin, end = SHELLS[kind]
    begin, end = np.array(begin), np.array(end)
    normal = np.array([-(end - begin)[1], (end - begin)[0]]) / np.linalg.norm(end - begin)
    share = random.uniform(-0.1, 1.1, 120)
    off = random.choice([-1.0, 1.0], (120, 1)) * random.uniform(0.002, 0.0055, (120, 1))
    line = begin + share[:, None] * (end - begin) + off * normal
    position = apart_from_each_other(turned(line, random.uniform(-np.pi, np.pi, 120)), 2.05 * radius)
    found = overlaps(make_world, [wall(kind, **fields)], position, radius, precision=precision)

    line = begin + np.linspace(0.0, 1.0, 601)[:, None] * (end - begin)
    surface = turned(line[:, None], np.linspace(-np.pi, np.pi, 3001)[None, :]).reshape(-1, 3)
    touching = 0
    for pushed, centre in zip(found, position, strict=True):
        away = centre - surface[np.argmin(np.sum((surface - centre) ** 2, axis=1))]
        overlap = radius - np.linalg.norm(away)
        if overlap > 1e-5:
            touching += 1
            assert np.linalg.norm(pushed) == pytest.approx(overlap, abs=3e-6)
            assert pushed / np.linalg.norm(pushed) @ away / np.linalg.norm(away) > 1.0 - 1e-3
        elif overlap < 0.0:
            assert not pushed.any()
    assert touching > 20


def test_normal_turns_evenly_about_a_rim(make_world):
    """Centres on an arc about the rim of a hole, from above the plate through the hole to below it."""
    radius, hole, depth = 0.005, 0.02, 1e-4
    angles = np.linspace(0.3, 2.0 * np.pi - 0.3, 64)
    arc = np.column_stack([hole + (radius - depth) * np.cos(angles), np.zeros(64), (radius - depth) * np.sin(angles)])
    plate = wall("hole_plate", [0, 0, 1], [0, 0, 0], hole_radius=hole, radius=0.1)
    pushed = np.concatenate([overlaps(make_world, [plate], [centre], radius) for centre in arc[::7]])
    away = angles[::7]
    over_plate = np.cos(away) > 0.0
    expected = np.column_stack([np.cos(away), np.zeros(10), np.sin(away)]) * depth
    expected[over_plate] = 0.0
    height = (radius - depth) * np.sin(away[over_plate])
    expected[over_plate, 2] = np.sign(height) * (radius - np.abs(height))
    assert pushed == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("offset", [-0.004, -0.002, 0.001, 0.003, 0.0045])
def test_grain_dropped_on_a_rim_bounces_with_the_right_normal(make_world, offset):
    """Elastic and stiff: the velocity is mirrored at the normal from rim to centre; beside the hole it is the plate's."""
    radius, hole = 0.005, 0.02
    plate = wall("hole_plate", [0, 0, 1], [0, 0, 0], hole_radius=hole, radius=0.1)
    contact = {"restitution": 1.0, "friction": 0.0, "contact": {"tangential": "none"}, "threads": 1}
    world = make_world(
        [[hole - offset, 0.0, radius + 2e-4]],
        radius,
        velocity=[0.0, 0.0, -0.1],
        material={"density": 2500.0, "young": 1e11, "poisson": 0.25},
        boundaries=[plate],
        domain=DOMAIN,
        **contact,
    )
    world.step(round(0.06 / world.time_step))
    normal = np.array([-max(offset, 0.0), 0.0, np.sqrt(radius**2 - max(offset, 0.0) ** 2)]) / radius
    before = np.array([0.0, 0.0, -0.1])
    assert world.observe().grains.velocity[0] == pytest.approx(before - 2.0 * (before @ normal) * normal, abs=2e-4)


SLOPE = 0.5  # [rad] of the walls that grains slide down
ALONG = np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
UP = np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])


def sloping_cone(low, high, name="cone"):
    """Walls that fall towards +x: their half at y = 0, x < 0 lies in the plane through the origin at right angles to ``UP``."""
    height = (high - low) * np.tan(SLOPE)
    return wall("cone", [0, 0, 1], [0, 0, low * np.tan(SLOPE)], hole_radius=low, radius=high, height=height, name=name)


SLIDES = {
    "plane": [wall("plane", UP, [0, 0, 0])],
    "cylinder": [wall("cylinder", ALONG, 0.05 * UP, radius=0.05)],
    "cylinder with ends": [wall("cylinder", ALONG, 0.05 * UP - 0.32 * ALONG, radius=0.05, height=0.5)],
    "cone": [sloping_cone(0.05, 0.28)],
    "cone, over seams": [sloping_cone(0.15, 0.28, "upper"), sloping_cone(0.1, 0.15, "lower"), sloping_cone(0.05, 0.1, "last")],
}


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("kind", SLIDES)
def test_grain_slides_without_kicks(make_world, kind, precision):
    """Without friction it speeds up with ``g sin`` and never leaves its depth, to a millionth of its speed.

    In single precision the speed itself gathers some hundred roundings.
    """
    radius, density = 0.005, 2500.0
    weight = density * 4.0 / 3.0 * np.pi * radius**3 * GRAVITY
    dent = weight * np.cos(SLOPE) / STIFFNESS
    start = -0.25 * ALONG / np.cos(SLOPE) + (radius - dent) * UP
    world = make_world(
        [start],
        radius,
        gravity=[0.0, 0.0, -GRAVITY],
        boundaries=SLIDES[kind],
        domain={"low": [-0.32, -0.1, -0.1], "high": [0.02, 0.1, 0.3]},
        precision=precision,
        **LINEAR,
    )
    history = record(world, 60, max(1, round(0.28 / 60 / world.time_step)))  # over both seams
    velocity, time = history["velocity"][:, 0], history["time"]
    assert history["position"][-1, 0] @ ALONG > -0.095 / np.cos(SLOPE)
    assert np.abs(velocity @ UP).max() < 1e-6 * np.abs(velocity @ ALONG).max()
    gathered = {"double": 1e-6, "single": 2e-5}[precision]
    assert np.abs(velocity @ ALONG - GRAVITY * np.sin(SLOPE) * time).max() < gathered * np.abs(velocity @ ALONG).max()


def test_grain_slides_down_a_cone_with_friction(make_world):
    """Too steep to roll without slip: ``a = g (sin - mu cos)``, and the spin grows with ``5/2 mu g cos / r``."""
    radius, friction, slope = 0.005, 0.2, np.pi / 4
    along, up = np.array([np.sin(slope), 0.0, -np.cos(slope)]), np.array([np.cos(slope), 0.0, np.sin(slope)])
    start = np.array([-0.2, 0.0, 0.2]) + (radius - 5e-6) * up
    world = make_world(
        [start],
        radius,
        gravity=[0.0, 0.0, -GRAVITY],
        restitution=0.2,
        friction=friction,
        boundaries=[wall("cone", [0, 0, 1], [0, 0, 0.02], hole_radius=0.02, radius=0.25, angle=slope)],
        domain={"low": [-0.3, -0.3, 0.0], "high": [0.3, 0.3, 0.3]},
        precision="single",
        threads=1,
    )
    every = round(0.002 / world.time_step)
    history = record(world, 90, every)
    late = history["time"] > 0.05
    time, velocity, spin = history["time"][late], history["velocity"][late, 0], history["spin"][late, 0]
    assert np.polyfit(time, velocity @ along, 1)[0] == pytest.approx(
        GRAVITY * (np.sin(slope) - friction * np.cos(slope)), rel=1e-3
    )
    turning = 2.5 * friction * GRAVITY * np.cos(slope) / radius
    assert np.polyfit(time, spin[:, 1], 1)[0] == pytest.approx(turning, rel=1e-3)
    assert np.abs(velocity @ up).max() < 1e-3 * (velocity @ along).max()


def test_grain_wider_than_the_hole_sits_in_it(make_world):
    """A sphere on the rim of a round hole lies ``sqrt(r^2 - hole^2)`` above it, held from all sides."""
    radius, hole = 0.01, 0.006
    world = make_world(
        [[0.0008, 0.0003, radius]],
        radius,
        gravity=[0.0, 0.0, -GRAVITY],
        material={"density": 2500.0, "young": 1e8, "poisson": 0.25},
        restitution=0.3,
        friction=0.3,
        boundaries=[wall("hole_plate", [0, 0, 1], [0, 0, 0], hole_radius=hole, radius=0.05)],
        domain=DOMAIN,
        threads=1,
    )
    world.step(round(0.5 / world.time_step))
    observation = world.observe()
    x, y, z = observation.grains.position[0]
    assert np.hypot(x, y) < 1e-6
    assert z == pytest.approx(np.sqrt(radius**2 - hole**2), rel=1e-3)
    assert observation.wall("hole_plate").force == pytest.approx([0.0, 0.0, -observation.grains.mass[0] * GRAVITY], abs=1e-6)
    assert observation.health.fastest < 1e-6


HOPPER = {"bin": 0.035, "hole": 0.016, "grain": 0.0025}


def hopper(friction=0.4, count=120, young=5e6, **further):
    """A bin on a cone of 45 degrees, closed by a plate that drops away at time zero."""
    wide, hole, grain = HOPPER["bin"], HOPPER["hole"], HOPPER["grain"]
    up, foot = [0, 0, 1], [0, 0, wide - hole]
    numbers = {"restitution": 0.4, "friction": friction}
    return {
        "materials": {
            "sand": {"density": 2500.0, "young": young, "poisson": 0.25},
            "wall": {"density": 7800.0, "young": 1e9, "poisson": 0.3},
        },
        "pairs": [{"between": ["sand", "sand"]} | numbers, {"between": ["sand", "wall"]} | numbers],
        "fills": [
            {
                "material": "sand",
                "radius": {"uniform": [0.95 * grain, 1.05 * grain]},
                "region": {"low": [-wide, -wide, 0.003], "high": [wide, wide, 0.5]},
                "count": count,
            }
        ],
        "boundaries": [
            wall("cylinder", up, foot, radius=wide, height=0.5, name="bin"),
            wall("cone", up, [0, 0, 0], hole_radius=hole, radius=wide, angle=np.pi / 4, name="funnel"),
            wall("plunger", up, [0, 0, 0], radius=hole, velocity=-2.0, travel=0.11, name="gate"),
            wall("plane", up, [0, 0, -0.06], name="floor"),
            wall("cylinder", up, [0, 0, -0.06], radius=0.2, height=0.05, name="pan"),
        ],
        "domain": {"low": [-0.25, -0.25, -0.13], "high": [0.25, 0.25, 0.55]},
        "settle": {"time": 0.3, "speed": 0.03},
    } | further


def discharge(scene, folder, duration, frames):
    """Run a hopper out; returns times and how many grains are below the hole, having seen that each went through it."""
    world = World(read_scene(scene, folder))
    wide, hole = HOPPER["bin"], HOPPER["hole"]
    rows = []
    for _ in range(frames):
        world.step(round(duration / frames / world.time_step))
        observation = world.observe()
        x, y, z = observation.spheres.position.T
        from_axis = np.hypot(x, y)
        inside = np.minimum(hole + z, wide)
        assert np.all(from_axis[z > 0.0] < inside[z > 0.0]), "a grain went through the bin or the funnel"
        assert observation.health.retired == 0
        rows.append((observation.time, np.count_nonzero(observation.grains.position[:, 2] < 0.0)))
    return np.array(rows), world


@pytest.mark.parametrize(("shape", "young"), [("sphere", 2e7), ("tetrahedron", 2e7)])
def test_hopper_runs_empty_and_nothing_passes_its_walls(tmp_path, shape, young):
    scene = hopper(young=young)
    scene["fills"][0]["shape"] = shape
    rows, world = discharge(scene, tmp_path, 0.8, 80)
    observation = world.observe()
    assert rows[-1, 1] == 120
    assert not observation.health.doubts
    assert observation.health.dissipated > 0.0
    assert observation.wall("gate").position == pytest.approx([0.0, 0.0, -0.11])


@pytest.mark.slow
def test_hopper_flows_evenly_whatever_the_head(tmp_path):
    """While the head falls to a third the count stays on a straight line to 3 %; a liquid's would leave it by 4 %.

    The rate falls with friction and is what Beverloo's law allows, ``C rho_b sqrt(g) (D - k d)^2.5``.
    """
    number, rates = 2000, {}
    for friction in (0.2, 0.6):
        rows, _ = discharge(hopper(friction, number, 1e7), tmp_path, 1.1, 220)
        time, passed = rows[(rows[:, 1] > 0.1 * number) & (rows[:, 1] < 0.7 * number)].T
        line = np.polyfit(time, passed, 1)
        rates[friction] = line[0]
        assert np.abs(np.polyval(line, time) - passed).max() < 0.03 * np.ptp(passed)
    assert rates[0.6] < 0.95 * rates[0.2]
    diameter, mass = 2.0 * HOPPER["grain"], 2500.0 * 4.0 / 3.0 * np.pi * HOPPER["grain"] ** 3
    reduced = [(2.0 * HOPPER["hole"] - k * diameter) ** 2.5 for k in (1.5, 1.3)]
    low, high = (c * 0.6 * 2500.0 * np.sqrt(GRAVITY) * one / mass for c, one in zip((0.55, 0.65), reduced, strict=True))
    assert low < rates[0.6] < high


def test_kernels_know_only_the_walls_there_are(make_world):
    """A floor compiles no shells, no virtual spheres, no plungers, and keeps no state for them."""
    world = make_world([[0.0, 0.0, 0.1]], 0.005, boundaries=[wall("plane", [0, 0, 1], [0, 0, 0])], threads=1)
    assert world.assembly.recipe.surfaces == {"plane"}
    assert world.assembly.solver.arrays.plungers is None
    everything = frozenset({"plane", "cylinder", "shell", "rough", "plunger"})
    for build in (build_surface_forces, build_surface_search):
        filling = () if build is build_surface_forces else (True,)
        little, much = (source(build(Recipe(surfaces=one), *filling)) for one in (world.assembly.recipe.surfaces, everything))
        for word in ("nearest_on_shell", "sphere_at", "ring_count", "var_plungers[", "wp::cos"):
            assert word not in little
        assert "nearest_on_shell" in much
        assert "sphere_at" in much
        assert len(little) < 0.75 * len(much)


def test_new_grains_may_lie_outside_of_shells_as_well(make_world):
    """Cylinders and cones push to both sides: here a grain slides down a roof, from which it was said to overlap it."""
    slope, radius, reach = 0.6, 0.005, 0.05
    roof = wall("cone", [0, 0, -1], [0, 0, 0], name="roof", hole_radius=0.0, radius=0.2, height=0.2 * np.tan(slope))
    up, down = np.array([np.sin(slope), 0.0, np.cos(slope)]), np.array([np.cos(slope), 0.0, -np.sin(slope)])
    world = make_world([0.0, 0.0, 0.2], radius, boundaries=[roof], domain=DOMAIN, friction=0.0, gravity=[0.0, 0.0, -GRAVITY])
    for side in (up, -up):
        with pytest.raises(CommandError, match="1 overlap wall 'roof'"):
            world.add_grains(reach * down + 0.99 * radius * side, radius)
    world.add_grains([reach * down + side * radius for side in (up, -up)], radius)
    world.step(round(0.1 / world.time_step))
    outer, inner = world.observe().grains.velocity[1:]
    assert outer == pytest.approx(GRAVITY * np.sin(slope) * world.time * down, abs=2e-3)
    assert inner == pytest.approx([0.0, 0.0, -GRAVITY * world.time], abs=1e-6)
