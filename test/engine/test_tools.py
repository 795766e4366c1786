"""Tools: forces, true velocities, momentum, and that moving one rebuilds nothing but its own list."""

import numpy as np
import pytest
import trimesh
import yaml
from scenes import SceneMaker, floor, record, write_small_scene
from spread import distances

from sand_sim import CommandError, SceneError, ToolPose, ToolVelocity, World, read_scene, rotation
from sand_sim.tool_motion.playing import commands_at

GRAIN = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture
def make_plate_world(tmp_path):
    """A world with grains and a plate, 60 x 60 x 4 mm, whose upper face is at z = 0 of its frame."""

    def make(position, radius=0.005, particle_radius=0.002, pose=None, **further):
        mesh = trimesh.creation.box((0.06, 0.06, 0.004))
        mesh.apply_translation([0.0, 0.0, -0.002])
        mesh.export(tmp_path / "plate.stl")
        maker = SceneMaker(tmp_path)
        tools = {
            "plate": {"mesh": "plate.stl", "material": "wall", "particle_radius": particle_radius, "max_speed": 5.0}
            | (pose or {})
        }
        further = {"material": GRAIN, "wall": GRAIN, "domain": {"low": [-0.2] * 3, "high": [0.2] * 3}} | further
        return World(read_scene(maker.scene(position, radius, tools=tools, **further), tmp_path))

    return make


@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_tool_carries_a_resting_grain(make_plate_world, yaw):
    pose = {"pose": {"position": [0.0, 0.0, 0.0], "rpy": [0.0, 0.0, yaw]}}
    world = make_plate_world([[0.01, 0.0, 0.0072]], pose=pose, gravity=[0.0, 0.0, -9.81], restitution=0.2, friction=0.8)
    world.step(round(1.0 / world.time_step))
    world.observe()
    world.step(200)
    observation = world.observe()
    weight = float(observation.grains.mass[0]) * 9.81
    report = observation.tool("plate")
    assert report.force[2] == pytest.approx(-weight, rel=1e-3)
    assert np.abs(report.world_force[:2]).max() < 1e-2 * weight
    x, y, _ = observation.grains.position[0]
    assert np.hypot(x, y) > 0.005
    back = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    assert report.torque == pytest.approx(back @ [-weight * y, weight * x, 0.0], abs=2e-3 * weight * 0.03)


def test_particles_lie_as_near_to_each_other_as_asked(make_plate_world):
    """A skin of 2 x 60 x 60 + 4 x 60 x 4 mm^2 holds 2 A / (sqrt(3) h^2) of them."""
    position = [[0.0, 0.0, 0.05]]
    for spacing in (0.002, 0.003):
        body = make_plate_world(position, pose={"particle_spacing": spacing}).tools[0].body
        assert len(body) == pytest.approx(2.0 * 8.16e-3 / (np.sqrt(3.0) * spacing**2), rel=0.02)
    with pytest.raises(SceneError, match="particle_spacing"):
        make_plate_world(position, pose={"particle_spacing": -0.002})


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-9), ("single", 1e-6)])
def test_force_times_time_is_momentum_given(make_plate_world, precision, tolerance):
    random = np.random.default_rng(1)
    position = np.column_stack([random.uniform(-0.02, 0.02, (6, 2)), 0.0076 + 0.0105 * np.arange(6)])
    world = make_plate_world(position, velocity=[0.0, 0.0, -0.5], precision=precision)
    before = world.observe().grains
    world.step(1500)
    after = world.observe()
    gained = (after.grains.mass[:, None].astype(float) * (after.grains.velocity - before.velocity)).sum(axis=0)
    impulse = -after.tool("plate").world_force * after.time
    assert np.abs(gained).max() > 0.0
    assert np.abs(impulse - gained).max() < tolerance * np.abs(before.mass * before.velocity[:, 2]).sum()


