"""Liquid bridges and adhesion against published curves: two grains that part, and grains that hang from a ceiling."""

import numpy as np
import pytest
import trimesh
from scenes import floor, record

POISSON, DENSITY = 0.3, 2650.0


def mass_of(radius):
    """[kg]."""
    return DENSITY * 4 / 3 * np.pi * radius**3


def pair(make_world, law, radius, gap, speed, young=1e7, **further):
    """Two grains that move apart (speed > 0) or towards each other."""
    return make_world(
        [[0.0, 0.0, 0.0], [2.0 * radius + gap, 0.0, 0.0]],
        radius,
        velocity=[[-0.5 * speed, 0.0, 0.0], [0.5 * speed, 0.0, 0.0]],
        material={"density": DENSITY, "young": young, "poisson": POISSON},
        restitution=1.0,
        contact={"cohesion": law},
        threads=1,
        **{"friction": 0.0} | further,
    )


def pulls(world, steps):
    """Gap [m] between the grains and attraction [N] at each step, shape (steps,)."""
    history = record(world, steps)
    grains = world.observe().grains
    x, v = history["position"][:, :, 0], history["velocity"][:, :, 0].astype(float)
    gap = x[:, 1] - x[:, 0] - grains.radius.sum(dtype=float)
    return gap, -np.gradient(v[:, 1], world.time_step) * mass_of(float(grains.radius[1]))


RADIUS = 5e-4
VOLUME = 0.01 * RADIUS**3
RUPTURE = VOLUME ** (1.0 / 3.0)
LIQUID = {"bridge_volume": VOLUME / RADIUS**3, "surface_tension": 0.073, "contact_angle": 0.0}


@pytest.mark.parametrize("precision", ["double", "single"])
def test_bridge_force_over_the_gap(make_world, precision):
    """Willett et al. 2000 for R = 0.5 mm and V = 0.01 R^3; rupture at V^(1/3)."""
    world = pair(make_world, "capillary", RADIUS, -1e-9, 1.0, liquid=LIQUID, precision=precision, time_step=4e-7)
    gap, pull = pulls(world, 330)
    near = (gap > 0.0) & (gap < 0.2 * RUPTURE)
    # The reciprocal of the force is a parabola, which gives the force at touch.
    assert 1.0 / np.polyval(np.polyfit(gap[near], 1.0 / pull[near], 2), 0.0) == pytest.approx(229.34e-6, rel=1e-2)
    for share, force in ((0.1, 170.9e-6), (0.25, 100.1e-6), (0.5, 45.6e-6), (0.75, 24.9e-6)):
        assert np.interp(share * RUPTURE, gap, pull) == pytest.approx(force, rel=1e-2)
    held = (gap > 0.9 * RUPTURE) & (gap < 0.995 * RUPTURE)
    assert 1.0 / np.polyval(np.polyfit(gap[held], 1.0 / pull[held], 2), RUPTURE) == pytest.approx(15.4e-6, rel=1e-2)
    assert gap[pull > 1e-6][-1] == pytest.approx(RUPTURE, rel=1e-2)
    assert np.all(pull[gap > 1.01 * RUPTURE] == 0.0)


def test_bridge_of_a_liquid_that_wets_less_pulls_less_and_reaches_farther(make_world):
    """By cos(t), up to (1 + t/2) V^(1/3) for a contact angle t."""
    angle = 0.6
    world = pair(make_world, "capillary", RADIUS, -1e-9, 1.0, liquid=LIQUID | {"contact_angle": angle}, time_step=4e-7)
    gap, pull = pulls(world, 400)
    for share, force in ((0.25, 100.1e-6), (0.5, 45.6e-6)):
        assert np.interp(share * RUPTURE, gap, pull) == pytest.approx(np.cos(angle) * force, rel=1e-2)
    assert gap[pull > 1e-6][-1] == pytest.approx((1.0 + 0.5 * angle) * RUPTURE, rel=1e-2)


@pytest.mark.parametrize("radii", [(1.0, 1.0), (1.0, 8.0), (8.0, 8.0)])
def test_bridges_of_many_sizes_break_where_the_smaller_grain_lets_go(make_world, radii):
    """Beside grains of other sizes, so that some are sought farther away than others."""
    small, large = (RADIUS * ratio for ratio in radii)
    others = [[0.0, 0.1, 0.0], [0.0, 0.2, 0.0], [0.0, 0.3, 0.0]]
    world = make_world(
        [[0.0, 0.0, 0.0], [small + large - 1e-9, 0.0, 0.0], *others],
        [small, large, RADIUS, 8.0 * RADIUS, 3.0 * RADIUS],
        velocity=[[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], *np.zeros((3, 3))],
        restitution=1.0,
        contact={"cohesion": "capillary"},
        liquid=LIQUID,
        threads=1,
    )
    rupture, held = LIQUID["bridge_volume"] ** (1.0 / 3.0) * small, 0.0
    while held < 2.0 * rupture and len(world.grain_contacts()):
        x = world.observe().grains.position[:2, 0]
        held = x[1] - x[0] - small - large
        world.step(1)
    assert held == pytest.approx(rupture, abs=2.0 * world.time_step)


