"""Extremes of tools, of how a scene begins, and of what a user can force."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from sand_sim.border import ToolPose
from sand_sim.study.bed_cases import confined_scene
from sand_sim.study.bench import GRAIN, Bench, box, lattice, plane, run_for
from sand_sim.study.closed_forms import sphere_mass
from sand_sim.study.contact_cases import hit_plane
from sand_sim.study.verdict import Case, Check

_RADIUS = 0.005  # [m]
_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def tool_cases() -> Iterator[Case]:
    """All of them."""
    for young in (1e6, 1e9, 7e10):
        name = f"tool at 10 m/s hits a grain, E = {young:.0e} Pa"
        yield Case("tool", name, partial(strike, young=young, speed=10.0), quick=young != 1e9)
    yield Case("tool", "tool at 10 m/s through a bed, E = 1e+09 Pa", partial(sweep, young=1e9), quick=False)
    yield Case("tool", "tool at 10 m/s through a bed, E = 1e+06 Pa", partial(sweep, young=1e6))
    for ratio in (0.1, 1.0, 5.0):
        name = f"grain dropped on a tool whose particles have {ratio:g} of its radius"
        yield Case("tool", name, partial(rest_on_tool, ratio=ratio), quick=ratio < 1.0)
    for ratio in (0.05, 0.3):
        yield Case("tool", f"impacts on a tool whose particles have {ratio:g} of the radius", partial(hit_tool, ratio=ratio))
    yield Case("tool", "jumps 0.3 m in one step", jump)
    yield Case("tool", "jumps 0.3 m as fast as it may", partial(jump, patient=True))
    yield Case("tool", "soft grains shot at a thin plate", partial(shoot_plate, young=1e5, speed=20.0), violent=True)
    yield Case("tool", "stiff grains shot at a thin plate", partial(shoot_plate, young=7e10, speed=20.0))
    yield Case("start", "tool in the middle of the bed", tool_inside, violent=True)
    yield Case("start", "one grain inside a hollow tool", partial(tool_inside, single=True), violent=True)
    yield Case("start", "overlap of half a radius", overlapped, violent=True)
    yield Case("start", "overlap of half a radius with a wall", partial(overlapped, wall=True), violent=True)
    yield Case("start", "overlap of half a radius, settled first", partial(overlapped, settle=0.05), violent=True)
    yield Case("start", "two grains in one place", partial(overlapped, overlap=2.0), violent=True)
    yield Case("start", "grain behind a wall", behind_wall, violent=True)
    for factor in (2.9, 10.0):
        forced = partial(own_step, factor=factor, force=False)
        yield Case("own time step", f"{factor:g} times the safe one", forced, automatic=False)
    for factor in (10.0, 100.0):
        forced = partial(own_step, factor=factor, force=True)
        yield Case("own time step", f"{factor:g} times the safe one, forced", forced, automatic=False)
    too_fast = partial(hit_plane, young=7e10, speed=100.0, solver={"time_step": 1e-4, "force_time_step": True})
    yield Case("own time step", "grain crosses its own diameter in a step, forced", too_fast, automatic=False)


def _plated(bench: Bench, points, velocity, young: float, particle: float, speed: float, start, **further):
    """A world of grains and a plate 40 x 40 mm, whose face x = 0 is one particle radius before its mesh."""
    return bench.make(
        points,
        _RADIUS,
        velocity,
        grain={"young": young},
        wall={"young": max(young, 1e8)},
        tools=bench.plate([-0.01, -0.02, -0.02], [0.0, 0.02, 0.02], particle, speed, start),
        **further,
    )


def strike(bench: Bench, young: float, speed: float) -> Iterator[Check]:
    """A plate hits a grain at rest; without friction its work is the grain's energy, its impulse the grain's momentum."""
    world = _plated(
        bench, [0.0, 0.001, 0.001], (0.0, 0.0, 0.0), young, 0.003, speed, [-0.01, 0.0, 0.0], restitution=1.0, friction=0.0,
        domain={"low": [-0.1, -0.1, -0.1], "high": [0.3, 0.1, 0.1]},
    )  # fmt: skip
    world.apply(ToolPose("plate", np.array([0.09, 0.0, 0.0]), _NO_TURN, 0.1 / speed))
    run_for(world, 0.04 / speed)
    seen = world.observe()
    momentum = float(seen.grains.mass[0]) * seen.grains.velocity[0]
    impulse = seen.tool("plate").world_force * world.time
    yield Check("impulse of the plate / momentum of the grain", -impulse[0] / momentum[0], 1.0, 1e-6, "conservation")
    work = seen.health.tool_work
    yield Check("kinetic energy / work of the plate", seen.health.kinetic / work, 1.0, 0.01, "conservation")
    # Particles are round, so the grain may leave at an angle, but not faster than straight ahead.
    straight = float(seen.grains.speed[0]) / (2.0 * speed)
    yield Check("speed / twice the plate's", straight, 0.95, 0.06, "elastic impact on a wall")


def sweep(bench: Bench, young: float) -> Iterator[Check]:
    """A plate sweeps through grains afloat: its impulse is their momentum, its work their energy and what they dissipate."""
    points = lattice((6, 4, 4), 2.0 * _RADIUS, (0.0065, -3.0 * _RADIUS, -3.0 * _RADIUS))
    world = _plated(
        bench, points, (0.0, 0.0, 0.0), young, 0.003, 10.0, [-0.005, 0.0, 0.0],
        domain={"low": [-0.5, -0.5, -0.5], "high": [0.6, 0.5, 0.5]},
    )  # fmt: skip
    world.apply(ToolPose("plate", np.array([0.075, 0.0, 0.0]), _NO_TURN, 0.008))
    run_for(world, 0.01)
    seen = world.observe()
    momentum = float(seen.grains.mass.astype(float) @ seen.grains.velocity[:, 0].astype(float))
    impulse = -float(seen.tool("plate").world_force[0]) * world.time
    yield Check("grains left", len(seen.grains), len(points), 0.0, "nothing is lost")
    yield Check("impulse of the plate / momentum of the grains", impulse / momentum, 1.0, 1e-6, "conservation")
    yield Check("energy gained / work", seen.health.gained / seen.health.tool_work, 0.0, 0.01, "conservation")
    yield Check("dissipated / work, between 0 and 1", seen.health.dissipated / seen.health.tool_work, 0.5, 0.5, "conservation")


def rest_on_tool(bench: Bench, ratio: float) -> Iterator[Check]:
    """A grain falls a little on to a tool and comes to rest: the tool carries its weight."""
    particle = ratio * _RADIUS
    gravity, top = 9.81, 1.0001 * (_RADIUS + particle)
    half = 0.02 if ratio <= 1.0 else 0.08
    world = bench.make(
        [0.0, 0.0, top],
        _RADIUS,
        gravity=[0.0, 0.0, -gravity],
        restitution=0.3,
        tools=bench.plate([-half, -half, -2.0 * particle], [half, half, 0.0], particle, 1.0),
        domain={"low": [-0.2] * 3, "high": [0.2] * 3},
    )
    run_for(world, 80.0 * np.sqrt(_RADIUS / gravity))  # it rocks in a dent for long, since nothing resists rolling
    world.observe()
    run_for(world, 0.05)
    seen = world.observe()
    weight = sphere_mass(_RADIUS, GRAIN["density"]) * gravity
    yield Check("grains left", len(seen.grains), 1, 0.0, "nothing is lost")
    yield Check("force on the tool / weight", -seen.tool("plate").world_force[2] / weight, 1.0, 0.01, "equilibrium")
    yield Check("speed / sqrt(g r)", float(seen.grains.speed[0]) / np.sqrt(gravity * _RADIUS), 0.0, 0.01, "rest")
    yield Check("energy gained / m g r", seen.health.gained / (weight * _RADIUS), 0.0, 0.01, "conservation")


def hit_tool(bench: Bench, ratio: float) -> Iterator[Check]:
    """Grains hit a flat tool at nine places: on the mean they rebound as asked."""
    particle, speed, restitution, half = ratio * _RADIUS, 0.3, 0.5, 0.02
    places = np.array([[x, y, 1.02 * _RADIUS + particle] for x in (-0.6, 0.0, 0.6) for y in (-0.6, 0.0, 0.6)])
    places[:, :2] = half * places[:, :2] + np.random.default_rng(6).uniform(-0.2, 0.2, (9, 2)) * _RADIUS
    world = bench.make(
        places,
        _RADIUS,
        [0.0, 0.0, -speed],
        grain={"young": 1e8},
        wall={"young": 1e10},
        restitution=restitution,
        friction=0.0,
        tools=bench.plate([-half, -half, -2.0 * particle], [half, half, 0.0], particle, speed),
        domain={"low": [-0.2] * 3, "high": [0.2] * 3},
    )
    run_for(world, 0.004)
    rebound = float(world.observe().grains.speed.mean()) / speed
    yield Check("mean speed after / before", rebound, restitution, 0.1, "asked; particles are rough")


def jump(bench: Bench, patient: bool = False) -> Iterator[Check]:
    """A tool is sent to the other side of a row of grains at once; it must be rejected, or go there no faster than it may."""
    points = lattice((1, 3, 3), 2.0 * _RADIUS, (0.02, -2.0 * _RADIUS, -2.0 * _RADIUS))
    world = _plated(
        bench, points, (0.0, 0.0, 0.0), 1e8, 0.003, 2.0, [0.0, 0.0, 0.0], domain={"low": [-0.5] * 3, "high": [1.0, 0.5, 0.5]}
    )
    world.apply(ToolPose("plate", np.array([0.3, 0.0, 0.0]), _NO_TURN, None if patient else world.time_step))
    run_for(world, 0.1)
    seen = world.observe()
    yield Check("way of the tool / m", float(seen.tool("plate").position[0]), 0.2, 1e-3, "max_speed 2 m/s")
    ahead = float(np.min(seen.grains.position[:, 0])) - 0.2
    yield Check("grains are ahead of the tool", float(ahead > 0.9 * (_RADIUS + 0.003)), 1.0, 0.0, "nothing passes through")


def shoot_plate(bench: Bench, young: float, speed: float) -> Iterator[Check]:
    """Grains fly at a plate: none may come out behind it."""
    points = lattice((1, 4, 4), 2.1 * _RADIUS, (0.012, -3.15 * _RADIUS, -3.15 * _RADIUS))
    world = _plated(
        bench, points, (-speed, 0.0, 0.0), young, 0.003, 0.1, [0.0, 0.0, 0.0], domain={"low": [-0.5] * 3, "high": [0.5] * 3}
    )
    run_for(world, 0.2 / speed)
    seen = world.observe()
    yield Check("grains behind the plate", float((seen.grains.position[:, 0] < 0.0).sum()), 0.0, 0.0, "nothing passes through")


def tool_inside(bench: Bench, single: bool = False) -> Iterator[Check]:
    """A tool starts in the middle of a bed, or around a grain that touches none of its particles."""
    points = lattice((7, 5, 5), 2.0 * _RADIUS, (-6.0 * _RADIUS, -4.0 * _RADIUS, -4.0 * _RADIUS))
    tools = bench.plate([-0.02] * 3, [0.02] * 3, 0.003, 1.0)
    world = bench.make([0.0, 0.0, 0.0] if single else points, _RADIUS, tools=tools, domain={"low": [-0.3] * 3, "high": [0.3] * 3})
    run_for(world, 0.01)
    yield Check("energy that grains start with / J", world.observe().health.kinetic, 0.0, 1e-9, "nothing moves")
    yield Check("grains inside the tool", float(np.all(np.abs(world.observe().grains.position) < 0.02, axis=1).sum()), 0.0, 0.0)


def overlapped(bench: Bench, overlap: float = 0.5, wall: bool = False, settle: float = 0.0) -> Iterator[Check]:
    """Grains start inside one another or a wall: the energy stored there drives them apart."""
    apart = (2.0 - overlap) * _RADIUS
    points = [[0.0, 0.0, (1.0 - overlap) * _RADIUS]] if wall else [[0.0, 0.0, 0.05], [apart, 0.0, 0.05]]
    world = bench.make(
        points,
        _RADIUS,
        boundaries=[plane()],
        settle={"time": settle},
        domain={"low": [-5.0, -5.0, -0.1], "high": [5.0, 5.0, 5.0]},
    )
    run_for(world, 0.01)
    yield Check("energy that grains start with / J", world.observe().health.kinetic, 0.0, 1e-9, "nothing moves")


def behind_wall(bench: Bench) -> Iterator[Check]:
    """A grain starts outside the box that shall hold it."""
    world = bench.make([[0.02, 0.02, 0.02], [-0.015, 0.02, 0.02]], _RADIUS, boundaries=[box([0, 0, 0], [0.04] * 3)])
    run_for(world, 0.02)
    seen = world.observe()
    yield Check("grains inside the box", float(np.all(seen.grains.position > 0.0, axis=1).sum()), 2.0, 0.0)


def own_step(bench: Bench, factor: float, force: bool) -> Iterator[Check]:
    """A confined bed with a time step of the user's own."""
    scene = confined_scene(bench, 1e7, 0.5, 0.5, 0.05)
    safe = bench.open(scene).assembly.time_step.safe
    scene["solver"] |= {"time_step": factor * safe, "force_time_step": force}
    world = bench.open(scene)
    before = world.observe().health
    world.step(2000)
    after = world.observe().health
    yield Check("kinetic energy / that at the start", after.kinetic / before.kinetic, 0.0, 0.1, "damping")
