"""How beds come to rest before time zero."""

import numpy as np
import pytest
from scenes import SceneMaker, floor

from sand_sim import World, read_scene
from sand_sim.scene.filling import fill_grains

RADIUS, GRAVITY = 0.02, 9.81
WIDE = {"low": [-0.1] * 3, "high": [0.1] * 3}
ROOMY = {"low": [-0.1] * 3, "high": [0.4] * 3}


def silo(tmp_path, **settle):
    """Weights over that of the grains that the floor and the wall of a pipe carry, which is eight radii high filled."""
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.0025, gravity=[0.0, 0.0, -GRAVITY], precision="single")
    region = {"low": [-RADIUS, -RADIUS, 0.0], "high": [RADIUS, RADIUS, 0.5]}
    scene["fills"] = [{"material": "grain", "radius": {"uniform": [0.0023, 0.0027]}, "region": region, "count": 1500}]
    pipe = {"type": "cylinder", "name": "pipe", "material": "wall", "point": [0, 0, 0], "axis": [0, 0, 1], "radius": RADIUS}
    scene |= {"boundaries": [*floor(), pipe], "settle": {"time": 4.0, "speed": 0.01} | settle}
    seen = World(read_scene(scene, tmp_path)).observe()
    weight = seen.grains.mass.sum() * GRAVITY
    return (-seen.wall(name).force[2] / weight for name in ("floor", "pipe"))


@pytest.mark.parametrize(
    ("settle", "least", "most"), [({}, 0.35, 0.8), ({"fall": 0.15}, 0.25, 0.6), ({"fall": "free"}, 0.9, 1.5)]
)
def test_the_walls_of_a_silo_bear_grains_that_do_not_fall_freely(tmp_path, settle, least, most):
    """Janssen: the floor bears ``l/H (1 - exp(-H/l))`` of the weight, ``l = R/(2 mu K)``, 0.26 for K = 0.5 at full friction.

    Of a column that falls freely walls are dragged down, and as it springs back they push.
    """
    on_floor, on_wall = silo(tmp_path, **settle)
    assert on_floor + on_wall == pytest.approx(1.0, abs=0.02)
    assert least < on_floor < most


@pytest.mark.parametrize("height", [0.04, None])
def test_a_bed_is_borne_by_its_floor_from_time_zero_on(tmp_path, height):
    """Also one that has just lost the load that was struck off, and would spring back: it neither falls nor rises."""
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.0025, gravity=[0.0, 0.0, -GRAVITY], precision="single")
    region = {"low": [-0.03, -0.03, 0.0], "high": [0.03, 0.03, 0.3]}
    fill = {"material": "grain", "radius": {"uniform": [0.0027, 0.0033]}, "region": region}
    scene["fills"] = [fill | ({"height": height} if height else {"count": 800})]
    sides = {"type": "box", "name": "bin", "material": "wall", "low": region["low"], "high": region["high"], "open": ["top"]}
    scene |= {"boundaries": [sides], "settle": {"time": 1.0, "speed": 0.01}}
    world, borne = World(read_scene(scene, tmp_path)), []
    assert world.warnings == []
    for _ in range(10):
        seen = world.observe()
        borne.append(-sum(wall.force[2] for wall in seen.walls) / (seen.grains.mass.sum() * GRAVITY))
        world.step(round(0.002 / world.time_step))
    assert borne == pytest.approx(np.ones(len(borne)), abs=0.05)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
@pytest.mark.parametrize("kind", ["grain", "body"])
def test_grains_fall_as_fast_as_asked(make_world, integrator, kind):
    """``v = v_0 (1 - exp(-g t / v_0))``, that of a rigid body too; both still fall as the time ends."""
    fastest, time = 0.2, 0.05
    further = {
        "integrator": integrator,
        "gravity": [0.0, 0.0, -GRAVITY],
        "settle": {"time": time, "fall": fastest, "speed": 1e-6},
    }
    if kind == "body":
        spheres = [[-0.004, 0.0, 0.0, 0.005], [0.004, 0.0, 0.0, 0.005]]
        further["bodies"] = {"bell": {"spheres": spheres, "material": "grain", "pose": {"position": [0.05, 0.0, 0.0]}}}
    world = make_world([[0.0, 0.0, 0.0]], 0.005, domain=WIDE, **further)
    expected = fastest * (1.0 - np.exp(-GRAVITY * time / fastest))
    assert world.observe().grains.velocity[-1, 2] == pytest.approx(-expected, rel=0.05)