@pytest.mark.parametrize("looks", [(), (2, 5, 11)], ids=["not observed", "observed"])
def test_what_is_felt_is_the_momentum_that_grains_gain_meanwhile(make_plate_world, looks):
    """Symplectic Euler's velocities gain just what each step's forces give; whoever observes in between takes nothing away."""
    grains, solver = [[0.01, 0.0, 0.0072], [-0.02, 0.0, 0.0073]], {"integrator": "symplectic_euler"}
    world, seen = (make_plate_world(grains, velocity=[0.1, 0.0, -0.5], solver=solver) for _ in range(2))
    felt, told, momentum = [], [], []
    for step in range(16):
        if step % 4 == 0:
            report, cloud = seen.observe().tool("plate"), seen.observe().grains
            told.append([report.world_force, report.torque])
            momentum.append(cloud.mass.astype(float) @ cloud.velocity)
            felt.append(world.feel("plate"))
        if step in looks:
            world.observe()
        world.step(4)
        seen.step(4)
    felt, gained = np.array(felt)[1:], np.diff(momentum, axis=0) / (16 * world.time_step)
    assert np.count_nonzero(gained[:, 2]) > 1
    assert felt[:, 0] == pytest.approx(-gained, rel=1e-5, abs=1e-5 * np.abs(gained).max())
    assert felt == pytest.approx(np.array(told)[1:], rel=1e-12)


@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_means_of_a_turning_tool_are_taken_in_axes_that_turn_with_it(make_plate_world, integrator):
    """A plate on edge sweeps grains round by 57 degrees: what it feels in each step, in its axes of then, on the mean."""
    grains = [[0.02, 0.0085 + 0.0101 * k, 0.004 * k] for k in range(4)]
    pose = {"pose": {"position": [0.0, 0.0, 0.0], "rpy": [np.pi / 2, 0.0, 0.0]}}
    at_once, by_steps = (
        make_plate_world(grains, pose=pose, gravity=[0.0] * 3, friction=0.3, solver={"integrator": integrator}) for _ in range(2)
    )
    for world in (at_once, by_steps):
        world.apply(world.pose_after(ToolVelocity("plate", np.zeros(3), np.array([0.0, 0.0, 50.0])), 0.02))
    steps, dt, sums = round(0.02 / at_once.time_step), at_once.time_step, np.zeros((4, 3))
    begin = by_steps.tools[0].tool.pose.orientation
    at_once.step(steps)
    for step in range(steps):
        by_steps.step(1)
        report = by_steps.observe().tool("plate")
        turn = rotation.multiply(rotation.from_vector([0.0, 0.0, 50.0 * (step + 0.5) * dt]), begin)
        felt = np.array([report.world_force, report.world_torque])
        sums += np.concatenate([felt, rotation.rotate(rotation.inverse(turn), felt)])
    report, means = at_once.observe().tool("plate"), sums / steps
    assert np.abs(means[2, 2]) > 0.1, "the plate's face pushes"
    for found, mean in zip((report.world_force, report.world_torque, report.force, report.torque), means, strict=True):
        assert found == pytest.approx(mean, abs=2e-3 * np.linalg.norm(mean))
    turned_late = rotation.rotate(rotation.inverse(report.orientation), report.world_force)
    assert np.linalg.norm(report.force - turned_late) > 0.1 * np.linalg.norm(report.force)


def test_feeling_begins_anew_where_a_state_is_put_back(make_plate_world):
    world = make_plate_world([[0.0, 0.0, 0.0072]], velocity=[0.0, 0.0, -0.5])
    world.step(40)
    state, first = world.save(), world.feel("plate")
    world.step(40)
    later = world.feel("plate")
    assert first[0][2] != later[0][2]
    world.restore(state)
    world.step(40)
    assert np.array_equal(world.feel("plate"), later)
    with pytest.raises(CommandError, match="tool 'spade' is unknown"):
        world.feel("spade")