def test_bridge_forms_on_contact_only(make_world):
    """A grain that passes within reach without touching feels nothing; one that touches is held back."""
    common = {"material": {"density": DENSITY, "young": 1e7, "poisson": POISSON}, "contact": {"cohesion": "capillary"}}
    common |= {"liquid": LIQUID, "restitution": 1.0, "friction": 0.0, "threads": 1}
    common |= {"domain": {"low": [-0.01] * 3, "high": [0.01] * 3}}
    velocity = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]
    for gap, feels in ((0.3 * RUPTURE, False), (-1e-3 * RADIUS, True)):
        world = make_world([[0.0, 0.0, 0.0], [-1.5 * RADIUS, 0.0, 2.0 * RADIUS + gap]], RADIUS, velocity=velocity, **common)
        world.step(round(4.0 * RADIUS / 0.5 / world.time_step))
        grains = world.observe().grains
        assert feels or np.linalg.norm(grains.position[1] - grains.position[0]) > 2.0 * RADIUS + RUPTURE
        assert np.array_equal(grains.velocity, velocity) == (not feels)
    assert grains.velocity[0, 0] > 0.01, "the one that it touched is drawn along"


def test_bridge_keeps_account_of_its_energy(make_world):
    """Drawing a bridge stores the integral of its force, and nothing is dissipated until it breaks."""
    world = pair(make_world, "capillary", RADIUS, -1e-9, 1.0, liquid=LIQUID, time_step=1e-7)
    start = world.observe().health
    world.step(round(0.9 * RUPTURE / 1.0 / 1e-7))
    drawn = world.observe().health
    lost = start.kinetic - drawn.kinetic
    assert lost > 0.01 * start.kinetic
    assert abs(drawn.dissipated) < 2e-3 * lost
    world.step(round(0.5 * RUPTURE / 1.0 / 1e-7))
    gap = np.linspace(0.0, RUPTURE, 2000)
    scaled = gap * np.sqrt(RADIUS / VOLUME)
    work = np.trapezoid(2.0 * np.pi * RADIUS * 0.073 / (1.0 + 1.05 * scaled + 2.5 * scaled**2), gap)
    assert world.observe().health.dissipated == pytest.approx(work, rel=1e-2)


@pytest.mark.parametrize("partner", ["floor", "plate"])
def test_bridge_to_a_surface_costs_its_work(make_world, tmp_path, partner):
    """A grain leaves a wall or a smooth tool (R twice its radius); lists made anew on the way keep its bridge."""
    trimesh.creation.box((0.01, 0.01, 0.002)).export(tmp_path / "plate.stl")
    plate = {"mesh": "plate.stl", "material": "wall", "particle_radius": 0.001, "contact": "smooth"}
    plate["pose"] = {"position": [0.0, 0.0, -0.001]}
    surface = {"boundaries": floor()} if partner == "floor" else {"tools": {"plate": plate}}
    world = make_world(
        [[0.0, 0.0, RADIUS - 1e-9]],
        RADIUS,
        velocity=[0.0, 0.0, 0.5],
        material={"density": DENSITY, "young": 1e7, "poisson": POISSON},
        restitution=1.0,
        friction=0.0,
        contact={"cohesion": "capillary"},
        liquid=LIQUID,
        skin=2e-5,
        time_step=2e-7,
        domain={"low": [-0.01] * 3, "high": [0.01] * 3},
        threads=1,
        **surface,
    )
    before = world.observe().health.kinetic
    world.step(round(2.0 * RUPTURE / 0.5 / 2e-7))
    gap = np.linspace(0.0, RUPTURE, 2000)
    scaled = gap * np.sqrt(2.0 * RADIUS / VOLUME)
    work = np.trapezoid(2.0 * np.pi * 2.0 * RADIUS * 0.073 / (1.0 + 1.05 * scaled + 2.5 * scaled**2), gap)
    assert before - world.observe().health.kinetic == pytest.approx(work, rel=1e-2)


WIDE, ADHESION, YOUNG = 0.005, 0.2, 1e7
EFFECTIVE = YOUNG / (2.0 * (1.0 - POISSON**2))


def bounce(make_world, law, precision, time_step):
    """Two grains about to touch at 0.02 m/s, without damping; they have parted again after 5.5 ms."""
    return pair(make_world, law, WIDE, 1e-9, -0.02, precision=precision, numbers={"adhesion": ADHESION}, time_step=time_step)


def loss(make_world, law, precision):
    """Kinetic energy that the bounce costs [J]."""
    world = bounce(make_world, law, precision, 1e-6)
    before = world.observe().health
    world.step(5500)
    after = world.observe().health
    assert after.contacts == 0
    return before.kinetic - after.kinetic


