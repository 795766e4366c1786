"""Contacts between grains, one by one, against weights, Hertz and Willett."""

import numpy as np
import pytest
from scenes import floor

RADIUS, YOUNG, POISSON, DENSITY = 0.005, 1e7, 0.3, 2650.0
SAND = {"density": DENSITY, "young": YOUNG, "poisson": POISSON}
WEIGHT = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3 * 9.81


@pytest.mark.parametrize("precision", ["double", "single"])
def test_contacts_of_a_stack_carry_what_lies_above(make_world, precision):
    """Five equal spheres at rest: contact k bears the weights above it, with the overlap that Hertz gives for that."""
    number = 5
    height = RADIUS * (2.0 * np.arange(number) + 1.0) * 0.9985
    position = np.column_stack([np.zeros(number), np.zeros(number), height])
    further = {"material": SAND, "restitution": 0.2, "friction": 0.0, "gravity": [0.0, 0.0, -9.81], "boundaries": floor()}
    world = make_world(position, RADIUS, precision=precision, **further)
    world.step(round(0.4 / world.time_step))
    contacts, cloud = world.grain_contacts(), world.observe().grains
    lower = np.minimum(contacts.first, contacts.second)
    order = np.argsort(lower)
    assert lower[order].tolist() == [0, 1, 2, 3]
    assert (np.abs(contacts.first - contacts.second) == 1).all()
    up = np.where(contacts.first > contacts.second, 1.0, -1.0)
    assert contacts.normal == pytest.approx(up[:, None] * [[0.0, 0.0, 1.0]], abs=1e-6)
    borne = WEIGHT * np.arange(number - 1, 0, -1)
    assert (up * contacts.force[:, 2])[order] == pytest.approx(borne, rel=1e-3)
    stiff, round_ = 0.5 * YOUNG / (1.0 - POISSON**2), 0.5 * RADIUS
    assert contacts.overlap[order] == pytest.approx((0.75 * borne / stiff / np.sqrt(round_)) ** (2.0 / 3.0), rel=1e-3)
    middles = 0.5 * (cloud.position[:-1, 2] + cloud.position[1:, 2])
    assert contacts.point[order, 2] == pytest.approx(middles, abs=1e-9)
    assert not contacts.couple.any()


def test_forces_of_a_pile_hold_each_grain_up(make_world):
    """A sphere on three others that lie apart on a rough floor: what they exert is its weight, with friction and resistance."""
    angle = 2.0 * np.pi / 3.0 * np.arange(3)
    apart, height = 1.2 * RADIUS, RADIUS + RADIUS * np.sqrt(4.0 - 1.2**2)
    feet = np.column_stack([apart * np.cos(angle), apart * np.sin(angle), np.full(3, RADIUS)])
    numbers = {"restitution": 0.2, "friction": 0.8, "rolling_friction": 0.3}
    further = {"contact": {"rolling": "spring"}, "gravity": [0.0, 0.0, -9.81], "boundaries": floor()}
    world = make_world([*feet, [0.0, 0.0, height]], RADIUS, material=SAND, numbers=numbers, **further)
    world.step(round(1.0 / world.time_step))
    contacts, cloud = world.grain_contacts(), world.observe().grains
    assert world.observe().health.fastest < 1e-5
    on_top, by_top = contacts.first == 3, contacts.second == 3
    assert (on_top | by_top).sum() == 3
    force = contacts.force[on_top].sum(axis=0) - contacts.force[by_top].sum(axis=0)
    assert force == pytest.approx([0.0, 0.0, WEIGHT], rel=1e-3, abs=1e-3 * WEIGHT)
    lever = contacts.point - cloud.position[3]
    torque = (np.cross(lever, contacts.force) + contacts.couple)[on_top].sum(axis=0)
    torque -= (np.cross(lever, contacts.force) + contacts.couple)[by_top].sum(axis=0)
    assert torque == pytest.approx([0.0, 0.0, 0.0], abs=1e-3 * WEIGHT * RADIUS)
    assert (np.linalg.norm(contacts.couple, axis=1)[on_top | by_top] > 0.0).all()


def test_bridge_across_a_gap_is_a_contact_of_negative_overlap(make_world):
    """Two wet spheres that have touched are drawn apart: F = 2 pi R gamma / (1 + 1.05 S + 2.5 S^2), S = s sqrt(R/V)."""
    radius, tension, share = 0.5e-3, 0.073, 0.01
    further = {"contact": {"cohesion": "capillary"}, "friction": 0.0, "restitution": 0.9, "time_step": 1e-7}
    further |= {"liquid": {"surface_tension": tension, "contact_angle": 0.0, "bridge_volume": share}}
    position = np.array([[-radius + 1e-9, 0.0, 0.0], [radius - 1e-9, 0.0, 0.0]])
    world = make_world(position, radius, velocity=[[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0]], **further)
    world.step(1000)
    contacts, cloud = world.grain_contacts(), world.observe().grains
    gap = float(np.diff(cloud.position[:, 0])[0] - 2.0 * radius)
    assert 1e-5 < gap < share ** (1.0 / 3.0) * radius
    assert contacts.overlap == pytest.approx([-gap], rel=1e-9)
    scaled = gap / np.sqrt(share) / radius
    pull = 2.0 * np.pi * radius * tension / (1.0 + 1.05 * scaled + 2.5 * scaled**2)
    assert np.linalg.norm(contacts.force, axis=1) == pytest.approx([pull], rel=1e-3)
    assert np.einsum("ij,ij->i", contacts.force, contacts.normal)[0] < 0.0  # it pulls
    world.step(4000)
    assert len(world.grain_contacts()) == 0
