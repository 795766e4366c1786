"""Terrain: grains roll into valleys and rest there, whatever the file the ground came from."""

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenes import SceneMaker

from sand_sim import SceneError, World, read_scene
from sand_sim.scene.heights import read_heights

GRAVITY, RADIUS, SPACING = 9.81, 0.006, 0.005
ROWS, COLUMNS = 21, 41  # 0.1 m along y, 0.2 m along x


def valley():
    """Heights [m] that fall towards x = 0.1 and, more gently, towards y = 0.05; rows along y, columns along x."""
    y, x = np.mgrid[:ROWS, :COLUMNS] * SPACING
    return 0.03 + 0.25 * np.abs(x - 0.1) + 0.15 * np.abs(y - 0.05)


@pytest.fixture
def make_ground(tmp_path):
    """``make_ground(position, ...)`` builds a world of grains over a terrain called ``ground``."""

    def make(position, terrain, **further):
        entry = {"type": "terrain", "name": "ground", "material": "wall", "particle_radius": 0.003, "spacing": SPACING} | terrain
        entry = {name: value for name, value in entry.items() if value is not None}
        material = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
        further = {"gravity": [0.0, 0.0, -GRAVITY], "restitution": 0.3, "friction": 0.5, "material": material} | further
        scene = SceneMaker(tmp_path).scene(position, RADIUS, boundaries=[entry], threads=1, **further)
        return World(read_scene(scene, tmp_path))

    return make


def write_heights(folder, kind):
    """The valley as a file, and the scale of its heights."""
    path = folder / f"valley.{kind}"
    if kind == "npz":
        np.savez(path, heights=valley())
        return path.name, 1.0
    if kind == "csv":
        np.savetxt(path, 1000.0 * valley(), delimiter=",")
        return path.name, 0.001
    levels = np.rint(valley()[::-1] / 0.1 * 65535.0).astype(np.uint16)  # the upper edge of a map is far along y
    Image.fromarray(levels).save(path)
    return path.name, 0.1


