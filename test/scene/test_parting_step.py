"""Bonds are torn at the price of their work at the automatic time step, whatever their range."""

import numpy as np
import pytest

from sand_sim.contact.cohesion import bridge_share

DENSITY, POISSON = 2500.0, 0.3
ADHESION, TENSION = 0.2, 0.073


def effective_young(young):
    """Of two grains [Pa]."""
    return young / (2.0 * (1.0 - POISSON**2))


def jkr_work(radius, young):
    """Thornton & Ning 1998, https://doi.org/10.1016/S0032-5910(98)00099-0 [J]."""
    return 7.09 * (ADHESION**5 * (0.5 * radius) ** 4 / effective_young(young) ** 2) ** (1.0 / 3.0)


def bridge_work(radius, volume):
    """Integral of the force of Willett et al. 2000 up to rupture at ``V^(1/3)`` [J], counted out."""
    gap = np.linspace(0.0, volume ** (1.0 / 3.0), 100_001)
    scaled = gap * np.sqrt(radius / volume)
    return np.trapezoid(2.0 * np.pi * radius * TENSION / (1.0 + 1.05 * scaled + 2.5 * scaled**2), gap)


def kept(make_world, law, radius, young, work, ratio, place, **further):
    """Share of the kinetic energy that is left of an undamped bounce [1].

    Args:
        make_world: fixture.
        law: of cohesion.
        radius: of the two grains [m].
        young: of their material [Pa].
        work: of their bond [J].
        ratio: kinetic energy before the bounce over that work [1].
        place: share of a step that has passed at touch [1].
        further: of the scene.
    """
    speed = np.sqrt(4.0 * ratio * work / (DENSITY * 4.0 / 3.0 * np.pi * radius**3))

    def world(gap):
        return make_world(
            [[0.0, 0.0, 0.0], [2.0 * radius + gap, 0.0, 0.0]],
            radius,
            velocity=[[0.5 * speed, 0.0, 0.0], [-0.5 * speed, 0.0, 0.0]],
            material={"density": DENSITY, "young": young, "poisson": POISSON},
            restitution=1.0,
            friction=0.0,
            contact={"cohesion": law},
            domain={"low": [-0.2] * 3, "high": [0.2] * 3},
            threads=1,
            **further,
        )

    step = world(1e-3 * radius).time_step
    bounced = world((1.0 + place) * speed * step)
    before = bounced.observe().health.kinetic
    bounced.step(5000)
    assert bounced.observe().health.contacts == 0
    return bounced.observe().health.kinetic / before


@pytest.mark.parametrize("place", [0.0, 0.5, 0.999])
@pytest.mark.parametrize("ratio", [1.2, 2.0, 10.0])
def test_jkr_bounce(make_world, ratio, place):
    left = kept(make_world, "jkr", 0.005, 1e7, jkr_work(0.005, 1e7), ratio, place, numbers={"adhesion": ADHESION})
    assert left == pytest.approx(1.0 - 1.0 / ratio, abs=0.02)


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 0.75, 0.999])
@pytest.mark.parametrize("ratio", [1.2, 10.0])
def test_dmt_bounce(make_world, ratio, place):
    """The pull gives what it takes; in fine powder the contact alone would ask for steps four times as long."""
    radius, young = 1e-4, 1e7
    pull = np.pi * ADHESION * radius
    work = pull * (0.75 * pull / (effective_young(young) * np.sqrt(0.5 * radius))) ** (2.0 / 3.0)
    left = kept(make_world, "dmt", radius, young, work, ratio, place, numbers={"adhesion": ADHESION})
    assert left == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("place", [0.0, 0.5, 0.999])
@pytest.mark.parametrize("ratio", [1.2, 2.0, 10.0])
@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
def test_bounce_with_a_bridge(make_world, share, ratio, place):
    """Bridges of a volume of ``share R^3``, whose pull falls within a thirtieth to a thousandth of a radius."""
    liquid = {"saturation": share / (4.0 / 3.0 * np.pi) / bridge_share(1.0), "surface_tension": TENSION, "contact_angle": 0.0}
    work = bridge_work(5e-4, share * 5e-4**3)
    left = kept(make_world, "capillary", 5e-4, 1e7, work, ratio, place, liquid=liquid)
    assert left == pytest.approx(1.0 - 1.0 / ratio, abs=0.02)


def test_range_of_cohesion_is_a_reason(make_world):
    grains = [[0.0, 0.0, 0.0], [0.011, 0.0, 0.0]]
    chosen = make_world(grains, 0.005, contact={"cohesion": "jkr"}, numbers={"adhesion": ADHESION}).assembly.time_step
    assert chosen.reason == "range of cohesion"
    doubtful = make_world(grains, 0.005, contact={"cohesion": "jkr"}, numbers={"adhesion": ADHESION}, time_step=2.0 * chosen.safe)
    assert "2.0 times the safe step" in doubtful.assembly.time_step.warning
    plain = make_world(grains, 0.005).assembly.time_step
    for law in ("dmt", "jkr"):
        world = make_world(grains, 0.005, contact={"cohesion": law}, numbers={"adhesion": 0.0})
        assert world.assembly.time_step == plain
