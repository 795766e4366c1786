"""Smooth tools against closed forms and against analytic walls of the same material, which they must not differ from."""

import numpy as np
import pytest
import trimesh
from scenes import SceneMaker, record

from sand_sim import ToolPose, World, read_scene
from sand_sim.rotation import rotate

GRAIN = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
MODULUS = 0.5 * GRAIN["young"] / (1.0 - GRAIN["poisson"] ** 2)  # [Pa] of two alike
RADIUS, GRAVITY = 0.005, 9.81
MASS = GRAIN["density"] * 4.0 / 3.0 * np.pi * RADIUS**3


def plate():
    """A plate of 2 x 256 uneven triangles, 120 x 60 x 4 mm, whose upper face is at z = 0."""
    mesh = trimesh.creation.box((0.12, 0.06, 0.004)).subdivide().subdivide().subdivide()
    flat = np.isclose(np.abs(mesh.vertices[:, 2]), 0.002) & np.all(np.abs(mesh.vertices[:, :2]) < [0.059, 0.029], axis=1)
    shift = np.random.default_rng(0).uniform(-0.003, 0.003, (flat.sum(), 2))
    mesh.vertices[flat, :2] += shift
    mesh.vertices[:, 2] -= 0.002
    return mesh


def tray():
    """A tray with walls 2 mm thick, 80 x 60 x 40 mm inside, whose inner corner is at the origin."""
    outer = trimesh.creation.box(bounds=[[-0.002] * 3, [0.082, 0.062, 0.04]])
    inner = trimesh.creation.box(bounds=[[0.0] * 3, [0.08, 0.06, 0.05]])
    inside = np.asarray(inner.triangles)[:, ::-1]
    inside = inside[~np.all(np.isclose(inside[:, :, 2], 0.05), axis=1)]
    outside = np.asarray(outer.triangles)
    outside = outside[~np.all(np.isclose(outside[:, :, 2], 0.04), axis=1)]
    inside = np.where(np.isclose(inside, 0.05), 0.04, inside)
    a, b = (
        np.array([[-0.002, -0.002], [0.082, -0.002], [0.082, 0.062], [-0.002, 0.062]]),
        np.array([[0.0, 0.0], [0.08, 0.0], [0.08, 0.06], [0.0, 0.06]]),
    )
    rim = []
    for k in range(4):
        p, q, r, s = ([*corner, 0.04] for corner in (a[k], a[(k + 1) % 4], b[(k + 1) % 4], b[k]))
        rim += [[p, q, r], [p, r, s]]
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.concatenate([outside, inside, rim])))
    mesh.merge_vertices()
    assert mesh.is_watertight
    return mesh


@pytest.fixture
def make_smooth_world(tmp_path):
    """A world with grains and a smooth tool, or the boundaries given in its place."""

    def make(position, mesh=None, tool=None, **further):
        maker = SceneMaker(tmp_path)
        further = {"material": GRAIN, "wall": GRAIN, "domain": {"low": [-0.2] * 3, "high": [0.2] * 3}} | further
        if mesh is not None:
            mesh.export(tmp_path / "tool.stl")
            entry = {"mesh": "tool.stl", "material": "wall", "particle_radius": 0.002, "max_speed": 2.0, "contact": "smooth"}
            further["tools"] = {"tool": entry | (tool or {})}
        return World(read_scene(maker.scene(position, RADIUS, **further), tmp_path))

    return make


def hertz(overlap):
    """Force of a grain on something flat [N]."""
    return 4.0 / 3.0 * MODULUS * np.sqrt(RADIUS) * overlap**1.5


def resting_overlap(force):
    """Overlap under a force [m]."""
    return (0.75 * force / (MODULUS * np.sqrt(RADIUS))) ** (2.0 / 3.0)


def incline(angle):
    """Gravity that makes the plane z = 0 steep by an angle [rad] towards +x."""
    return [GRAVITY * np.sin(angle), 0.0, -GRAVITY * np.cos(angle)]