def test_particles_carry_the_tools_velocity(make_plate_world):
    """A rising plate throws a resting grain to (1 + e) times its own speed."""
    world = make_plate_world([[0.0, 0.0, 0.015]], restitution=0.7, friction=0.0, contact={"tangential": "none"})
    world.apply(ToolPose("plate", np.array([0.0, 0.0, 0.02]), NO_TURN, 0.04))
    world.step(round(0.035 / world.time_step))
    velocity = world.observe().grains.velocity[0]
    assert np.linalg.norm(velocity) == pytest.approx(1.7 * 0.5, rel=0.15)  # less the roughness of the particles
    assert velocity[2] > 0.6


def test_flat_face_is_as_rough_as_its_particles(make_plate_world):
    """A frictionless sphere that slides over a flat face sinks into the gaps between particles as they allow.

    Where a point of the face has the nearest particle at a distance c, by ``(R + r) - sqrt((R + r)^2 - c^2)``.
    """
    radius, particle, speed = 0.005, 0.002, 0.2
    world = make_plate_world(
        [[-0.018, 0.0, radius + particle]],
        radius,
        particle,
        velocity=[speed, 0.0, 0.0],
        gravity=[0.0, 0.0, -9.81],
        restitution=0.2,
        friction=0.0,
        contact={"tangential": "none"},
    )
    points = world.tools[0].body.points
    x, y = np.meshgrid(np.linspace(-0.02, 0.02, 401), np.linspace(-0.01, 0.01, 201))
    gap = distances(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), points).max()
    assert gap < 1.5 * particle
    history = record(world, 120, round(0.15 / 120 / world.time_step))
    x, z = history["position"][:, 0, 0], history["position"][:, 0, 2]
    there = (x < 0.018) & (np.abs(history["position"][:, 0, 1]) < 0.009)
    assert x[there].max() > 0.0
    reach = radius + particle
    roughness = reach - np.sqrt(reach**2 - gap**2)
    assert z[there].max() < reach * 1.0001
    assert z[there].min() > reach - roughness - 1e-5  # the dent of its weight
    assert np.ptp(z[there]) > 0.05 * roughness
    slope = gap / reach
    assert np.abs(history["velocity"][there, 0, 2]).max() < 2.0 * slope * speed


def test_turning_tool_carries_grains_round(make_plate_world):
    """A grain on a turning plate is dragged along until it turns with the plate."""
    world = make_plate_world([[0.015, 0.0, 0.0072]], gravity=[0.0, 0.0, -9.81], restitution=0.2, friction=1.0)
    world.step(round(0.3 / world.time_step))
    turn, rate = world.time, 1.0
    for k in range(1, 31):
        angle = 0.5 * rate * 0.02 * k
        quaternion = np.array([0.0, 0.0, np.sin(angle), np.cos(angle)])
        world.apply(ToolPose("plate", np.zeros(3), quaternion, turn + 0.02 * k))
        world.step(round((turn + 0.02 * k - world.time) / world.time_step))
    observation = world.observe()
    x, y, _ = observation.grains.position[0]
    assert np.arctan2(y, x) == pytest.approx(0.6, abs=0.15)
    assert observation.tool("plate").spin == pytest.approx([0.0, 0.0, rate], abs=1e-6)


def test_a_tool_that_turns_in_place_meets_what_its_corners_reach(make_plate_world):
    """A grain beside a side of the plate, which the corner comes round to at 3.4 m/s."""
    world = make_plate_world([[0.0385, 0.0, -0.002]], skin=1e-3)
    assert len(world.tool_contacts("plate")) == 0
    world.apply(ToolPose("plate", np.zeros(3), np.array([0.0, 0.0, np.sin(0.4), np.cos(0.4)]), 0.01))
    world.step(round(0.01 / world.time_step))
    assert world.observe().grains.velocity[0, 1] > 1.0