@pytest.mark.parametrize(("thickness", "half"), [(None, 0.003), (0.001, 0.0005)])
def test_an_open_mesh_is_as_thick_as_is_said(make_ground, tmp_path, thickness, half):
    """A level sheet of two triangles: a grain rests half a thickness above it, two particle radii if nothing is said."""
    corners = [[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).export(tmp_path / "sheet.stl")
    terrain = {"mesh": "sheet.stl", "contact": "smooth", "spacing": None, "thickness": thickness}
    world = make_ground([[0.0, 0.0, RADIUS + half]], terrain)
    world.step(round(0.1 / world.time_step))
    assert world.observe().grains.position[0, 2] == pytest.approx(RADIUS + half, abs=1e-5)  # which its weight presses in
    assert any(f"sheets count as {2.0 * half:.3g} m thick" in warning for warning in world.warnings)


def test_the_lowest_row_of_a_picture_is_the_first(tmp_path):
    Image.fromarray(np.array([[255, 0], [51, 102]], np.uint8)).save(tmp_path / "ground.png")
    assert read_heights(tmp_path / "ground.png") == pytest.approx(np.array([[0.2, 0.4], [1.0, 0.0]]))


@pytest.mark.parametrize("kind", ["npz", "csv", "png"])
def test_grain_rolls_into_the_valley_and_rests(make_ground, tmp_path, kind):
    file, scale = write_heights(tmp_path, kind)
    world = make_ground(
        [[0.04, 0.03, 0.075]],
        {"heights": file, "scale": scale},
        contact={"rolling": "spring"},
        numbers={"rolling_friction": 0.05},
    )
    for _ in range(60):
        world.step(round(0.1 / world.time_step))
        observation = world.observe()
        if observation.health.fastest < 1e-7 and world.time > 0.5:
            break
    x, y, z = observation.grains.position[0]
    assert abs(x - 0.1) < 0.01
    assert abs(y - 0.05) < 0.015
    assert 0.03 + RADIUS < z < 0.03 + RADIUS + 0.008
    weight = observation.grains.mass[0] * GRAVITY
    assert observation.wall("ground").force == pytest.approx([0.0, 0.0, -weight], abs=5e-3 * weight)
    assert observation.wall("ground").position == pytest.approx([0.1, 0.05, valley().max() / 2 + 0.015], abs=1e-3)
    assert not observation.tools


def test_every_file_gives_the_same_ground(make_ground, tmp_path):
    """An uneven ground, so that turned or mirrored grids would show."""
    grounds = []
    for kind in ("npz", "csv", "png"):
        file, scale = write_heights(tmp_path, kind)
        grounds.append(make_ground([[0.1, 0.05, 0.2]], {"heights": file, "scale": scale}).assembly.grounds[0])
    for ground in grounds:
        assert ground.mesh.vertices == pytest.approx(grounds[0].mesh.vertices, abs=2e-6)
    points = grounds[0].body.points + grounds[0].place
    below = 0.03 + 0.25 * np.abs(points[:, 0] - 0.1) + 0.15 * np.abs(points[:, 1] - 0.05)
    assert np.abs(points[:, 2] - below).max() < 1e-3
    at = np.array([[0.05, 0.02, 0.0], [0.05, 0.02, 0.1]])
    assert np.sign(grounds[0].distance(at)).tolist() == [-1.0, 1.0]


def test_mesh_terrain_lies_at_its_pose(make_ground, tmp_path):
    """A block whose upper face is brought level by the pose carries a grain."""
    import trimesh

    trimesh.creation.box((60.0, 40.0, 10.0)).export(tmp_path / "block.stl")
    pose = {"position": [1.0, 2.0, 3.0], "rpy": [np.pi / 2, 0.0, 0.0]}
    fine = 0.002  # so that dimples between its particles are less wide than what is allowed below
    terrain = {"mesh": "block.stl", "scale": 0.001, "pose": pose, "spacing": None, "particle_radius": fine}
    on_top = [1.0, 2.0, 3.0 + 0.02 + fine + RADIUS]
    world = make_ground([on_top], terrain, contact={"rolling": "spring"}, numbers={"rolling_friction": 0.3})
    world.step(round(0.3 / world.time_step))
    observation = world.observe()
    weight = observation.grains.mass[0] * GRAVITY
    assert observation.grains.position[0] == pytest.approx(on_top, abs=2e-3)
    assert observation.wall("ground").force == pytest.approx([0.0, 0.0, -weight], abs=5e-3 * weight)
    assert observation.health.tool_work == 0.0


@pytest.mark.parametrize(
    ("write", "named"),
    [
        (lambda path: None, "boundaries: heights of terrain 'ground': ground.npz cannot be read"),
        (lambda path: path.write_bytes(b"no zip"), "ground.npz is not a readable npz file"),
        (lambda path: path.write_bytes(b"PK\x03\x04 and cut off"), "ground.npz is not a readable npz file"),
        (lambda path: np.savez(path, ground=valley()), "ground.npz has no array 'heights'; it has ground"),
        (lambda path: np.savez(path, heights=np.ones(4)), "ground.npz must hold at least 2 rows of 2 heights, got shape (4,)"),
        (lambda path: np.savez(path, heights=np.full((2, 2), np.nan)), "ground.npz has heights that are not finite"),
    ],
)
def test_bad_heights_are_refused(make_ground, tmp_path, write, named):
    write(tmp_path / "ground.npz")
    with pytest.raises(SceneError) as caught:
        make_ground([[0, 0, 1]], {"heights": "ground.npz"})
    assert named in str(caught.value)


def test_coloured_pictures_and_missing_meshes_are_refused(make_ground, tmp_path):
    Image.new("RGB", (4, 4)).save(tmp_path / "ground.png")
    with pytest.raises(SceneError, match="must be a grey picture"):
        make_ground([[0, 0, 1]], {"heights": "ground.png"})
    with pytest.raises(SceneError, match=r"boundaries: mesh of terrain 'ground': mesh 'rock.stl': there is no file"):
        make_ground([[0, 0, 1]], {"mesh": "rock.stl", "spacing": None})


def test_smooth_heights_are_where_they_are_said_to_be(make_ground, tmp_path):
    """In a valley whose sides rise by a half a grain's centre rests ``R sqrt(1 + 1/2^2)`` above the bottom."""
    x = np.arange(COLUMNS) * SPACING
    np.savez(tmp_path / "valley.npz", heights=np.tile(0.03 + 0.5 * np.abs(x - 0.1), (ROWS, 1)))
    rolling = {"contact": {"rolling": "spring"}, "numbers": {"rolling_friction": 0.1}}
    world = make_ground([[0.1, 0.05, 0.03 + 1.2 * RADIUS]], {"heights": "valley.npz", "contact": "smooth"}, **rolling)
    world.step(round(0.4 / world.time_step))
    observation = world.observe()
    steepness = np.hypot(1.0, 0.5)
    assert observation.grains.position[0] == pytest.approx([0.1, 0.05, 0.03 + RADIUS * steepness], abs=1e-5)
    assert observation.health.doubts == ()
    weight = observation.grains.mass[0] * GRAVITY
    assert observation.wall("ground").force == pytest.approx([0.0, 0.0, -weight], abs=1e-3 * weight)
    ground = world.assembly.grounds[0]
    assert ground.mesh.is_watertight and ground.mesh.is_winding_consistent
    assert ground.mesh.volume == pytest.approx(0.2 * 0.1 * (4.0 * 0.003 + 0.5 * 0.05))  # down to four particle radii
    at = np.array([[0.05, 0.05, 0.055 - 0.001], [0.05, 0.05, 0.055 + 0.001], [0.1, 0.05, 0.02]])
    assert ground.distance(at) == pytest.approx([-0.001 / steepness, 0.001 / steepness, -0.002], abs=1e-6)


def test_a_grain_slides_down_a_smooth_slope_as_down_a_plane(make_ground, tmp_path):
    slope, time = 0.2, 0.1
    np.savez(tmp_path / "slope.npz", heights=slope * SPACING * np.tile(np.arange(COLUMNS), (ROWS, 1)))
    away = RADIUS * np.array([-slope, 0.0, 1.0]) / np.hypot(1.0, slope)
    begin = np.array([0.15, 0.05, slope * 0.15]) + away
    world = make_ground([begin], {"heights": "slope.npz", "contact": "smooth"}, contact={"tangential": "none"})
    world.step(round(time / world.time_step))
    fallen = 0.5 * GRAVITY * slope / (1.0 + slope**2) * world.time**2
    expected = begin - fallen * np.array([1.0, 0.0, slope])
    assert world.observe().grains.position[0] == pytest.approx(expected, abs=2e-3 * fallen)


@pytest.mark.parametrize(("shape", "above"), [("block", 0.0), ("sheet", 0.002)])
def test_smooth_mesh_terrain_is_as_large_as_its_mesh(make_ground, tmp_path, shape, above):
    """A sheet is one particle radius thick on either side."""
    import trimesh

    block = trimesh.creation.box((0.06, 0.04, 0.02))
    if shape == "sheet":
        block.update_faces(np.asarray(block.triangles_center)[:, 2] > 0.009)
    block.export(tmp_path / "block.stl")
    terrain = {"mesh": "block.stl", "spacing": None, "particle_radius": 0.002, "contact": "smooth"}
    on_top = [0.0, 0.0, 0.01 + above + RADIUS]
    further = {"contact": {"rolling": "spring"}, "numbers": {"rolling_friction": 0.3}}
    domain = {"low": [-0.1, -0.1, -0.1], "high": [0.1, 0.1, 0.1]}
    world = make_ground([on_top], terrain, domain=domain, **further)
    world.step(round(0.3 / world.time_step))
    assert world.observe().grains.position[0] == pytest.approx(on_top, abs=1e-5)
    assert world.observe().health.doubts == ()


def test_rough_grounds_are_a_particle_radius_nearer_than_their_meshes(make_ground, tmp_path):
    """Flat heights, open, at z = 0.03; and a block 60 x 40 x 20 mm, closed, around the origin, at a place of its own."""
    import trimesh

    np.savez(tmp_path / "flat.npz", heights=np.full((ROWS, COLUMNS), 0.03))
    ground = make_ground([[0.1, 0.05, 0.2]], {"heights": "flat.npz"}).assembly.grounds[0]
    at = np.array([[0.07, 0.04, 0.05], [0.07, 0.04, 0.01], [0.23, 0.05, 0.07]])  # the last one beside the end of the grid
    assert ground.distance(at) == pytest.approx([0.02 - 0.003, -0.02 - 0.003, 0.05 - 0.003], abs=1e-9)
    assert ground.extent == pytest.approx(np.hypot(0.1, 0.05) + 0.003, abs=0.004)
    trimesh.creation.box((0.06, 0.04, 0.02)).export(tmp_path / "block.stl")
    block = {"mesh": "block.stl", "spacing": None, "pose": {"position": [0.3, 0.2, 0.1], "rpy": [0.0, 0.0, np.pi / 2]}}
    ground = make_ground([[0.3, 0.2, 0.4]], block).assembly.grounds[0]
    at = np.array([0.3, 0.2, 0.1]) + [[0.0, 0.0, 0.03], [0.0, 0.0, 0.009], [0.05, 0.0, 0.0], [0.0, 0.06, 0.0]]
    assert ground.distance(at) == pytest.approx([0.02 - 0.003, -0.001 - 0.003, 0.03 - 0.003, 0.03 - 0.003], abs=1e-7)


def test_a_ground_of_heights_is_not_said_to_be_a_sheet(make_ground, tmp_path):
    np.savez(tmp_path / "valley.npz", heights=valley())
    assert make_ground([[0.1, 0.05, 0.2]], {"heights": "valley.npz"}).warnings == []


def test_beyond_the_sharp_edge_of_a_closed_block_it_is_outside_whatever_the_file(make_ground, tmp_path):
    """A wedge of 10 degrees with its edge along y at x = 0: above and below, nearest to the edge, one face has its back there."""
    import trimesh

    x, z = 0.06, 0.06 * np.tan(np.radians(5.0))
    corners = [[0.0, y, 0.0] for y in (-0.02, 0.02)] + [[x, y, side] for y in (-0.02, 0.02) for side in (-z, z)]
    faces = [[0, 2, 3], [1, 5, 4], [2, 4, 5], [2, 5, 3], [0, 3, 5], [0, 5, 1], [0, 1, 4], [0, 4, 2]]
    trimesh.Trimesh(corners, faces).export(tmp_path / "wedge.stl")
    ground = make_ground([[0.0, 0.0, 0.1]], {"mesh": "wedge.stl", "spacing": None}).assembly.grounds[0]
    at = np.array([[-0.01, 0.003, 0.005], [-0.01, 0.003, -0.005], [0.03, 0.0, 0.0]])
    outside = np.hypot(0.01, 0.005) - 0.003
    assert ground.distance(at) == pytest.approx([outside, outside, -0.03 * np.sin(np.radians(5.0)) - 0.003], abs=1e-7)