@pytest.mark.parametrize(("precision", "tolerance"), [("single", 1e-4), ("double", 1e-6)])
@pytest.mark.parametrize("tilted", [False, True])
def test_sphere_slides_down_a_plate_of_triangles_as_coulomb_says(make_smooth_world, precision, tolerance, tilted):
    """No bumps: the normal force is constant, and the acceleration is ``g (sin a - mu cos a)``, with plate or gravity tilted."""
    angle, friction = 0.6, 0.15  # steeper than 3.5 mu: slides
    z = RADIUS - resting_overlap(MASS * GRAVITY * np.cos(angle))
    start, turn, gravity = np.array([-0.03, 0.002, z]), np.array([0.0, 0.0, 0.0, 1.0]), incline(angle)
    if tilted:
        turn, gravity = np.array([0.0, np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)]), [0.0, 0.0, -GRAVITY]
    world = make_smooth_world(
        rotate(turn, start),
        plate(),
        {"pose": {"position": [0.0, 0.0, 0.0], "orientation": turn.tolist()}},
        gravity=gravity,
        friction=friction,
        restitution=0.5,
        precision=precision,
        integrator="velocity_verlet",
    )
    forces, along = [], rotate(turn, np.array([1.0, 0.0, 0.0]))
    world.step(round(0.01 / world.time_step))
    first = world.observe()
    for _ in range(60):
        world.step(round(0.0025 / world.time_step))
        last = world.observe()
        forces.append(last.tool("tool").force)
    normal = -np.array(forces)[:, 2]
    assert last.grains.position[0] @ along - first.grains.position[0] @ along > 0.03
    assert np.abs(normal / (MASS * GRAVITY * np.cos(angle)) - 1.0).max() < tolerance
    assert np.abs(np.array(forces)[:, 0] / normal / friction - 1.0).max() < tolerance
    gained = (last.grains.velocity[0] - first.grains.velocity[0]) @ along / (last.time - first.time)
    assert gained == pytest.approx(GRAVITY * (np.sin(angle) - friction * np.cos(angle)), rel=tolerance)


@pytest.mark.parametrize(
    "further",
    [
        {},
        {"contact": {"cohesion": "capillary"}, "liquid": {"saturation": 0.2}, "integrator": "symplectic_euler"},
        {"contact": {"rolling": "spring", "cohesion": "jkr"}, "numbers": {"rolling_friction": 0.05, "adhesion": 0.2}},
    ],
    ids=["default", "capillary", "JKR and rolling spring"],
)
def test_grain_bounces_and_rolls_as_on_a_wall(make_smooth_world, further):
    """Of every law the same as on an analytic wall, bonds across a gap and memories included."""
    wall = [{"type": "plane", "name": "wall", "material": "wall", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}]
    common = {"gravity": incline(0.2), "velocity": [0.1, 0.02, -0.1], "spin": [0.0, -20.0, 5.0], "skin": 0.0005}
    common |= {"time_step": 5e-6} | further
    start = [[-0.02, 0.002, 0.006]]
    worlds = [make_smooth_world(start, plate(), **common), make_smooth_world(start, boundaries=wall, **common)]
    tool, plane = (record(world, 30, 1000) for world in worlds)
    for name in ("position", "velocity", "spin"):
        assert np.abs(tool[name] - plane[name]).max() < 1e-7 * np.abs(plane[name]).max()


def test_ball_rolls_over_a_plate_of_triangles_as_over_a_wall(make_smooth_world):
    """``5/7 g sin a``, held by one and the same spring over all triangles and lists; a thin skin makes many of these."""
    angle = 0.3
    start = [-0.03, 0.002, RADIUS - resting_overlap(MASS * GRAVITY * np.cos(angle))]
    common = {"gravity": incline(angle), "friction": 0.5, "skin": 0.0005}
    wall = [{"type": "plane", "name": "wall", "material": "wall", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}]
    runs = []
    for world in (make_smooth_world([start], plate(), **common), make_smooth_world([start], boundaries=wall, **common)):
        runs.append(record(world, 40, round(0.005 / world.time_step)))
    tool, plane = runs
    assert tool["time"][-1] == plane["time"][-1]
    assert np.ptp(tool["position"][:, 0, 0]) > 0.03
    for name in ("position", "velocity"):
        assert np.abs(tool[name] - plane[name]).max() < 1e-9 * np.abs(plane[name]).max()
    assert np.abs(tool["spin"] - plane["spin"]).max() < 1e-9 * np.abs(plane["spin"]).max()
    assert tool["velocity"][-1, 0, 0] == pytest.approx(5.0 / 7.0 * GRAVITY * np.sin(angle) * tool["time"][-1], rel=1e-3)


@pytest.mark.parametrize("restitution", [0.2, 0.8])
@pytest.mark.parametrize("moving", [False, True])
def test_impact_gives_the_restitution_asked(make_smooth_world, restitution, moving):
    """On a plate at rest, and on one that comes up to the grain."""
    speed = 0.5
    world = make_smooth_world(
        [[0.011, 0.007, 0.01]],
        plate(),
        velocity=[0.0, 0.0, 0.0 if moving else -speed],
        restitution=restitution,
        friction=0.0,
        contact={"tangential": "none"},
    )
    if moving:
        world.apply(ToolPose("tool", np.array([0.0, 0.0, 0.015]), np.array([0.0, 0.0, 0.0, 1.0]), 0.03))
    world.step(round(0.025 / world.time_step))
    velocity = world.observe().grains.velocity[0]
    expected = (1.0 + restitution) * speed if moving else restitution * speed
    assert velocity[2] == pytest.approx(expected, abs=0.005 * speed)
    assert np.abs(velocity[:2]).max() < 1e-9 * speed