def test_moving_tool_rebuilds_only_its_own_list(make_plate_world):
    world = make_plate_world([[0.0, 0.0, 0.1]], precision="single")
    grains = world.assembly.solver.arrays.grains
    world.step(500)  # the first lists do not last long
    grains.origin.fill_(0)  # would be written anew by a search among grains
    world.assembly.solver.arrays.flags.grains_moved.zero_()
    grains.origin.assign(grains.place)
    before = grains.origin.numpy().copy()
    world.apply(ToolPose("plate", np.array([0.05, 0.0, 0.0]), NO_TURN, world.time + 0.05))
    world.step(500)
    assert float(world.assembly.solver.arrays.tools.travelled.numpy()[0]) < 0.5 * world.assembly.solver.arrays.setting.skin
    assert np.array_equal(grains.origin.numpy(), before)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (ToolPose("spade", np.zeros(3), NO_TURN, 1.0), "unknown_tool"),
        (ToolPose("plate", np.array([np.nan, 0.0, 0.0]), NO_TURN, 1.0), "not_finite"),
        (ToolPose("plate", np.zeros(3), np.array([0.0, 0.0, 0.0, np.inf]), 1.0), "not_finite"),
        (ToolPose("plate", np.zeros(3), np.zeros(4), 1.0), "zero_quaternion"),
        (ToolPose("plate", np.zeros(3), NO_TURN, 0.0), "late"),
        (ToolPose("plate", np.array([1.0, 0.0, 0.0]), NO_TURN, 0.01), "too_fast"),
    ],
)
def test_bad_commands_are_rejected_and_change_nothing(make_plate_world, command, reason):
    world = make_plate_world([[0.0, 0.0, 0.05]])
    before = world.save()
    with pytest.raises(CommandError) as caught:
        world.apply(command)
    assert caught.value.reason == reason
    assert command.tool in str(caught.value)
    after = world.save()
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_a_command_that_is_too_far_away_is_told_where_the_tool_is(make_plate_world):
    """As by an arm that starts elsewhere than the scene has its tool."""
    world = make_plate_world([[0.0, 0.0, 0.05]])
    world.apply(ToolPose("plate", np.array([0.01, 0.0, 0.02]), NO_TURN, 0.2))
    world.step(round(0.25 / world.time_step))
    with pytest.raises(CommandError, match=r"from where it is, \[0\.01, 0\.0, 0\.02\],"):
        world.apply(ToolPose("plate", np.array([1.0, 0.0, 0.0]), NO_TURN, 0.26))


def test_saved_state_goes_on_to_the_bit(make_plate_world):
    position = np.column_stack([np.linspace(-0.02, 0.02, 9), np.zeros(9), np.linspace(0.008, 0.09, 9)])
    common = {"gravity": [0.0, 0.0, -9.81], "precision": "single"}
    world = make_plate_world(position, **common)
    world.apply(ToolPose("plate", np.array([0.01, 0.0, 0.01]), NO_TURN, 0.2))
    world.step(2000)
    saved = world.save()
    world.step(3000)
    expected = world.save()
    other = make_plate_world(position, threads=1, **common)
    other.restore(saved)
    other.step(3000)
    found = other.save()
    assert all(expected[name].tobytes() == found[name].tobytes() for name in expected)
    world.reset()
    assert world.time == 0.0


def test_list_that_outgrows_its_room_changes_nothing(tmp_path):
    """A thick skin lists so many tool particles that room is made in mid-run; forces between grains must go on both ways."""
    parsed = yaml.safe_load(write_small_scene(tmp_path).read_text())
    last, room = [], []
    for skin in (0.1 * 0.005, 1.0 * 0.005):
        world = World(read_scene(parsed | {"solver": {"skin": skin, "precision": "double"}}, tmp_path))
        room.append(world.assembly.solver.arrays.tool_list.pairs.capacity)
        for time in (0.1, 0.2, 0.3):
            for command in commands_at(world.scene, time):
                world.apply(command)
            world.step(round((time - world.time) / world.time_step))
        room.append(world.assembly.solver.arrays.tool_list.pairs.capacity)
        last.append(world.observe())
    assert room[0] == room[1] == room[2] < room[3]
    assert last[0].tool("plate").work > 1e-3
    assert last[1].tool("plate").work == pytest.approx(last[0].tool("plate").work, rel=1e-9)
    assert last[1].health.deepest == pytest.approx(last[0].health.deepest, rel=1e-9)
    assert np.abs(last[1].grains.position - last[0].grains.position).max() < 1e-12


