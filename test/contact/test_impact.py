"""One contact against closed forms and published numbers (Chung & Ooi 2011, https://doi.org/10.1007/s10035-011-0277-0)."""

import numpy as np
import pytest
from scenes import floor, record

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


def test_error_falls_with_the_square_of_the_step(make_world):
    """Peak overlap by a parabola through the three largest samples, against the exact (15 m* v^2 / (16 E* sqrt(R*)))^0.4."""
    radius, speed, young, poisson, density, *_ = case = HERTZ["T1 glass"]
    mass = density * 4 / 3 * np.pi * radius**3 / 2
    effective = young / (2.0 * (1.0 - poisson**2))
    exact = (15.0 * mass * (2.0 * speed) ** 2 / (16.0 * effective * np.sqrt(radius / 2.0))) ** 0.4
    errors = []
    for steps in (20, 40, 80):
        dt = case[-1] / steps
        position = [[0.0, 0.0, 0.0], [2.0 * radius, 0.0, 0.0]]
        world = make_world(
            position,
            radius,
            velocity=[[speed, 0.0, 0.0], [-speed, 0.0, 0.0]],
            material={"density": density, "young": young, "poisson": poisson},
            restitution=1.0,
            friction=0.0,
            time_step=dt,
        )
        x = record(world, steps)["position"][:, :, 0]
        overlap = 2.0 * radius - (x[:, 1] - x[:, 0])
        k = int(overlap.argmax())
        before, top, after = overlap[k - 1 : k + 2]
        errors.append(abs(top - (after - before) ** 2 / (8.0 * (before - 2.0 * top + after)) - exact) / exact)
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(orders > 1.7), (errors, orders)


@pytest.mark.parametrize("restitution", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
def test_restitution_out_is_restitution_in(make_world, restitution):
    *_, rebound = impact(make_world, HERTZ["T1 limestone"], 50, "single", restitution)
    assert rebound == pytest.approx(restitution, abs=5e-3)