def test_a_tool_that_meets_a_grain_at_rest_makes_no_energy(make_smooth_world):
    """Looked at after every step: the energy that the contact begins with is work of the tool, of which nothing is missing."""
    speed, restitution = 0.5, 0.6
    world = make_smooth_world(
        [[0.0, 0.0, RADIUS + 1e-4]], plate(), restitution=restitution, friction=0.0, contact={"tangential": "none"}
    )
    world.apply(ToolPose("tool", np.array([0.0, 0.0, 0.01]), np.array([0.0, 0.0, 0.0, 1.0]), 0.01 / speed))
    for _ in range(round(2e-3 / world.time_step)):
        world.step()
        health = world.observe().health
        assert health.doubts == ()
        assert health.tool_work == pytest.approx(health.kinetic + health.elastic + health.dissipated, rel=1e-9)
    assert health.elastic == 0.0
    assert health.tool_work == pytest.approx((1.0 + restitution) * MASS * speed**2, rel=5e-3)


@pytest.mark.parametrize(
    ("direction", "edge"),
    [
        ([0.0, 0.0, 1.0], [0.01, 0.005, 0.0]),
        ([1.0, 0.0, 0.0], [0.06, 0.005, -0.002]),
        ([0.6, 0.0, 0.8], [0.06, 0.01, 0.0]),
        ([0.0, -0.28, 0.96], [0.02, -0.03, 0.0]),
        ([2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0], [0.06, 0.03, 0.0]),
        ([2.0 / 7.0, -3.0 / 7.0, -6.0 / 7.0], [0.06, -0.03, -0.004]),
    ],
)
def test_faces_edges_and_corners_push_away_from_the_closest_point(make_smooth_world, direction, edge):
    """A sphere pressed into a place of a box feels Hertz's force from there, and the box its reaction in that place."""
    direction, edge, overlap = np.array(direction), np.array(edge, np.float32).astype(float), 1e-5  # a file has no more digits
    world = make_smooth_world([edge + (RADIUS - overlap) * direction], plate(), friction=0.5)
    force = hertz(overlap) * direction
    report = world.observe().tool("tool")
    assert report.force == pytest.approx(-force, abs=1e-8 * hertz(overlap))
    contacts = world.tool_contacts("tool")
    assert contacts.normal == pytest.approx(direction[None], abs=1e-9)
    assert contacts.point == pytest.approx(edge[None], abs=1e-9)
    assert contacts.overlap == pytest.approx([overlap], rel=1e-6)
    assert report.torque == pytest.approx(np.cross(edge, -force), abs=1e-8 * hertz(overlap) * 0.06)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_ball_in_a_corner_of_a_tray_does_as_in_a_corner_of_walls(make_smooth_world, friction):
    """A ball that comes down into the corner and rests on floor and walls; each has a contact with a memory of its own."""
    box = {"type": "box", "name": "box", "material": "wall", "low": [0.0] * 3, "high": [0.08, 0.06, 0.04], "open": ["top"]}
    gravity = [-0.5 * GRAVITY, -0.3 * GRAVITY, -GRAVITY]
    common = {"gravity": gravity, "friction": friction, "restitution": 0.3, "velocity": [-0.1, -0.15, 0.0]}
    start = [[0.012, 0.014, 0.012]]
    worlds = [make_smooth_world(start, tray(), **common), make_smooth_world(start, boundaries=[box], **common)]
    runs = [record(world, 40, round(0.01 / world.time_step)) for world in worlds]
    size = np.abs(runs[1]["velocity"]).max()
    assert np.abs(runs[0]["velocity"] - runs[1]["velocity"]).max() < 1e-6 * size
    assert np.abs(runs[0]["position"] - runs[1]["position"]).max() < 1e-6 * RADIUS
    last = worlds[0].observe()
    weight = MASS * np.array(gravity)
    assert np.abs(last.grains.velocity).max() < 1e-4
    assert last.tool("tool").force == pytest.approx(weight, abs=2e-3 * MASS * GRAVITY)
    assert last.health.contacts == 3


