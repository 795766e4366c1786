"""One contact against closed forms and published numbers (Chung & Ooi 2011, https://doi.org/10.1007/s10035-011-0277-0)."""

import numpy as np
import pytest
from scenes import floor, record

from sand_sim.contact.damping import damping_ratio, restitution_of_damping

# name: radius [m], speed of each body [m/s], E [Pa], nu, rho, spheres (2) or plane (1), F_max [N], d_max [m], t_c [s]
HERTZ = {
    "T1 glass": (0.01, 10.0, 48e9, 0.20, 2800.0, 2, 10697.0, 274.11e-6, 40.34e-6),
    "T1 limestone": (0.01, 10.0, 20e9, 0.25, 2500.0, 2, 7108.0, 368.30e-6, 54.20e-6),
    "T2 aluminium alloy": (0.1, 0.2, 70e9, 0.30, 2699.0, 1, 11370.0, 49.717e-6, 731.7e-6),
    "T2 magnesium alloy": (0.1, 0.2, 40e9, 0.35, 1800.0, 1, 7232.7, 52.123e-6, 767.1e-6),
    "T3 aluminium oxide": (0.0025, 3.9, 380e9, 0.23, 4000.0, 1, 615.35, 8.089e-6, 6.105e-6),
    "T3 cast iron": (0.0025, 3.9, 100e9, 0.25, 7000.0, 1, 506.8, 17.19e-6, 12.97e-6),
}


def impact(make_world, case, steps_per_contact, precision="double", restitution=1.0):
    """Peak force [N], peak overlap [m], duration [s] and rebound over impact speed of a normal impact."""
    radius, speed, young, poisson, density, bodies, *_, duration = case
    dt, gap = duration / steps_per_contact, 1e-3 * radius
    material = {"density": density, "young": young, "poisson": poisson}
    common = {"material": material, "restitution": restitution, "friction": 0.0, "time_step": dt, "precision": precision}
    if bodies == 2:
        position = [[0.0, 0.0, 0.0], [2.0 * radius + gap, 0.0, 0.0]]
        world = make_world(position, radius, velocity=[[speed, 0.0, 0.0], [-speed, 0.0, 0.0]], **common)
    else:
        position, velocity = [[0.0, 0.0, radius + gap]], [0.0, 0.0, -speed]
        world = make_world(position, radius, velocity=velocity, boundaries=floor(), **common)
    approach = gap / (speed * bodies)
    history = record(world, round((approach + 1.5 * duration) / dt))
    if bodies == 2:
        x, v = history["position"][:, :, 0], history["velocity"][:, 0, 0]
        overlap, force = 2.0 * radius - (x[:, 1] - x[:, 0]), -np.gradient(v, dt) * density * 4 / 3 * np.pi * radius**3
    else:
        z, v = history["position"][:, 0, 2], history["velocity"][:, 0, 2]
        overlap, force = radius - z, np.gradient(v, dt) * density * 4 / 3 * np.pi * radius**3
    touching = history["time"][overlap > 0.0]
    # The overlap changes at impact speed at both ends of the contact, which gives its duration to better than a step.
    entry, leave = overlap[overlap > 0.0][0], overlap[overlap > 0.0][-1]
    duration = touching[-1] - touching[0] + (entry + leave) / (speed * bodies)
    return force.max(), overlap.max(), duration, abs(v[-1]) / speed


@pytest.mark.parametrize("name", HERTZ)
@pytest.mark.parametrize("precision", ["double", "single"])
def test_elastic_hertz_impact(make_world, name, precision):
    force, overlap, duration, rebound = impact(make_world, HERTZ[name], 50, precision)
    expected_force, expected_overlap, expected_duration = HERTZ[name][-3:]
    assert force == pytest.approx(expected_force, rel=5e-3)
    assert overlap == pytest.approx(expected_overlap, rel=5e-3)
    assert duration == pytest.approx(expected_duration, rel=5e-3)
    assert rebound == pytest.approx(1.0, rel=5e-3)


RADIUS, DENSITY, YOUNG, POISSON, STIFFNESS = 0.005, 2500.0, 1e7, 0.25, 5e4
MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3
RESTITUTIONS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99]
LINEAR = {"normal": "linear", "tangential": "linear"}


