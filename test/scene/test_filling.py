"""How grains get into a scene."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from scenes import SceneMaker, floor, write_small_scene

from sand_sim import SceneError, World, read_scene
from sand_sim.scene.fields import Field
from sand_sim.scene.filling import fill_grains
from sand_sim.scene.reading_fills import read_fill
from sand_sim.scene.types import Fill, Material, SizeDistribution
from sand_sim.scene.walls import Wall

SAND = Material("sand", 2600.0, 1e7, 0.25)


def fill(**further):
    given = {"size": SizeDistribution("constant", mean=0.005), "low": (0.0, 0.0, 0.0), "high": (0.2, 0.1, 0.1)}
    return Fill("bed", "sand", **(given | further))


def nearest(position):
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    return distance[~np.eye(len(position), dtype=bool)].min()


def test_count_and_region_are_kept():
    table = fill_grains(fill(count=500), SAND, 0, [])
    assert len(table) == 500
    assert np.all(table.position >= 0.005 - 1e-12)
    assert np.all(table.position <= np.array([0.195, 0.095, 0.095]) + 1e-12)
    assert nearest(table.position) > 0.01 * (1.0 - 1e-9)


def test_seed_decides():
    tables = [fill_grains(fill(count=100, seed=seed), SAND, 0, []) for seed in (1, 1, 2)]
    assert np.array_equal(tables[0].position, tables[1].position)
    assert not np.array_equal(tables[0].position, tables[2].position)


@pytest.mark.parametrize(
    ("size", "low", "high", "mean"),
    [
        (SizeDistribution("uniform", low=0.003, high=0.005), 0.003, 0.005, 0.004),
        (SizeDistribution("normal", mean=0.004, deviation=0.0004, low=0.0035, high=0.0045), 0.0035, 0.0045, 0.004),
        (SizeDistribution("table", radii=(0.003, 0.005), weights=(3.0, 1.0)), 0.003, 0.005, 0.0035),
    ],
)
def test_sizes_follow_their_distribution(size, low, high, mean):
    radius = fill_grains(fill(size=size, count=1000, high=(0.2, 0.2, 0.2)), SAND, 0, []).radius
    assert low <= radius.min() < radius.max() <= high
    assert radius.mean() == pytest.approx(mean, rel=0.02)


def test_a_table_by_mass_is_what_sieves_leave():
    """A third of the mass in fine grains of half the radius: there are four of them for each coarse one."""
    table = {"radii": [0.002, 0.004], "weights": [1.0, 2.0], "by": "mass"}
    region = {"low": [0, 0, 0], "high": [0.2, 0.2, 0.2]}
    entry = {"material": "sand", "radius": {"table": table}, "region": region, "count": 5000}
    radius = fill_grains(read_fill(Field(entry, "fills[0]"), Path.cwd()), SAND, 0, []).radius
    assert np.sum(radius[radius < 0.003] ** 3) / np.sum(radius**3) == pytest.approx(1.0 / 3.0, abs=0.02)
    with pytest.raises(SceneError, match=r"table.by: unknown 'volume'; known are number, mass"):
        read_fill(Field(entry | {"radius": {"table": table | {"by": "volume"}}}, "fills[0]"), Path.cwd())


def test_a_normal_distribution_is_cut_where_it_is_said_to_be():
    """Above the mean: half of it is left, ``s sqrt(2/pi)`` below the mean on the mean, with a deviation ``s sqrt(1 - 2/pi)``."""
    size = SizeDistribution("normal", mean=0.004, deviation=0.0003, low=0.001, high=0.004)
    radius = fill_grains(fill(size=size, count=4000, high=(0.2, 0.2, 0.2)), SAND, 0, []).radius
    assert radius.max() <= 0.004
    assert radius.mean() == pytest.approx(0.004 - 0.0003 * np.sqrt(2.0 / np.pi), abs=0.0003 * 0.04)
    assert radius.std() == pytest.approx(0.0003 * np.sqrt(1.0 - 2.0 / np.pi), rel=0.05)


def test_grains_keep_clear_of_what_has_a_box():
    """A ball that fills its box: places beside that are measured, too."""
    centre, radius = np.array([0.1, 0.05, 0.05]), 0.02

    def distance(points):
        return np.linalg.norm(points - centre, axis=1) - radius

    ball = SimpleNamespace(label="tool 'ball'", box=(centre - radius, centre + radius), distance=distance)
    table = fill_grains(fill(count=600), SAND, 0, [ball])
    assert distance(table.position).min() >= 0.005 * (1.0 - 1e-6)
    assert distance(table.position).min() < 0.01


def test_grains_keep_clear_of_walls():
    cylinder = Wall("cylinder", "pipe", "steel", np.array([0.1, 0.05, 0.0]), np.array([0.0, 0.0, 1.0]), 0.045)
    table = fill_grains(fill(count=100), SAND, 0, [cylinder])
    assert np.all(cylinder.distance(table.position) >= 0.005 * (1.0 - 1e-6))


def test_fine_grains_among_coarse_ones_share_their_places():
    """64 of a quarter of the size go where one of the largest does, mixed with them from the start, and none overlaps."""
    pipe = Wall("cylinder", "pipe", "steel", np.array([0.1, 0.1, 0.0]), np.array([0.0, 0.0, 1.0]), 0.1)
    size = SizeDistribution("table", radii=(0.00125, 0.0025, 0.005), weights=(8.0, 1.0, 1.0))
    wide = {"size": size, "high": (0.2, 0.2, 0.12)}
    table = fill_grains(fill(count=3000, **wide), SAND, 0, [pipe])
    numbers = [np.count_nonzero(table.radius == radius) for radius in size.radii]
    assert np.array(numbers) == pytest.approx([2400, 300, 300], abs=80)
    gap = np.linalg.norm(table.position[:, None] - table.position[None], axis=2) - table.radius[:, None] - table.radius
    assert gap[~np.eye(3000, dtype=bool)].min() >= -1e-9
    assert np.all(pipe.distance(table.position) >= table.radius * (1.0 - 1e-6))
    assert np.all(np.abs(table.position - [0.1, 0.1, 0.06]) <= np.array([0.1, 0.1, 0.06]) - table.radius[:, None] + 1e-12)
    coarse, place = table.radius > 0.004, table.position
    assert place[coarse].mean(axis=0) == pytest.approx(place[~coarse].mean(axis=0), abs=0.01)
    assert place[:, 2].max() < 0.03  # some 380 places of 10.6 mm, 250 in a layer; 3000 would reach 0.12
    with pytest.raises(SceneError, match=r"has room for \d{5} loosely packed grains but 10000000000000 are wanted"):
        fill_grains(fill(count=10**13, **wide), SAND, 0, [pipe])


def test_fine_grains_that_share_a_place_keep_clear_of_a_slanted_wall():
    """Corners of a place may reach into it though the place itself is clear."""
    size = SizeDistribution("table", radii=(0.00125, 0.0025, 0.005), weights=(30.0, 8.0, 1.0))
    wall = Wall("plane", "slope", "steel", np.array([0.1, 0.05, 0.0]), np.array([1.0, 1.3, 0.4]) / np.sqrt(2.85))
    table = fill_grains(fill(size=size, count=6000), SAND, 0, [wall])
    for radius in size.radii:
        nearest = wall.distance(table.position[table.radius == radius]).min()
        assert radius * (1.0 - 1e-6) < nearest < 2.0 * radius


@pytest.mark.parametrize(
    ("walls", "share"), [([], 1.0), (["lid"], 1.0), (["pipe"], 0.25 * np.pi), (["pipe", "half"], 0.125 * np.pi)]
)
def test_a_fill_by_height_has_as_many_grains_as_settle_in_what_the_walls_leave(walls, share):
    """0.61 of the volume up to the height is solid; planes that all of that lies before do not count."""
    axis, point = np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.2, 0.05])
    known = {
        "pipe": Wall("cylinder", "pipe", "steel", point, axis, 0.1),
        "half": Wall("plane", "half", "steel", point, np.array([0.6, 0.8, 0.0])),
        "lid": Wall("plane", "lid", "steel", np.array([0.0, 0.0, 0.25]), -axis),
    }
    floor_below = Wall("plane", "floor", "steel", np.array([0.0, 0.0, 0.04]), axis)
    low, high = 0.003, 0.005
    size, region = SizeDistribution("uniform", low=low, high=high), {"low": (0.0, 0.1, 0.05), "high": (0.2, 0.3, 0.3)}
    bed = fill(size=size, height=0.06, **region)
    table = fill_grains(bed, SAND, 0, [floor_below, *(known[name] for name in walls)])
    grain = 4.0 / 3.0 * np.pi * (high**4 - low**4) / (4.0 * (high - low))
    assert len(table) == pytest.approx(0.61 * share * 0.2 * 0.2 * 0.06 / grain, rel=0.02)


@pytest.mark.parametrize("away", [0.0, 1e4])
def test_no_place_is_lost_where_the_region_ends_at_walls(away):
    """Ten places on each side, 1.06 diameters apart, of which jitter moves every other one towards a wall."""
    low, side = np.full(3, away), 0.01 + 9.0 * 0.0106
    faces = [(low, 1.0), (low + side, -1.0)]
    walls = [Wall("plane", "face", "steel", point, sign * axis) for point, sign in faces for axis in np.eye(3)]
    table = fill_grains(fill(count=1000, low=tuple(low), high=tuple(low + side + 1e-9)), SAND, 0, walls)
    distance = np.min([wall.distance(table.position) for wall in walls], axis=0)
    assert len(table) == 1000
    assert distance.min() == pytest.approx(0.005, rel=1e-6)


@pytest.mark.parametrize("radius", [1e-6, 1e-29])
def test_grains_too_fine_for_their_region_are_refused(radius):
    """Real sand in a box of some decimetres ended with an error of memory, or without one."""
    with pytest.raises(SceneError, match=r"'bed' has a region with places for .* grains of 1e-.* m, .*'radius' larger"):
        fill_grains(fill(size=SizeDistribution("constant", mean=radius), height=0.05), SAND, 0, [])


def test_too_many_grains_are_refused():
    with pytest.raises(SceneError, match=r"'bed' has room for \d+ loosely packed grains but 100000 are wanted"):
        fill_grains(fill(count=100_000), SAND, 0, [])


def test_a_region_as_high_as_is_told_has_room_for_the_bed():
    bed = fill(size=SizeDistribution("constant", mean=0.005), low=(0.0, 0.0, 0.0), high=(0.1, 0.1, 0.1), height=0.08)
    with pytest.raises(SceneError, match=r"enlarge 'region', about [\d.]+ times as high, or ask for fewer") as refused:
        fill_grains(bed, SAND, 0, [])
    times = float(re.search(r"about ([\d.]+) times", str(refused.value)).group(1))
    assert times < 5.0
    assert len(fill_grains(replace(bed, high=(0.1, 0.1, 0.1 * times)), SAND, 0, []))


def test_what_takes_the_room_of_the_grains_is_named(tmp_path):
    """Mostly it is a tool or its particles in another unit."""
    scene = yaml.safe_load(write_small_scene(tmp_path).read_text())
    scene["fills"] = [{"material": "sand", "radius": 0.005, "region": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.1]}, "count": 50}]
    scene["tools"]["plate"]["particle_radius"] = 3
    with pytest.raises(SceneError, match=r"room for 0 loosely packed .* wanted; tool 'plate' takes 729 of its 729 places"):
        World(read_scene(scene, tmp_path))


@pytest.mark.parametrize("width", [0.1, 0.06])
def test_a_region_behind_a_side_of_a_second_box_is_told_so(tmp_path, width):
    """Its sides go on for ever; also where others of them take a part of the places first."""
    boxes = [
        {"name": name, "type": "box", "material": "steel", "low": [x, y, 0.0], "high": [x + 0.1, y + wide, 0.1], "open": ["top"]}
        for name, x, y, wide in (("one", 0.0, 0.0, 0.1), ("two", 0.11, 0.05 - 0.5 * width, width))
    ]
    fills = [{"material": "sand", "radius": 0.005, "region": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.1]}, "count": 50}]
    scene = yaml.safe_load(write_small_scene(tmp_path, boundaries=boxes, fills=fills, tools={}).read_text())
    with pytest.raises(SceneError, match=r"'two/back' takes 729 of its 729 places; .*'region' lies behind it: .* of a 'bin'"):
        World(read_scene(scene, tmp_path))


def settled(tmp_path, fills, boundaries, friction=0.5):
    maker = SceneMaker(tmp_path)
    scene = maker.scene(
        [[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -9.81], precision="single", restitution=0.3, friction=friction
    )
    scene |= {"fills": fills, "boundaries": boundaries, "settle": {"time": 0.6, "speed": 0.02}}
    return World(read_scene(scene, tmp_path))


def test_bed_filled_by_height_has_that_height(tmp_path):
    region = {"low": [0.0, 0.0, 0.0], "high": [0.12, 0.12, 0.2]}
    bed = {"material": "grain", "radius": {"uniform": [0.0045, 0.0055]}, "region": region, "height": 0.05}
    box = {"type": "box", "material": "wall", "open": ["top"]} | region
    world = settled(tmp_path, [bed], [box])
    grains = world.observe().grains
    top = grains.position[:, 2] + grains.radius
    assert top.max() <= 0.05 + 1e-9
    columns = np.floor(grains.position[:, :2] / 0.03).astype(int)
    surface = [top[(columns == cell).all(axis=1)].max() for cell in np.unique(columns, axis=0)]
    assert min(surface) > 0.05 - 0.012
    assert world.time == 0.0
    assert world.observe().health.retired == 0


@pytest.mark.parametrize("gravity", [[0.0, 0.0, 9.81], [9.81, 0.0, 0.0]])
def test_a_height_across_gravity_is_refused(tmp_path, gravity):
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005, gravity=gravity)
    region = {"low": [0.0, 0.0, 0.0], "high": [0.1, 0.1, 0.1]}
    scene["fills"] = [{"material": "grain", "radius": 0.005, "region": region, "height": 0.05}]
    with pytest.raises(SceneError, match="give a 'count' instead"):
        read_scene(scene, tmp_path)


def test_fills_keep_clear_of_those_before_them(tmp_path):
    first = fill_grains(fill(count=300), SAND, 0, [])
    second = fill_grains(fill(count=300, seed=1), SAND, 0, [], [("bed", first)])
    assert nearest(np.concatenate([first.position, second.position])) > 0.01 * (1.0 - 1e-9)
    with pytest.raises(SceneError, match="fill 'bed' takes"):
        fill_grains(fill(count=800, seed=1), SAND, 0, [], [("bed", fill_grains(fill(count=1000), SAND, 0, []))])


def test_a_bed_that_falls_short_of_its_height_is_told(tmp_path):
    """Without walls it spreads."""
    bed = {"name": "bed", "material": "grain", "radius": 0.005, "region": {"low": [0, 0, 0], "high": [0.05, 0.05, 0.3]}}
    assert settled(tmp_path, [bed | {"count": 30}], floor()).warnings == []
    told = settled(tmp_path, [bed | {"height": 0.1}], floor()).warnings[-1]
    assert re.fullmatch(r"fills: 'bed' is only 0\.0\d+ m high, not 0.1 m; its grains pack densely or spread", told)


def test_falling_grains_are_not_taken_for_resting_ones(tmp_path):
    """One grain, 0.1 m up, which is as slow as asked for the first 10 ms."""
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.1]], 0.004, gravity=[0.0, 0.0, -9.81], restitution=0.3)
    scene |= {"boundaries": floor(), "settle": {"time": 1.0, "speed": 0.1}}
    grains = World(read_scene(scene, tmp_path)).observe().grains
    assert grains.position[0, 2] == pytest.approx(0.004, rel=0.02)


def test_a_settled_bed_of_clumps_goes_into_another_scene(tmp_path):
    """As docs/python.md says: radii are those of spheres of the same volume."""
    region = {"low": [0.0, 0.0, 0.0], "high": [0.06, 0.06, 0.1]}
    box = {"type": "box", "material": "wall", "open": ["top"]} | region
    bed = {"material": "grain", "shape": "tetrahedron", "radius": 0.005, "region": region, "count": 60}
    before = settled(tmp_path, [bed], [box]).observe()
    radius = np.cbrt(0.75 * before.grains.mass / (np.pi * 2500.0))
    columns = {"position": before.grains.position, "orientation": before.grains.orientation}
    np.savez(tmp_path / "bed.npz", radius=radius, **columns)
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -9.81], precision="single")
    scene |= {"fills": [{"material": "grain", "shape": "tetrahedron", "file": "bed.npz"}], "boundaries": [box]}
    after = World(read_scene(scene, tmp_path)).observe()
    assert after.grains.mass == pytest.approx(before.grains.mass, rel=1e-6)
    assert after.spheres.position == pytest.approx(before.spheres.position, abs=1e-5 * 0.005)


def test_two_materials_lie_together(tmp_path):
    """Grains of two materials and densities; both are listed and weigh what they should."""
    region = {"low": [0.0, 0.0, 0.0], "high": [0.06, 0.06, 0.1]}
    fills = [
        {"material": "grain", "radius": 0.005, "region": region | {"high": [0.06, 0.06, 0.05]}, "count": 40},
        {"material": "wall", "radius": 0.004, "region": region | {"low": [0.0, 0.0, 0.05]}, "count": 30},
    ]
    scene = SceneMaker(tmp_path).scene([[0.0, 0.0, 0.0]], 0.005, gravity=[0.0, 0.0, -9.81], precision="single")
    scene["materials"]["wall"] = {"density": 7800.0, "young": 5e7, "poisson": 0.3}
    scene["pairs"].append({"between": ["wall", "wall"], "restitution": 0.3, "friction": 0.2})
    scene |= {"fills": fills, "boundaries": [{"type": "box", "name": "box", "material": "wall", "open": ["top"]} | region]}
    world = World(read_scene(scene, tmp_path))
    world.step(round(0.8 / world.time_step))
    observation = world.observe()
    mass = 40 * 2500.0 * 4 / 3 * np.pi * 0.005**3 + 30 * 7800.0 * 4 / 3 * np.pi * 0.004**3
    assert observation.grains.mass.sum() == pytest.approx(mass, rel=1e-5)
    force = -sum(wall.force for wall in observation.walls)
    assert force[2] == pytest.approx(mass * 9.81, rel=0.02)
    assert observation.health.retired == 0


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_positions_come_from_files(tmp_path, kind):
    position, radius = np.array([[0.01, 0.02, 0.03], [0.05, 0.02, 0.03]]), np.array([0.004, 0.005])
    velocity = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
    path = tmp_path / f"grains.{kind}"
    if kind == "npz":
        np.savez(path, position=position, radius=radius, velocity=velocity)
    else:
        rows = np.column_stack([position, radius, velocity])
        np.savetxt(path, rows, delimiter=",", header="x,y,z,radius,vx,vy,vz", comments="")
    table = fill_grains(Fill("bed", "sand", file=path), SAND, 0, [])
    assert table.position == pytest.approx(position)
    assert table.radius == pytest.approx(radius)
    assert table.velocity == pytest.approx(velocity)


@pytest.mark.parametrize(
    ("columns", "named"),
    [
        ({"radius": np.ones(2)}, "has no 'position'"),
        ({"position": np.ones((2, 2)), "radius": np.ones(2)}, "must have shape (n, 3)"),
        ({"position": np.full((2, 3), np.nan), "radius": np.ones(2)}, "'position' has values that are not finite"),
        ({"position": np.ones((2, 3)), "radius": -np.ones(2)}, "'radius' must be positive"),
        ({"position": np.ones((2, 3)), "radius": np.ones(3)}, "'radius' must have shape (2,)"),
        ({"position": np.ones((2, 3)), "radius": np.ones(2), "velocity": np.ones((3, 3))}, "'velocity' must have shape (2, 3)"),
        ({"position": np.ones((2, 3)), "radius": ["1", "wide"]}, "could not convert string to float"),
        (
            {"position": np.ones((2, 3)), "radius": np.ones(2), "velocities": np.ones((2, 3))},
            "unknown column 'velocities'; known are position, radius, velocity, spin, orientation; rename it or leave it out",
        ),
    ],
)
def test_bad_position_files_are_refused(tmp_path, columns, named):
    np.savez(tmp_path / "grains.npz", **columns)
    with pytest.raises(SceneError) as caught:
        fill_grains(Fill("bed", "sand", file=tmp_path / "grains.npz"), SAND, 0, [])
    assert named in str(caught.value)
    assert "grains.npz" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("grains.npz", "text"),
        ("grains.npz", "PK\x03\x04 and cut off"),
        ("grains.csv", "x,y,z,radius\n1,2,three,4\n"),
        ("grains.csv", "x,y,z,radius\n1,2,3\n"),
        ("none.csv", None),
    ],
)
def test_unreadable_position_files_are_refused(tmp_path, name, content):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(SceneError, match=name):
        fill_grains(Fill("bed", "sand", file=tmp_path / name), SAND, 0, [])


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("x,y,z,radius,vx,vz\n0,0,0,0.005,1,2\n", "it lacks vy"),
        ("x,y,z,radius,vx,vy,Vz\n0,0,0,0.005,1,2,3\n", "unknown column 'Vz'"),
        ("x,y,z,radius\n0,0,0,0.005,1\n", "unknown column ''"),
        ("x,y,z,radius\n", "no line below the first, which names the columns: x, y, z, radius"),
        ("0,0,0,0.005\n", "no line below the first, which names the columns: x, y, z, radius"),
        ("0.1,-0.2,0,0.005\n0,0,0,0.005\n", "the first line, with 0.1 in it, must name the columns; known are x, y, z, radius"),
    ],
)
def test_columns_that_would_be_left_out_are_refused(tmp_path, content, named):
    """Grains would start at rest instead."""
    (tmp_path / "grains.csv").write_text(content)
    with pytest.raises(SceneError, match=rf"grains\.csv.* {named}"):
        fill_grains(Fill("bed", "sand", file=tmp_path / "grains.csv"), SAND, 0, [])


def test_a_bed_lies_in_the_ring_between_two_cylinders(tmp_path):
    """As high as asked, in the ring only, and the floor below smooth walls bears its weight."""
    inner, outer, height, size = 0.03, 0.075, 0.04, 0.005
    upright = {"type": "cylinder", "material": "wall", "point": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0]}
    pillar = upright | {"name": "pillar", "radius": inner, "height": 0.3, "grains": "outside"}
    region = {"low": [-outer, -outer, 0.0], "high": [outer, outer, 0.25]}
    fills = [{"material": "grain", "radius": size, "region": region, "height": height}]
    walls = [*floor(), pillar, upright | {"name": "pipe", "radius": outer}]
    world = settled(tmp_path, fills, walls, friction=0.0)
    shown = world.observe()
    grains = shown.grains
    away = np.linalg.norm(grains.position[:, :2], axis=1)
    assert away.min() == pytest.approx(inner + size, rel=0.01)
    assert away.max() == pytest.approx(outer - size, rel=0.01)
    assert grains.position[:, 2].max() == pytest.approx(height - size, abs=size)
    solid = len(grains) * 4.0 / 3.0 * size**3 / ((outer**2 - inner**2) * height)
    assert solid == pytest.approx(0.55, abs=0.05)  # the walls leave gaps
    felt = []
    for _ in range(50):  # what was struck off a moment ago lets the bed swing
        world.step(round(0.01 / world.time_step))
        felt.append(-world.observe().wall("floor").force[2])
    assert np.mean(felt[25:]) == pytest.approx(9.81 * grains.mass.sum(), rel=5e-3)