def test_momentum_is_what_the_tool_gives(make_smooth_world):
    """Grains fall into a tray that swings; the force on it, times time, is the momentum that the grains lose."""
    random = np.random.default_rng(1)
    corners = np.stack(np.meshgrid(range(5), range(4), range(2), indexing="ij"), -1).reshape(-1, 3)
    position = 0.0105 * corners + [0.012, 0.012, 0.0055] + random.uniform(0.0, 1e-4, (40, 3))
    world = make_smooth_world(position, tray(), velocity=[0.2, 0.1, -0.5], threads=1)
    before = world.observe().grains
    force = np.zeros(3)
    for k in range(1, 11):
        begin, angle = world.time, 0.02 * k
        turn = np.array([np.sin(0.5 * angle), 0.0, 0.0, np.cos(0.5 * angle)])
        world.apply(ToolPose("tool", np.array([0.0, 0.0, 0.0005 * k]), turn, 0.002 * k))
        world.step(round((0.002 * k - world.time) / world.time_step))
        observation = world.observe()
        force += observation.tool("tool").world_force * (world.time - begin)
    gained = (before.mass[:, None] * (observation.grains.velocity - before.velocity)).sum(axis=0)
    assert np.abs(gained).max() > 0.1 * np.abs(before.mass * before.velocity[:, 2]).sum()
    assert np.abs(force + gained).max() < 1e-8 * np.abs(before.mass * before.velocity[:, 2]).sum()
    assert observation.health.dissipated > 0.0


def test_saved_state_goes_on_to_the_bit_on_any_number_of_threads(make_smooth_world):
    corners = np.stack(np.meshgrid(range(6), range(5), range(2), indexing="ij"), -1).reshape(-1, 3)
    common = {"gravity": [-3.0, -2.0, -9.81], "precision": "single", "skin": 0.0003}
    position = 0.0102 * corners + [0.012, 0.008, 0.0052]
    world = make_smooth_world(position, tray(), threads=2, **common)
    world.apply(ToolPose("tool", np.array([0.01, 0.0, 0.01]), np.array([0.0, 0.1, 0.0, 0.995]), 0.2))
    world.step(700)
    saved = world.save()
    world.step(900)
    expected = world.save()
    other = make_smooth_world(position, tray(), threads=1, **common)
    other.restore(saved)
    for _ in range(9):
        other.observe()  # leaves no trace
        other.step(100)
    found = other.save()
    differ = {name for name in expected if expected[name].tobytes() != found[name].tobytes()}
    assert differ <= {"tools.impulse", "start", "observed_steps", "observed_wrench"}  # since the last observation


def drum():
    """A ring with an inner radius of 40 mm about y, of 48 slender facets that hollow it out."""
    ring = trimesh.creation.annulus(0.04, 0.043, 0.06, sections=48)
    ring.apply_transform(trimesh.transformations.rotation_matrix(0.5 * np.pi, [1.0, 0.0, 0.0]))
    return ring


def valley():
    """A plate whose upper face is hollowed out along y by a degree on either side, of few large triangles."""
    mesh = trimesh.creation.box((0.06, 0.06, 0.004))
    halves = [mesh.copy().apply_translation([side, 0.0, -0.002]) for side in (0.03, -0.03)]
    hollow = trimesh.util.concatenate(halves)
    hollow.vertices[:, 2] += 0.02 * np.abs(hollow.vertices[:, 0])
    return hollow


@pytest.mark.parametrize(("mesh", "least_known"), [(tray, 0.5), (drum, 0.3), (plate, 0.3), (valley, 0.3)])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_what_is_known_of_the_surface_is_what_a_search_would_find(make_smooth_world, mesh, least_known, precision):
    """To the bit, with grains that slide, roll, bounce and lie in corners and over edges of a tool that turns and swings."""
    lattice = np.stack(np.meshgrid(range(-2, 3), range(-2, 3), range(2), indexing="ij"), -1).reshape(-1, 3)
    middle = {tray: [0.035, 0.03, 0.008], drum: [0.0, 0.0, -0.02], plate: [0.03, 0.01, 0.007], valley: [0.004, 0.0, 0.0065]}[mesh]
    common = {
        "gravity": [-1.0, -2.0, -9.81],
        "precision": precision,
        "friction": 0.4,
        "restitution": 0.1,
        "velocity": [0.0, 0.0, -1.0],
    }
    worlds = [make_smooth_world(0.0103 * lattice + middle, mesh(), **common) for _ in range(2)]
    known, contacts = [], []
    for turn in range(3):
        for world in worlds:
            way, angle = [0.005 * turn, -0.003, 0.001 * turn], 0.03 * (turn + 1)
            world.apply(ToolPose("tool", np.array(way), np.array([0.0, np.sin(angle), 0.0, np.cos(angle)]), world.time + 0.008))
        knowing, searching = worlds
        for _ in range(round(0.008 / knowing.time_step)):
            before = knowing.assembly.solver.arrays.standing.numpy()["at"].copy()
            knowing.step(1)
            searching.assembly.solver.arrays.standing.zero_()
            searching.step(1)
            arrays = knowing.assembly.solver.arrays
            listed = min(arrays.tool_list.pairs.get(), len(before))
            if listed:
                known.append((arrays.standing.numpy()["at"][:listed:3] == before[:listed:3]).all(axis=1).mean())
        states = [world.save() for world in worlds]
        for name in ("grains.place", "grains.half_motion", "grains.half_spin", "tool.touch", "tools.wrench"):
            assert states[0][name].tobytes() == states[1][name].tobytes(), name
        contacts.append(len(knowing.tool_contacts("tool")))
    assert max(contacts) >= 10
    assert np.mean(known) > least_known


