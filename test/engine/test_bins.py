"""Bins: boxes whose sides end at their edges, solid both ways."""

import numpy as np
import pytest
from scenes import record
from walls import DOMAIN, GRAVITY, LINEAR, apart_from_each_other, overlaps

from sand_sim import SceneError, World, read_scene

LOW, HIGH = np.array([-0.02, 0.01, 0.03]), np.array([0.02, 0.04, 0.05])
SIDES = {"left": (1, HIGH), "right": (1, LOW), "front": (0, HIGH), "back": (0, LOW), "bottom": (2, LOW), "top": (2, HIGH)}
OPENED = [("top",), ("top", "front"), ("left", "bottom"), ("top", "front", "back", "left", "right")]


def bin_of(low=LOW, high=HIGH, name="bin", **fields):
    return {
        "type": "bin",
        "name": name,
        "material": "wall",
        "low": list(map(float, low)),
        "high": list(map(float, high)),
    } | fields


def touched(centre, radius, open_sides):
    """Places on the closed sides from which all ways along these sides lead away from a sphere that they are in, shape (n, 3)."""
    nearest = {}
    for name, (axis, corner) in SIDES.items():
        if name not in open_sides:
            nearest[name] = np.clip(centre, LOW, HIGH)
            nearest[name][axis] = corner[axis]
    far = {name: np.linalg.norm(centre - place) for name, place in nearest.items()}
    places = {}
    for name, place in nearest.items():
        on = [other for other in nearest if place[SIDES[other][0]] == SIDES[other][1][SIDES[other][0]]]
        if far[name] < radius and all(far[name] <= far[other] for other in on):
            places[tuple(place)] = place
    return np.reshape(list(places.values()), (-1, 3))


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("open_sides", OPENED, ids=str)
def test_it_pushes_from_each_place_that_is_nearest(make_world, open_sides, precision):
    """From within and outside, over rims, in corners and around them."""
    radius, random, numbers = 0.005, np.random.default_rng(5), set()
    for _ in range(8):
        scattered = random.uniform(LOW - 0.006, HIGH + 0.006, (300, 3))
        position = apart_from_each_other(scattered, 2.01 * radius)
        pushed = overlaps(make_world, [bin_of(open=list(open_sides))], position, radius, precision=precision)
        for found, centre in zip(pushed, position, strict=True):
            away = centre - touched(centre, radius, open_sides)
            far = np.linalg.norm(away, axis=1, keepdims=True)
            assert found == pytest.approx(((radius - far) * away / far).sum(axis=0), abs=2e-6)
            numbers.add(len(far))
    assert numbers >= ({0, 1} if len(open_sides) == 5 else {0, 1, 2})


@pytest.mark.parametrize("corner", [np.array([1.0, 1.0, 0.0]), np.array([1.0, 1.0, -1.0]), np.array([0.0, 1.0, 1.0])], ids=str)
def test_outside_of_a_corner_it_is_touched_once(make_world, corner):
    """Of two or three sides that meet there one answers, also at the end of a rim."""
    middle = 0.5 * (LOW + HIGH) + 0.5 * (HIGH - LOW) * corner
    for turn in (1.0, -1.0):
        direction = corner * [turn, 1.0, 1.0] / np.linalg.norm(corner)
        place = 0.5 * (LOW + HIGH) + (middle - 0.5 * (LOW + HIGH)) * [turn, 1.0, 1.0]
        pushed = overlaps(make_world, [bin_of()], [place + 0.004 * direction], 0.005)
        assert pushed[0] == pytest.approx(0.001 * direction, abs=1e-9)


def test_grain_slides_from_side_to_side_without_kicks(make_world):
    """Along the floor of a bin as over an endless plane, and off its open end into free fall."""
    radius, speed = 0.005, 0.2
    weight = 2500.0 * 4.0 / 3.0 * np.pi * radius**3 * GRAVITY
    dent = weight / LINEAR["numbers"]["stiffness"]
    world = make_world(
        [[-0.014, 0.025, 0.03 + radius - dent]],
        radius,
        velocity=[speed, 0.0, 0.0],
        gravity=[0.0, 0.0, -GRAVITY],
        boundaries=[bin_of(open=["top", "front"])],
        domain=DOMAIN,
        precision="double",
        **LINEAR,
    )
    history = record(world, 60, max(1, round(0.24 / 60 / world.time_step)))
    position, velocity = history["position"][:, 0], history["velocity"][:, 0]
    on_it = position[:, 0] < 0.02
    assert on_it.sum() > 20
    assert velocity[on_it] == pytest.approx(np.broadcast_to([speed, 0.0, 0.0], (on_it.sum(), 3)), abs=1e-6 * speed)
    assert not on_it[-1]
    energy = 0.5 * np.sum(velocity[-1] ** 2) + GRAVITY * position[-1, 2]
    assert energy == pytest.approx(0.5 * speed**2 + GRAVITY * position[0, 2], rel=1e-3)
    assert position[-1, 2] < 0.03 - radius