@pytest.mark.parametrize("precision", ["double", "single"])
def test_dmt_pulls_with_2_pi_w_r(make_world, precision):
    """The attraction beside the Hertz force is ``2 pi w R*`` at every overlap, and what touching gives parting takes."""
    gap, pull = pulls(bounce(make_world, "dmt", precision, 1e-5), 550)
    touching = np.flatnonzero(gap < 0.0)[2:-2]
    hertz = 4.0 / 3.0 * EFFECTIVE * np.sqrt(WIDE / 2.0) * (-gap[touching]) ** 1.5
    expected = 2.0 * np.pi * ADHESION * WIDE / 2.0
    assert pull[touching] + hertz == pytest.approx(expected, rel=2e-2)
    assert np.mean(pull[touching] + hertz) == pytest.approx(expected, rel=5e-3)
    assert abs(loss(make_world, "dmt", precision)) < 1e-2 * expected * -gap.min()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_jkr_pulls_off_with_3_2_pi_w_r(make_world, precision):
    """Pull-off force ``3/2 pi w R*``, and the work a bounce costs, ``7.09 (w^5 R*^4 / E*^2)^(1/3)``.

    Thornton & Ning 1998, https://doi.org/10.1016/S0032-5910(98)00099-0.
    """
    gap, pull = pulls(bounce(make_world, "jkr", precision, 1e-5), 550)
    assert pull.max() == pytest.approx(1.5 * np.pi * ADHESION * WIDE / 2.0, rel=5e-3)
    assert loss(make_world, "jkr", precision) == pytest.approx(JKR_COST, rel=1e-2)
    torn = gap[pull > 0.1 * pull.max()].max()
    patch = (np.pi * ADHESION * (WIDE / 2.0) ** 2 / (8.0 * EFFECTIVE)) ** (1.0 / 3.0)
    assert torn == pytest.approx(3.0 * patch**2 / (WIDE / 2.0), rel=2e-2)


JKR_COST = 7.09 * (ADHESION**5 * (WIDE / 2.0) ** 4 / EFFECTIVE**2) ** (1.0 / 3.0)  # [J] to tear a contact, from touch


def test_jkr_keeps_account_of_its_energy(make_world):
    """Nothing is dissipated while grains stick, but for the step in which the pull sets in; once torn apart, the cost is."""
    world = bounce(make_world, "jkr", "double", 1e-6)
    sticking = []
    while len(sticking) < 2 or world.observe().health.contacts:
        world.step(50)
        sticking.append(world.observe().health.dissipated)
    assert abs(sticking[0]) < 1.5 * np.pi * ADHESION * WIDE / 2.0 * 0.02 * 1e-6
    assert np.ptp(sticking[:-1]) < 1e-3 * JKR_COST
    assert sticking[-1] == pytest.approx(JKR_COST, rel=1e-2)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_grains_that_meet_with_too_little_energy_to_part_stick(make_world, share, precision):
    """They swing about where they balance, for ever."""
    speed = -np.sqrt(2.0 * share * JKR_COST / (0.5 * mass_of(WIDE)))
    world = pair(make_world, "jkr", WIDE, 1e-9, speed, precision=precision, numbers={"adhesion": ADHESION}, time_step=1e-6)
    for _ in range(10):
        world.step(5000)
        health = world.observe().health
        assert health.contacts == 1
        assert abs(health.dissipated) < 2e-3 * JKR_COST
        assert health.doubts == ()


@pytest.mark.parametrize(("share", "holds"), [(0.97, True), (1.03, False)])
def test_dmt_ceiling_holds_a_grain_up_to_its_weight(make_world, share, holds):
    """A grain under a flat ceiling (R* = R) hangs as long as its weight is below ``2 pi w R``."""
    weight = mass_of(WIDE) * 9.81
    adhesion = weight / share / (2.0 * np.pi * WIDE)
    world = make_world(
        [[0.0, 0.0, -WIDE + 1e-9]],
        WIDE,
        material={"density": DENSITY, "young": YOUNG, "poisson": POISSON},
        gravity=[0.0, 0.0, -9.81],
        boundaries=[{"type": "plane", "name": "ceiling", "material": "wall", "point": [0, 0, 0], "normal": [0, 0, -1]}],
        domain={"low": [-0.1] * 3, "high": [0.1] * 3},
        contact={"cohesion": "dmt"},
        numbers={"adhesion": adhesion},
    )
    world.step(round(0.05 / world.time_step))
    observation = world.observe()
    if holds:
        assert observation.grains.position[0, 2] > -1.001 * WIDE
        assert observation.wall("ceiling").force[2] == pytest.approx(-weight, rel=1e-3)
    else:
        assert observation.grains.position[0, 2] < -1.001 * WIDE
