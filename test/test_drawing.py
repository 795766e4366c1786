"""What is drawn of a world: the entities that ``docs/python.md`` tells of, walls where they are, and views of what matters."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import write_small_scene

from sand_sim import World, follow, frame_times, load_scene
from sand_sim.scene.walls import Wall
from sand_sim.sinks.run_log import RunLog, View
from sand_sim.sinks.wall_mesh import wall_mesh

rr = pytest.importorskip("rerun")

from sand_sim.sinks.blueprint import series_styles
from sand_sim.sinks.drawing import Drawing

DOCUMENT = Path(__file__).parents[1] / "docs" / "python.md"
LOW, HIGH = np.array([-1.0, -0.5, 0.0]), np.array([1.0, 0.5, 2.0])  # of a domain


def drawn_of(kind, direction, point, **shape):
    """Corners of a drawn wall in the world, and the area of its triangles, both sides of which are drawn."""
    direction, point = np.asarray(direction, float), np.asarray(point, float)
    wall = Wall(kind, "it", "steel", point, direction / np.linalg.norm(direction), **shape)
    corners, triangles = wall_mesh(wall, LOW, HIGH)
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    return wall, corners + point, 0.25 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize(
    ("normal", "point", "area"),
    [
        ([0, 0, 1], [5.0, 7.0, 0.5], 2.0),
        ([0, 0, -1], [0.0, 0.0, 2.0], 2.0),  # on a face of the domain
        ([1, 0, 1], [0.0, 0.0, 1.0], np.sqrt(8.0)),
        ([1, 1, 0], [0.0, 0.0, 0.0], np.sqrt(2.0) * 2.0),
    ],
)
def test_a_plane_is_drawn_as_far_as_it_lies_in_the_domain(normal, point, area):
    wall, corners, found = drawn_of("plane", normal, point)
    assert found == pytest.approx(area)
    assert np.abs(wall.gap(corners)).max() < 1e-8
    assert np.all((corners > LOW - 1e-6) & (corners < HIGH + 1e-6))


def test_a_plane_outside_of_the_domain_is_not_drawn():
    assert len(drawn_of("plane", [0, 0, 1], [0.0, 0.0, -3.0])[1]) == 0


def test_a_cylinder_without_end_is_drawn_along_the_domain():
    wall, corners, _ = drawn_of("cylinder", [0, 0, 1], [0.2, 0.0, 0.3], radius=0.1)
    assert np.abs(wall.gap(corners)).max() < 1e-8
    assert sorted({round(z, 9) for z in corners[:, 2]}) == [0.0, 2.0]


def test_walls_of_one_name_are_all_drawn_each_in_its_place(tmp_path):
    plane = {"type": "plane", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 1]}
    press = {"type": "plunger", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.0}
    world, places, shapes = World(load_scene(write_small_scene(tmp_path, boundaries=[plane, press, plane]))), {}, {}

    def log(entity, shown, **_):
        if entity.startswith("world/walls/") and not isinstance(shown, rr.Transform3D):
            shapes[entity.rpartition("/")[2]] = type(shown)
        if isinstance(shown, rr.Transform3D):
            places[entity] = shown.translation.as_arrow_array().to_pylist()[0]

    Drawing(world, SimpleNamespace(log=log, set_time=lambda *_, **__: None, send_blueprint=lambda *_, **__: None)).write(
        world.observe()
    )
    del places["world/tools/plate"]
    heights = {"plane": 0.0, "plane_2": 0.0, "plunger": 0.2}
    assert shapes == {"plane": rr.Mesh3D, "plane_2": rr.Mesh3D, "plunger": rr.LineStrips3D}, "floors alone hide what is behind"
    assert places == {f"world/walls/{name}": pytest.approx([0.0, 0.0, z]) for name, z in heights.items()}


def test_curves_of_one_view_differ_in_colour(tmp_path):
    styles = series_styles(load_scene(write_small_scene(tmp_path)), [])
    for view in ("force/plate", "torque/plate", "health/energy"):
        colours = [str(style.colors.as_arrow_array()) for name, style in styles.items() if name.startswith(f"{view}/")]
        assert len(set(colours)) == len(colours) == 3


@pytest.mark.parametrize(("duration", "views"), [(0.06, ["press", "end"]), (0.04, ["press"])])
def test_a_figure_shows_the_end_of_a_run_that_goes_on_after_its_last_phase(tmp_path, duration, views):
    pytest.importorskip("matplotlib")
    from sand_sim.sinks.figure import pick_views

    way = [{"time": 0.0, "position": [0.015, 0.015, 0.06]}, {"time": 0.04, "position": [0.015, 0.015, 0.06], "phase": "press"}]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "trajectory": way}
    world = World(load_scene(write_small_scene(tmp_path, duration=duration, tools={"plate": plate})))
    log = RunLog(world.scene)
    for _ in range(round(duration / 0.02)):
        world.step(world.frame_steps)
        log.write(world.observe())
    assert [name for name, _ in pick_views(log)] == views


def test_a_figure_shows_where_bins_are_cut(tmp_path):
    from sand_sim.sinks.figure import bin_sections

    one = {"type": "bin", "material": "steel", "low": [0.0, -0.1, 0.0], "high": [0.3, 0.1, 0.2]}
    scene = load_scene(write_small_scene(tmp_path, boundaries=[one]))
    lines = {tuple(map(tuple, line[:, [0, 2]])) for line in bin_sections(scene, 0.05)}
    assert lines == {((0.0, 0.0), (0.0, 0.2)), ((0.3, 0.0), (0.3, 0.2)), ((0.0, 0.0), (0.3, 0.0))}
    assert all((line[:, 1] == 0.05).all() for line in bin_sections(scene, 0.05))
    assert not bin_sections(scene, 0.15)
    across = {tuple(map(tuple, line[:, [0, 2]].round(9))) for line in bin_sections(scene, -0.1, sideways=True)}  # at x = 0.1
    assert across == {((-0.1, 0.0), (-0.1, 0.2)), ((0.1, 0.0), (0.1, 0.2)), ((-0.1, 0.0), (0.1, 0.0))}
    assert not bin_sections(scene, 0.1, sideways=True)


@pytest.mark.parametrize(
    ("motion", "sideways"),
    [
        ({"velocity": [0.1, 0.05, 0.0]}, False),
        ({"velocity": [0.05, -0.1, 0.0]}, True),
        ({"spin": [0.0, 9.0, 0.0]}, False),
        ({"spin": [9.0, 0.0, 0.0]}, True),
        ({"velocity": [0.0, 0.0, 0.1]}, False),
    ],
)
def test_a_figure_looks_across_the_way_that_tools_go(tmp_path, motion, sideways):
    """Along y, or where they go along y or roll about x, along x; what lies along y is to the right then."""
    pytest.importorskip("matplotlib")
    from sand_sim.sinks.figure import draw_run, go_sideways, turned

    way = [{"time": 0.0, "position": [0.0, 0.0, 0.06]}, {"time": 0.1} | motion]
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "trajectory": way}
    world = World(load_scene(write_small_scene(tmp_path, tools={"plate": plate})))
    log = RunLog(world.scene)
    for end in frame_times(world.scene):
        follow(world, end)
        log.write(world.observe())
    assert go_sideways(log.columns(), world.tools) == sideways
    view, seen = View.of(log.last), turned(View.of(log.last))
    np.testing.assert_allclose(seen.position, view.position[:, [1, 0, 2]] * [1.0, -1.0, 1.0], atol=1e-12)
    draw_run(log, world.tools, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10000


def test_a_viewer_that_is_open_takes_the_views_of_the_run(tmp_path):
    """By the time they come it has views of its own, or those of another scene, and after a reset the time of the run before."""
    world, sent, times = World(load_scene(write_small_scene(tmp_path))), [], []

    def send(blueprint, make_active=True, **_):
        sent.append((blueprint.time_panel.timeline, make_active))

    def set_time(timeline, **_):
        times.append(timeline)

    drawing = Drawing(
        world, SimpleNamespace(log=lambda *_, **__: None, set_time=set_time, send_blueprint=send, reset_time=times.clear)
    )
    for steps in (0, 10, 10):
        world.step(steps) if steps else world.reset()
        drawing.write(world.observe())
    assert sent == [("sim_time", True)], "once, so that it may be changed by hand"
    world.reset()
    drawing.write(world.observe())
    assert sent[1:] == [("sim_time_2", True)]
    assert times == ["sim_time_2"]


def test_all_that_is_drawn_is_told_of(tmp_path):
    press = {"type": "plunger", "name": "press", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.0}
    path = write_small_scene(tmp_path)
    scene = path.read_text()
    path.write_text(scene.replace("boundaries:\n", f"boundaries:\n- {press}\n"))
    world, drawn = World(load_scene(path)), set()
    stream = SimpleNamespace(
        log=lambda entity, *_, **__: drawn.add(entity), set_time=lambda *_, **__: None, send_blueprint=lambda *_, **__: None
    )
    Drawing(world, stream, particles=True).write(world.observe())
    table = DOCUMENT.read_text().partition("| entity | |")[2]
    told = {name for row in re.findall(r"^\| (`.*?`) \|", table, re.MULTILINE) for name in re.findall(r"`([^`]+)`", row)}
    named = {name.replace("TOOL", "plate").replace("PLUNGER", "press") for name in told}
    walls = {name for name in drawn if name.startswith("world/walls/")}
    assert walls == {"world/walls/floor", "world/walls/press"}
    assert drawn - walls - {"world"} == named - {"world/walls/WALL"}