@pytest.mark.parametrize("step", [2e-5, 1.93e-5])  # poses end with a step, or anywhere within one
@pytest.mark.parametrize("integrator", ["velocity_verlet", "symplectic_euler"])
def test_work_of_a_tool_that_changes_its_speed_in_contact(make_plate_world, integrator, step):
    """A plate shakes on an elastic grain on a floor and never lets go: nothing is lost or gained, cycle after cycle."""
    further = {"boundaries": floor(-0.012), "restitution": 1.0, "friction": 0.0, "integrator": integrator, "time_step": step}
    pose = {"contact": "smooth", "pose": {"position": [0.0, 0.0, 0.0025]}}
    world = make_plate_world([[0.0, 0.0, -0.007]], pose=pose, **further)
    for cycle in range(21):
        for part in range(1, 11):
            place = np.array([0.0, 0.0, 0.0018 + 0.0001 * np.cos(0.2 * np.pi * part)])
            world.apply(ToolPose("plate", place, NO_TURN, 0.01 * cycle + 0.001 * part))
            world.step(round((0.01 * cycle + 0.001 * part - world.time) / world.time_step))
    seen = world.observe()
    assert seen.health.tool_work == pytest.approx(seen.health.kinetic + seen.health.elastic, rel=0.01)
    assert not seen.health.doubts


def test_grain_on_a_tool_keeps_to_it_whatever_the_poses_and_the_step(make_plate_world):
    """Poses come every millisecond, in which there are 10.75 steps: a tripod that is carried along does not creep ahead."""
    feet = [[0.01, 0.0, 0.0, 0.005], [-0.005, 0.00866, 0.0, 0.005], [-0.005, -0.00866, 0.0, 0.005]]
    bodies = {"tripod": {"spheres": feet, "material": "grain", "pose": {"position": [0.0, 0.0, 0.005]}}}
    further = {"bodies": bodies, "gravity": [0.0, 0.0, -9.81], "friction": 0.5, "time_step": 0.93e-4, "force_time_step": True}
    soft = {"density": 2500.0, "young": 1e6, "poisson": 0.25}
    world = make_plate_world([[0.15, 0.0, 0.1]], pose={"contact": "smooth"}, material=soft, wall=soft, **further)
    world.step(round(0.1 / world.time_step))
    first = world.observe()
    for k in range(1, 301):  # up to 0.3 m/s, then on
        time = 0.001 * k
        x = 0.5 * time**2 if k <= 100 else 0.005 + 0.1 * (time - 0.1)
        world.apply(ToolPose("plate", np.array([x, 0.0, 0.0]), NO_TURN, 0.1 + time))
        world.step(round((0.1 + time - world.time) / world.time_step))
    last = world.observe()
    shift = [seen.body("tripod").position[0] - seen.tool("plate").position[0] for seen in (first, last)]
    assert abs(shift[1] - shift[0]) < 3e-5


def test_contacts_are_the_same_whether_the_way_comes_in_one_pose_or_in_many(make_plate_world):
    """A plate pushes a grain that is braked by its damping; where a pose ends, none is felt as if the plate stood still."""
    seen = []
    for poses in (1, 5):
        world = make_plate_world([[0.0, 0.0, 0.00501]], restitution=0.2, gravity=[0.0, 0.0, -9.81], pose={"contact": "smooth"})
        for k in range(1, poses + 1):
            time = 15 * k // poses * world.time_step
            world.apply(ToolPose("plate", np.array([0.0, 0.0, 0.3 * time]), NO_TURN, time))
            world.step(round((time - world.time) / world.time_step))
        seen.append((world.tool_contacts("plate").force, world.observe().grains.velocity))
    assert np.linalg.norm(seen[0][0]) > 0.0
    assert seen[1][0] == pytest.approx(seen[0][0], rel=1e-6)
    assert seen[1][1] == pytest.approx(seen[0][1], rel=1e-6)