def rebound(make_world, partner, speed, radius=RADIUS, gap=1e-3 * RADIUS, **further):
    """Rebound over impact speed of a grain that meets another or a floor, at the automatic time step."""
    further = {"material": {"density": DENSITY, "young": YOUNG, "poisson": POISSON}, "friction": 0.0, "threads": 1} | further
    if partner == "grain":
        position, velocity = [[0.0, 0.0, 0.0], [2.0 * radius + gap, 0.0, 0.0]], [[speed, 0.0, 0.0], [-speed, 0.0, 0.0]]
        world = make_world(position, radius, velocity=velocity, **further)
    else:
        world = make_world([[0.0, 0.0, radius + gap]], radius, velocity=[0.0, 0.0, -speed], boundaries=floor(), **further)
    contact = world.assembly.time_step.contact
    world.step(round((gap / speed + 8.0 * contact) / world.time_step))
    observation = world.observe()
    assert observation.health.elastic == 0.0, "still in contact"
    return float(np.abs(observation.grains.velocity).max()) / speed


# Restitution that Tsuji's beta gives where the force never pulls, and the beta that gives the asked one; z = sqrt(5/6) beta.
CLIPPED = {0.1: 0.2527, 0.3: 0.3971, 0.5: 0.5503, 0.7: 0.7182, 0.9: 0.9020, 0.99: 0.9900}
BETAS = [1.2427, 0.7311, 0.4972, 0.3545, 0.2553, 0.1809, 0.1222, 0.0744, 0.0343, 0.0165, 0.0032]


def test_damping_of_the_clipped_law():
    asked = np.log(list(CLIPPED))
    ratios = -np.sqrt(5.0 / 6.0) * asked / np.sqrt(asked**2 + np.pi**2)
    assert restitution_of_damping(1.5, ratios) == pytest.approx(list(CLIPPED.values()), abs=2e-4)
    found = [damping_ratio(e, 1.5) / np.sqrt(5.0 / 6.0) for e in RESTITUTIONS]
    assert found == pytest.approx(BETAS, rel=2e-3, abs=1e-4)


@pytest.mark.parametrize("normal", ["hertz", "linear"])
@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("partner", ["grain", "floor"])
def test_restitution_out_is_restitution_in(make_world, normal, precision, partner):
    """At the automatic time step, to +-0.005, at whatever phase of a step the touch comes."""
    numbers = {"stiffness": STIFFNESS, "shear_stiffness": STIFFNESS}
    contact = LINEAR if normal == "linear" else {}
    out = [
        rebound(make_world, partner, 1.0, restitution=e, numbers=numbers, contact=contact, precision=precision)
        for e in RESTITUTIONS
    ]
    assert out == pytest.approx(RESTITUTIONS, abs=5e-3)


def test_restitution_does_not_depend_on_speed_nor_on_the_phase_of_the_touch(make_world):
    for contact in ({}, LINEAR):
        numbers = {"stiffness": STIFFNESS, "shear_stiffness": STIFFNESS}
        speeds = [1.0, 1.01, 1.02, 1.03, 0.1, 0.03]
        out = [rebound(make_world, "grain", v, restitution=0.3, numbers=numbers, contact=contact) for v in speeds]
        assert out == pytest.approx([0.3] * len(speeds), abs=5e-3)


@pytest.mark.parametrize("normal", ["hertz", "linear"])
@pytest.mark.parametrize("precision", ["double", "single"])
def test_restitution_of_what_starts_touching(make_world, normal, precision):
    """Rounding puts such grains a little apart or a little into one another, and it must not matter which."""
    numbers = {"stiffness": STIFFNESS, "shear_stiffness": STIFFNESS}
    contact = LINEAR if normal == "linear" else {}
    out = [
        rebound(make_world, partner, speed, radius, 0.0, restitution=0.3, numbers=numbers, contact=contact, precision=precision)
        for partner in ("grain", "floor")
        for radius in (0.005, 0.0031)
        for speed in (1.0, 0.3)
    ]
    assert out == pytest.approx([0.3] * len(out), abs=5e-3)


