"""Neighbour lists against brute force, their growth, and grains that leave."""

import numpy as np
import pytest
from scenes import SceneMaker, floor

from sand_sim import World, read_scene
from sand_sim.engine.chunks import CHUNK


def cloud(number, radius, edge, seed):
    """Grains strewn at random, overlapping as it comes."""
    random = np.random.default_rng(seed)
    return random.uniform(0.0, edge, (number, 3)), radius(random, number)


SIZES = {
    "one size": lambda random, n: np.full(n, 0.003),
    "two sizes": lambda random, n: random.choice([0.002, 0.005], n),
    "ratio of twenty": lambda random, n: np.where(random.random(n) < 0.02, 0.02, random.uniform(0.001, 0.003, n)),
}


def listed_pairs(world):
    """Pairs on the list by identity, and how often the whole list names a pair twice."""
    arrays = world.assembly.solver.arrays
    number = arrays.pair_list.pairs.get()
    identity = arrays.grains.identity.numpy()
    pairs = identity[np.column_stack([arrays.pair_list.owner.numpy()[:number], arrays.pair_list.partner.numpy()[:number]])]
    return np.unique(np.sort(pairs, axis=1), axis=0), number


@pytest.mark.parametrize("sizes", SIZES)
@pytest.mark.parametrize("threads", [1, 2])
def test_every_pair_within_reach_is_listed_once(make_world, sizes, threads):
    position, radius = cloud(700, SIZES[sizes], 0.08, seed=1)
    world = make_world(position, radius, skin=1e-3, precision="single", threads=threads, contact={"tangential": "none"})
    found, number = listed_pairs(world)
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    reach = radius[:, None] + radius[None] + 1e-3
    a, b = np.nonzero(np.triu(distance < reach - 1e-8, k=1))
    possible = np.triu(distance < reach + 1e-8, k=1)
    assert len(found) == number
    assert {tuple(pair) for pair in np.column_stack([a, b])} <= {tuple(pair) for pair in found}
    assert possible[found[:, 0], found[:, 1]].all()


def test_bridges_reach_as_far_as_the_smaller_grain_holds_them(make_world):
    """Small wet grains listed all that the bridges of the largest would reach: ten times smaller, forty times as many as dry."""
    position, radius = cloud(700, SIZES["ratio of twenty"], 0.08, seed=1)
    contact, liquid = {"tangential": "none", "cohesion": "capillary"}, {"bridge_volume": 0.1}
    world = make_world(position, radius, skin=1e-3, precision="single", contact=contact, liquid=liquid)
    found, number = listed_pairs(world)
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    touch, rupture = radius[:, None] + radius[None] + 1e-3, 0.1 ** (1.0 / 3.0) * np.minimum(radius[:, None], radius[None])
    needed = np.argwhere(np.triu(distance < touch + rupture - 1e-8, k=1))
    allowed = np.triu(distance < touch + 2.0 * rupture + 1e-8, k=1)  # sizes are told apart by factors of two
    assert len(found) == number
    assert {tuple(pair) for pair in needed} <= {tuple(pair) for pair in found}
    assert allowed[found[:, 0], found[:, 1]].all()