def test_time_zero_is_free_of_drag(make_world):
    world = make_world([[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -GRAVITY], settle={"time": 1e-3, "fall": 0.01})
    begin = world.observe().grains.velocity[0, 2]
    world.step(100)
    assert world.observe().grains.velocity[0, 2] == pytest.approx(begin - GRAVITY * world.time, rel=1e-6)


def test_a_liquid_that_slows_grains_within_a_chunk_takes_no_longer_than_asked(make_world):
    """``z = v_0 t - v_0^2/g (1 - exp(-g t / v_0))``; drag is applied anew sooner than it is looked whether all rest."""
    fastest, time = 0.02, 0.05
    settle = {"time": time, "fall": fastest, "speed": 1e-6}
    world = make_world([[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -GRAVITY], domain=WIDE, settle=settle)
    expected = fastest * (time - fastest / GRAVITY * (1.0 - np.exp(-GRAVITY * time / fastest)))
    assert world.observe().grains.position[0, 2] == pytest.approx(-expected, rel=0.03)


def test_unless_told_grains_fall_at_a_share_of_the_speed_at_the_end_of_the_highest_fall(make_world):
    """0.3 of ``sqrt(2 g h)``, for a grain above a floor ``h`` between its upper end and the floor and a radius more."""
    height, time = 0.07, 0.05
    further = {"boundaries": floor(-height), "gravity": [0.0, 0.0, -GRAVITY], "settle": {"time": time, "speed": 1e-6}}
    world = make_world([[0.0, 0.0, 0.005]], 0.005, domain=WIDE, **further)
    fastest = 0.3 * np.sqrt(2.0 * GRAVITY * (height + 0.01))
    expected = fastest * (1.0 - np.exp(-GRAVITY * time / fastest))
    assert world.observe().grains.velocity[0, 2] == pytest.approx(-expected, rel=0.03)


def test_the_speed_that_is_told_is_that_of_the_kinetic_energy_and_all_the_time_is_used(tmp_path):
    """Masses 1 and 8 at 0.9 and 0.1 m/s: ``sqrt((0.9^2 + 8 0.1^2) / 9)``; no share of the work is left over."""
    maker, told = SceneMaker(tmp_path), []
    scene = maker.scene([[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]], [0.004, 0.008], velocity=[[0.9, 0.0, 0.0], [0.0, 0.0, 0.1]])
    scene |= {"domain": WIDE, "settle": {"time": 0.01, "speed": 0.31}}
    world = World(read_scene(scene, tmp_path), lambda stage, share: told.append((stage, share)))
    assert world.warnings[0].startswith("settle: grains still move at 0.31 m/s (root mean square) after 0.01 s")
    assert [share for stage, share in told if stage == "settling"] == pytest.approx(np.arange(1, 51) / 50)
    assert world.observe().grains.position[0, 0] == pytest.approx(0.009, rel=0.01)


def test_grains_that_have_been_slow_for_too_short_a_time_are_told_of(make_world):
    """A grain that begins to fall is slower than 1 m/s for 0.1 s; only after twice that time it is known to rest."""
    further = {"gravity": [0.0, 0.0, -GRAVITY], "settle": {"time": 0.08, "speed": 1.0, "fall": "free"}, "domain": WIDE}
    world = make_world([[0.0, 0.0, 0.0]], 0.005, **further)
    assert world.warnings[0].startswith(
        "settle: grains have been slower than 1 m/s for only 0.08 s after 0.08 s, not for the 0.2 s"
    )


def test_a_grain_that_bounces_for_ever_never_rests(make_world):
    """Slow at each of its four heights, 20 ms as long as it takes to turn, and not 80 ms."""
    settle = {"time": 0.5, "speed": 0.1, "fall": "free"}
    further = {"boundaries": floor(), "gravity": [0.0, 0.0, -GRAVITY], "restitution": 1.0, "settle": settle}
    world = make_world([[0.0, 0.0, 0.025]], 0.005, **further)
    assert [warning[:31] for warning in world.warnings] == ["settle: grains still move at 0."]


def fills_of_three(kind):
    """Two fills by height, the second of them not at z = 0, and one by count that reaches higher than both."""
    region = [{"low": [x, 0.0, z], "high": [x + 0.06, 0.06, z + 0.2]} for x, z in ((0.0, 0.02), (0.1, 0.0), (0.2, -0.05))]
    fills = [{"name": f"fill {k}", "material": "grain", "radius": 0.005, "region": region[k]} for k in range(3)]
    how = ({"height": 0.032, "shape": kind}, {"count": 200, "seed": 1}, {"height": 0.047, "radius": {"uniform": [0.004, 0.005]}})
    return [one | more for one, more in zip(fills, how, strict=True)]


@pytest.mark.parametrize("kind", ["sphere", "tetrahedron"])
def test_each_fill_is_struck_off_at_its_own_height_above_its_own_region(tmp_path, kind):
    """What remains are the grains of each fill as it has been laid out, but for those that reach above that."""
    fills = fills_of_three(kind)
    scene = read_scene(SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005) | {"fills": fills, "domain": ROOMY}, tmp_path)
    world, expected = World(scene), []
    for fill in scene.fills:
        table = fill_grains(fill, scene.materials[0], 0, [])
        spheres = table.position[:, 2] + table.radius
        if kind == "tetrahedron" and fill.shape == kind:
            centre = table.bodies.position
            spheres = centre[:, 2] + (np.linalg.norm(table.offset, axis=1) + table.radius).max()
            table = table.bodies
        keep = spheres <= fill.low[2] + fill.height if fill.height else np.ones(len(spheres), bool)
        assert fill.height is None or 0 < keep.sum() < len(keep)
        expected.append(table.position[keep])
    assert world.observe().grains.position == pytest.approx(np.concatenate(expected), abs=1e-6)
    assert world.warnings == []


def test_how_high_a_fill_is_does_not_count_those_that_lie_higher(tmp_path):
    """A grain on a shelf above a heap that has spread, whose region begins below zero."""
    region = {"low": [0.0, 0.0, -0.02], "high": [0.05, 0.05, 0.3]}
    shelf = {"type": "hole_plate", "name": "shelf", "material": "wall", "point": [0.2, 0.0, 0.2], "normal": [0.0, 0.0, 1.0]}
    maker = SceneMaker(tmp_path)
    scene = maker.scene([[0.2, 0.0, 0.205]], 0.005, gravity=[0.0, 0.0, -GRAVITY], precision="single", restitution=0.3)
    scene["fills"].insert(0, {"name": "bed", "material": "grain", "radius": 0.005, "region": region, "height": 0.1})
    scene |= {"boundaries": [*floor(-0.02), shelf | {"hole_radius": 0.0, "radius": 0.02}], "settle": {"time": 0.6, "speed": 0.02}}
    world = World(read_scene(scene, tmp_path))
    grains = world.observe().grains
    top = (grains.position[:, 2] + grains.radius)[:-1].max() + 0.02
    assert grains.position[-1, 2] > 0.2
    assert world.warnings[-1].startswith(f"fills: 'bed' is only {top:.3g} m high, not 0.1 m; ")


def test_what_happens_before_time_zero_counts_for_nothing_afterwards(make_world):
    """A grain that has been pressed deep into the floor, and one that has fallen out of the domain with energy of its own."""
    disc = {"type": "hole_plate", "name": "disc", "material": "wall", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
    further = {"boundaries": [disc | {"hole_radius": 0.0, "radius": 0.02}], "gravity": [0.0, 0.0, -GRAVITY], "restitution": 0.1}
    further |= {"domain": WIDE, "settle": {"time": 0.5, "speed": 0.001, "fall": "free"}}
    world = make_world([[0.0, 0.0, 0.0048], [0.05, 0.0, 0.005]], 0.005, **further)
    health, weight = world.observe().health, 2500.0 * 4.0 / 3.0 * np.pi * 0.005**3 * GRAVITY
    assert len(world.observe().grains) == 1
    modulus = 1e7 / (1.0 - 0.25**2)
    overlap = (0.75 * weight / (modulus * np.sqrt(0.005))) ** (2.0 / 3.0)  # Hertz's, on a rigid floor
    assert health.deepest == pytest.approx(overlap / 0.005, rel=0.02)
    assert health.retired == 0
    assert abs(health.dissipated) < 1e-9 * weight
    assert health.doubts == ()


def few_layers(tmp_path, **settle):
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.002, gravity=[0.0, 0.0, -GRAVITY], precision="single")
    region = {"low": [-0.02, -0.02, 0.0], "high": [0.02, 0.02, 0.2]}
    scene["fills"] = [{"material": "grain", "radius": 0.002, "region": region, "count": 200}]
    sides = {"type": "box", "name": "bin", "material": "wall", "low": region["low"], "high": region["high"], "open": ["top"]}
    return World(read_scene(scene | {"boundaries": [sides], "settle": {"speed": 0.01} | settle}, tmp_path))


def test_a_few_layers_rest_when_their_columns_have_toppled(tmp_path):
    """Grains of a lattice that stand on one another are slow at first, too, and sank by a fifth of a diameter in rest."""
    world = few_layers(tmp_path, time=2.0)
    assert world.warnings == []
    start = world.observe().grains.position[:, 2].mean()
    world.step(round(0.3 / world.time_step))
    assert start - world.observe().grains.position[:, 2].mean() < 0.05 * 0.004


def test_a_bed_that_still_stands_in_columns_when_its_time_ends_is_told(tmp_path):
    (warning,) = few_layers(tmp_path, time=0.06, fall=0.05).warnings
    assert "stand on one other" in warning