@pytest.mark.parametrize("restitution", [1.0, 0.8])
def test_linear_contact_time(make_world, restitution):
    """``t_c = pi / sqrt(k/m* - (g/2m*)^2)`` without damping; with it, a contact that never pulls ends when its force is zero.

    For the clipped law, ``m* x'' = -k x - g x'`` until the force is zero: at ``t = (pi - atan(2 w c / (w^2 - c^2))) / w`` with
    ``c = g/2m*`` and ``w = sqrt(k/m* - c^2)``.
    """
    speed, mass = 0.5, MASS / 2.0
    steps = 400
    undamped = np.sqrt(STIFFNESS / mass)
    decay = undamped * damping_of_linear(restitution)
    damped = np.sqrt(undamped**2 - decay**2)
    expected = (np.pi - np.arctan2(2.0 * damped * decay, damped**2 - decay**2)) / damped
    dt = np.pi / undamped / steps
    world = make_world(
        [[0.0, 0.0, 0.0], [2.0 * RADIUS, 0.0, 0.0]],
        RADIUS,
        velocity=[[speed, 0.0, 0.0], [-speed, 0.0, 0.0]],
        numbers={"stiffness": STIFFNESS, "shear_stiffness": STIFFNESS},
        restitution=restitution,
        friction=0.0,
        contact=LINEAR,
        time_step=dt,
        threads=1,
    )
    history = record(world, steps + 20)
    force = np.abs(np.diff(history["velocity"][:, 0, 0]))
    ended = history["time"][:-1][force > 1e-6 * force.max()][-1]
    assert ended == pytest.approx(expected, abs=2.0 * dt)
    assert abs(history["velocity"][-1, 0, 0]) / speed == pytest.approx(restitution, abs=5e-3)


def damping_of_linear(restitution):
    """Damping ratio of the clipped linear law, from ``e = exp(-z/sqrt(1-z^2) (pi - atan(2 z sqrt(1-z^2) / (1 - 2 z^2))))``."""
    low, high = 0.0, 0.99
    for _ in range(60):
        z = 0.5 * (low + high)
        root = np.sqrt(1.0 - z * z)
        e = np.exp(-z / root * (np.pi - np.arctan2(2.0 * z * root, 1.0 - 2.0 * z * z)))
        low, high = (z, high) if e > restitution else (low, z)
    return z


@pytest.mark.parametrize("partner", ["grain", "floor"])
def test_viscoelastic_restitution_falls_with_speed(make_world, partner):
    """Against ``e = 1 - C1 b + C2 b^2``, ``b = 3/2 A (k/m*)^(2/5) v^(1/5)``, for weak damping, and an integration with
    fine steps for strong damping.

    Source: Schwager & Poeschel 1998, https://doi.org/10.1103/PhysRevE.57.650.
    """
    mass, radius, speed = (MASS / 2.0, RADIUS / 2.0, 2.0) if partner == "grain" else (MASS, RADIUS, 1.0)
    young = YOUNG / (1.0 - POISSON**2) / (2.0 if partner == "grain" else 1.0)
    stiffness = 4.0 / 3.0 * young * np.sqrt(radius) / mass
    common = {"contact": {"normal": "viscoelastic", "tangential": "none"}}
    for slowness in (1.0, 10.0):
        b = 1.5 * 2e-5 * stiffness**0.4 * (speed / slowness) ** 0.2
        weak = rebound(make_world, partner, 1.0 / slowness, numbers={"viscous_time": 2e-5}, **common)
        assert weak == pytest.approx(1.0 - 1.15344 * b + 0.79826 * b**2, abs=2e-3)
        strong = rebound(make_world, partner, 1.0 / slowness, numbers={"viscous_time": 2e-4}, **common)
        assert strong == pytest.approx(viscoelastic_rebound(stiffness, 2e-4, speed / slowness), abs=5e-3)


def viscoelastic_rebound(stiffness, viscous_time, speed, steps=4000):
    """Restitution of ``x'' = -max(0, k (x^(3/2) + 3/2 A sqrt(x) x'))`` by the classical Runge-Kutta method."""

    def rate(state):
        x, u = max(state[0], 0.0), state[1]
        return np.array([u, -max(stiffness * (x**1.5 + 1.5 * viscous_time * np.sqrt(x) * u), 0.0)])

    dt, state = 10.0 / (stiffness**0.4 * speed**0.2) / steps, np.array([0.0, speed])
    for _ in range(steps):
        a = rate(state)
        b = rate(state + 0.5 * dt * a)
        c = rate(state + 0.5 * dt * b)
        d = rate(state + dt * c)
        state = state + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return -state[1] / speed