@pytest.mark.parametrize("number", [CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK])
def test_all_of_a_few_are_listed(make_world, number):
    """As many grains as are looked at at once, fewer and more, all within reach of each other."""
    position, radius = cloud(number, SIZES["one size"], 0.003, seed=7)
    world = make_world(position, radius, skin=1e-3, precision="single", contact={"tangential": "none"})
    assert [len(listed_pairs(world)[0]), listed_pairs(world)[1]] == [number * (number - 1) // 2] * 2


def test_lists_grow_and_nothing_is_dropped(make_world):
    """Far more contacts than the first room: the list is enlarged and complete."""
    position, radius = cloud(400, SIZES["one size"], 0.012, seed=2)
    world = make_world(position, radius, skin=5e-4, precision="single", contact={"tangential": "none"})
    arrays = world.assembly.solver.arrays
    found, number = listed_pairs(world)
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    assert number > 5 * len(position)
    assert arrays.pair_list.pairs.capacity >= number
    assert abs(len(found) - np.triu(distance < 0.0065, k=1).sum()) <= 1


def test_history_survives_renumbering(make_world):
    """A loaded contact keeps its spring when other grains force a new search and a new numbering."""
    position = np.array([[0.0, 0.0, 0.005], [0.0, 0.0, 0.0148], [0.03, 0.0, 0.005], [0.05, 0.0, 0.005]])
    velocity = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, -0.05], [0.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    found = []
    for skin in (1e-4, 5e-2):  # many searches, and one
        world = make_world(position, 0.005, velocity=velocity, skin=skin, time_step=2e-5, friction=0.9, restitution=0.4)
        world.step(450)
        found.append(world.observe().grains)
    assert np.abs(found[0].spin).max() > 1.0
    assert np.abs(found[0].position - found[1].position).max() < 1e-12
    assert np.abs(found[0].spin - found[1].spin).max() < 1e-8


def test_history_survives_that_two_grains_swap_places_in_the_list(make_world):
    """Two stuck grains turn about each other on loaded springs; now the one, now the other is first in the order of the cells."""
    speed = 0.25
    position = np.array([[-0.00499, 0.0, 0.0], [0.00499, 0.0, 0.0], [-0.03, -0.03, -0.03]])  # the third holds the cells still
    velocity, spin = [[0.0, -speed, 0.0], [0.0, speed, 0.0], [0.0] * 3], [[20.0, 0.0, 5.0], [-20.0, 30.0, 0.0], [0.0] * 3]
    contact = {"tangential": "mindlin_rescaled", "rolling": "spring", "twisting": "marshall", "cohesion": "capillary"}
    common = {"velocity": velocity, "spin": spin, "contact": contact, "restitution": 1.0, "time_step": 2e-5}
    common |= {"numbers": {"friction": 0.8, "rolling_friction": 0.3}, "liquid": {"saturation": 0.2, "surface_tension": 2.0}}
    worlds = [make_world(position, 0.005, skin=skin, **common) for skin in (1e-4, 5e-2)]  # many searches, and one
    owners, springs = [], []
    for _ in range(40):
        for world in worlds:
            world.step(250)
        arrays = worlds[0].assembly.solver.arrays
        owners.append(arrays.grains.identity.numpy()[arrays.pair_list.owner.numpy()[0]])
        springs.append(np.abs(arrays.pair_list.memory.numpy()[0]))
        found = [world.observe().grains for world in worlds]
        assert np.abs(found[0].position - found[1].position).max() < 1e-10
        assert np.abs(found[0].spin - found[1].spin).max() < 1e-6
    assert np.count_nonzero(np.diff(owners)) >= 2
    assert np.all(np.median(springs, axis=0) > 0.0), "a spring is not loaded"


def test_grains_that_leave_are_counted_and_retired(make_world):
    position, radius = cloud(60, SIZES["two sizes"], 0.2, seed=3)
    velocity = 20.0 * (position - 0.1)
    domain = {"low": [-0.05] * 3, "high": [0.25] * 3}
    world = make_world(position, radius, velocity=velocity, domain=domain, precision="single", contact={"tangential": "none"})
    alive = []
    for _ in range(30):
        world.step(400)
        observation = world.observe()
        alive.append(len(observation.grains))
        assert np.all(np.isfinite(observation.grains.position))
        assert np.all(np.abs(observation.grains.position - 0.1) <= 0.15 + 1e-9)
    assert alive[0] > alive[-1]
    world.step(10)
    observation = world.observe()
    assert observation.health.retired == 60 - len(observation.grains)
    assert np.array_equal(np.unique(observation.grains.identity), observation.grains.identity)


def test_grains_that_fall_out_take_their_energy_along(make_world):
    """Height, motion and spin are those of the same moment; one step apart they would differ by ``m g v dt``."""
    domain, spin = {"low": [-0.05] * 3, "high": [0.05] * 3}, [30.0, 0.0, 50.0]
    world = make_world([[0.0, 0.0, 0.0]], 0.002, spin=spin, gravity=[0.0, 0.0, -9.81], domain=domain, precision="double")
    world.step(round(0.15 / world.time_step))
    health = world.observe().health
    assert health.retired == 1
    step = 2500.0 * 4.0 / 3.0 * np.pi * 0.002**3 * 9.81 * np.sqrt(2.0 * 9.81 * 0.05) * world.time_step
    assert health.dissipated == pytest.approx(0.0, abs=1e-3 * step)


def untouched(world):
    """Pairs that overlap but are not on the list."""
    grains = world.observe().grains
    found = {tuple(pair) for pair in listed_pairs(world)[0]}
    distance = np.linalg.norm(grains.position[:, None] - grains.position[None], axis=2)
    a, b = np.nonzero(np.triu(distance < grains.radius[:, None] + grains.radius[None] - 1e-9, k=1))
    return {tuple(pair) for pair in np.column_stack([grains.identity[a], grains.identity[b]])} - found


def test_skin_follows_the_motion(make_world):
    """It narrows where grains hardly move, widens where they do, and no contact is missed on the way."""
    position, radius = cloud(300, SIZES["one size"], 0.05, seed=4)
    random = np.random.default_rng(5)
    stir = {"gravity": [0.0, 0.0, -9.81], "boundaries": floor(), "time_step": 1e-5, "friction": 0.3}
    still = make_world([[0.0, 0.0, 0.003], [0.1, 0.0, 0.003]], 0.003, **stir | {"boundaries": floor(1e-9)})
    still.step(3000)
    moving = make_world(position, radius, velocity=random.normal(0.0, 1.0, position.shape), **stir)
    for _ in range(20):
        moving.step(40)
        assert untouched(moving) == set()

    assert np.median(allowances(still)) < 0.15
    assert np.median(allowances(moving)) > 0.4
    own = make_world(position, radius, skin=2e-4)
    own.step(50)
    assert allowances(own) == pytest.approx(1.0, abs=1e-3), "a skin of the scene's own stays as it is"


def allowances(world):
    """How far each grain may move until the lists are made anew, over half the widest skin."""
    arrays = world.assembly.solver.arrays
    active = arrays.grains.active.get()
    by_identity = np.argsort(arrays.grains.identity.numpy()[:active])
    return arrays.grains.origin.numpy()[:active, 3][by_identity] / (0.5 * arrays.skin.widest.numpy()[0])


def test_only_grains_that_move_are_allowed_to_go_far(make_world):
    """Two of a hundred pass the others by; these stay on short lists, and what meets is listed in time."""
    corners = np.stack(np.meshgrid(range(10), range(10), [0], indexing="ij"), -1).reshape(-1, 3)
    position = np.concatenate([0.0105 * corners, [[0.0, 0.0, 0.0101], [0.09, 0.05, 0.0101]]])
    velocity = np.zeros_like(position)
    velocity[-2:] = [[0.3, 0.2, -0.05], [-0.4, 0.1, -0.02]]
    world = make_world(position, 0.005, velocity=velocity, time_step=1e-5, precision="single")
    for _ in range(40):
        world.step(25)
        assert untouched(world) == set()
    share = allowances(world)
    moved = np.linalg.norm(world.observe().grains.velocity, axis=1) > 1e-6
    assert 2 <= moved.sum() < 50
    assert share[-2:].min() > 2.0 * np.median(share[~moved])


@pytest.mark.parametrize("shape", ["sphere", "tetrahedron"])
def test_lists_are_made_anew_before_anything_has_gone_farther_than_it_is_allowed(tmp_path, shape):
    """But for the step in which it shows; so what is not on a list cannot have come within reach."""
    maker, random = SceneMaker(tmp_path), np.random.default_rng(7)
    position = 0.012 * np.stack(np.meshgrid(*3 * [range(3)], indexing="ij"), -1).reshape(-1, 3)
    content = maker.scene(position, 0.003, velocity=random.normal(0.0, 0.3, position.shape), precision="single", time_step=1e-5)
    content["fills"][0]["shape"] = shape
    world = World(read_scene(content | {"domain": {"low": [-0.1] * 3, "high": [0.1] * 3}}, tmp_path))
    arrays, quantum, most = world.assembly.solver.arrays, world.assembly.lattice.quantum, []
    for _ in range(150):
        world.step(10)
        place, origin = (array.numpy().astype(float) for array in (arrays.grains.place, arrays.grains.origin))
        speed = np.linalg.norm(arrays.grains.motion.numpy()[:, :3], axis=1)
        far = np.linalg.norm(place[:, :3] - origin[:, :3], axis=1) - origin[:, 3] - 1.01 * speed * world.time_step / quantum
        assert far.max() < 3.0
        most.append(np.max(np.linalg.norm(place[:, :3] - origin[:, :3], axis=1) / origin[:, 3]))
    assert max(most) > 0.9  # none of it for nothing


def test_a_saved_world_goes_on_with_its_skin(make_world):
    position, radius = cloud(200, SIZES["one size"], 0.04, seed=6)
    world = make_world(position, radius, precision="single", time_step=1e-5)
    world.step(37)
    state = world.save()
    world.step(200)
    after = world.observe().grains.position
    world.restore(state)
    world.step(200)
    assert np.array_equal(after, world.observe().grains.position)