def heap(**bins):
    """Sand poured into a bin that holds little more than half of it, over a ground."""
    return {
        "materials": {
            "sand": {"density": 2600.0, "young": 5e6, "poisson": 0.25},
            "wall": {"density": 7800.0, "young": 1e9, "poisson": 0.3},
        },
        "pairs": [{"between": pair, "restitution": 0.4, "friction": 0.4} for pair in (["sand", "sand"], ["sand", "wall"])],
        "fills": [
            {
                "material": "sand",
                "radius": 0.002,
                "count": 500,
                "region": {"low": [-0.018, -0.018, 0.021], "high": [0.018, 0.018, 0.09]},
                "seed": 1,
            }
        ],
        "boundaries": [
            {"type": "plane", "material": "wall", "name": "ground", "point": [0, 0, 0], "normal": [0, 0, 1]},
            *(bin_of([-0.02, -0.02, 0.02], [0.02, 0.02, 0.03], **fields, name=name) for name, fields in bins.items()),
        ],
        "domain": {"low": [-0.8, -0.8, -0.01], "high": [0.8, 0.8, 0.2]},
        "duration": 0.5,
    }


def test_sand_runs_over_the_rims_and_lies_inside_and_outside(tmp_path):
    world = World(read_scene(heap(bin={}), tmp_path))
    world.step(round(1.0 / world.time_step))
    seen = world.observe()
    x, y, z = seen.grains.position.T
    inside = (np.abs(x) < 0.02) & (np.abs(y) < 0.02) & (z > 0.02)
    assert seen.health.retired == 0
    full = 0.6 * 0.04 * 0.04 * 0.01 / (4.0 / 3.0 * np.pi * 0.002**3)
    assert full < inside.sum() < 1.6 * full  # with a heap on it
    assert np.count_nonzero(~inside) > 50
    clear = np.minimum(np.minimum(0.02 - np.abs(x), 0.02 - np.abs(y)), z - 0.02)
    assert np.all(clear[inside & (z < 0.03)] > 0.0018)  # none in a wall
    assert np.count_nonzero(z[~inside] > 0.02) < 3  # on the ground, none on a wall that is not there; some may be on their way
    forces = {wall.name: wall.force[2] for wall in seen.walls}
    weight = GRAVITY * seen.grains.mass
    assert forces["bin/bottom"] == pytest.approx(-weight[inside].sum(), rel=0.1)  # the sides bear a little by friction
    assert sum(forces.values()) == pytest.approx(-weight.sum(), rel=0.02)
    assert seen.health.deepest < 0.1


def test_two_bins_side_by_side_share_a_wall(make_world):
    """Each grain stays in its own; with boxes each would lie behind a wall of the other."""
    bins = [bin_of([x, -0.02, 0.0], [x + 0.04, 0.02, 0.03], name=f"bin {x:+.2f}") for x in (-0.04, 0.0)]
    position = [[-0.005, 0.0, 0.006], [0.005, 0.0, 0.006]]
    world = make_world(position, 0.005, boundaries=bins, gravity=[0, 0, -GRAVITY], domain=DOMAIN, threads=1)
    world.step(round(0.2 / world.time_step))
    assert world.observe().grains.position[:, 0] == pytest.approx([-0.005, 0.005], abs=1e-4)


def test_whoever_wants_two_boxes_is_told_of_bins(tmp_path):
    scene = heap(bin={}, other={})
    for boundary, x in zip(scene["boundaries"][1:], (0.0, 0.1), strict=True):
        boundary |= {"type": "box", "open": ["top"], "low": [x - 0.02, -0.02, 0.02], "high": [x + 0.02, 0.02, 0.1]}
    with pytest.raises(SceneError, match=r"wall 'other/back' takes .* a 'box' have no end, those of a 'bin' have"):
        World(read_scene(scene, tmp_path))


def test_what_does_not_fit_is_refused(tmp_path):
    with pytest.raises(SceneError, match=r"boundaries\[1\].*rough"):
        read_scene(heap(bin={"rough": {"radius": 0.001}}), tmp_path)