def test_a_state_that_points_to_faces_which_are_not_there_is_refused(make_smooth_world):
    world = make_smooth_world([[0.006, 0.02, RADIUS]], tray(), gravity=[0.0, 0.0, -GRAVITY])
    world.step(100)
    for field, number in (("over", 10**6), ("over", -2), ("few", 13), ("few", -2), ("near", 10**6), ("near", -1)):
        state = world.save()
        (state["tool.near"] if field == "near" else state["tool.standing"][field])[:] = number
        with pytest.raises(ValueError, match=r"array 'tool\.(standing|near)' points outside"):
            world.check_state(state)
    state = world.save()
    state["tool.partner"][-1] = state["tool.partner"][0]
    with pytest.raises(ValueError, match=r"array 'tool\.partner' lacks slots of a smooth tool"):
        world.check_state(state)
    world.check_state(world.save())


def test_a_world_without_memory_goes_back_to_where_nothing_was_touched(make_smooth_world):
    """A grain above a plate, put back there from its contact, falls on as if it had not been there."""
    common = {"velocity": [0.0, 0.0, -0.3], "contact": {"tangential": "none"}}
    world = make_smooth_world([[0.001, 0.002, RADIUS + 0.0006]], plate(), **common)
    world.step(1)
    above = world.save()
    while world.observe().health.contacts == 0:
        world.step(10)
    world.restore(above)
    world.step(5)
    seen = world.observe()
    assert seen.grains.velocity[0] == pytest.approx([0.0, 0.0, -0.3], abs=1e-12)
    assert seen.tool("tool").force == pytest.approx([0.0] * 3, abs=1e-12)


def test_a_sheet_is_as_thick_as_asked(make_smooth_world):
    """A plate modelled as a surface without thickness, 3 mm thick, carries a grain 1.5 mm above that surface."""
    sheet = trimesh.Trimesh(
        [[-0.05, -0.03, 0.0], [0.05, -0.03, 0.0], [0.05, 0.03, 0.0], [-0.05, 0.03, 0.0]], [[0, 1, 2], [0, 2, 3]]
    )
    world = make_smooth_world([[0.001, 0.002, RADIUS + 0.0016]], sheet, {"thickness": 0.003}, gravity=[0.0, 0.0, -GRAVITY])
    world.step(round(0.3 / world.time_step))
    observation = world.observe()
    expected = 0.0015 + RADIUS - resting_overlap(MASS * GRAVITY)
    assert observation.grains.position[0, 2] == pytest.approx(expected, abs=1e-8)
    assert observation.tool("tool").force == pytest.approx([0.0, 0.0, -MASS * GRAVITY], abs=1e-4 * MASS * GRAVITY)


def test_overlaps_with_a_plate_that_turns_are_those_of_its_pose_at_that_time(make_smooth_world):
    """A step sooner or later it would be 1e-7 m or more off: 2 rad/s, 30 mm from the axis."""
    world = make_smooth_world([[0.03, 0.0, RADIUS - 1e-6]], plate(), time_step=2e-6)
    angle, time = 0.02, 0.01
    turn = np.array([0.0, -np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)])
    world.apply(ToolPose("tool", np.zeros(3), turn, time))
    for _ in range(5):
        world.step(7)
        now = world.time / time * angle
        normal = np.array([-np.sin(now), 0.0, np.cos(now)])
        contacts, position = world.tool_contacts("tool"), world.observe().grains.position[0]
        assert contacts.overlap == pytest.approx([RADIUS - position @ normal], abs=1e-10)
        assert contacts.normal == pytest.approx(normal[None], abs=1e-9)
    assert now * 0.03 > 1e-6
