"""Reading what a world shows from its device arrays."""

from dataclasses import dataclass

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.assemble import Assembly
from sand_sim.border import BodyReport, GrainCloud, Health, ToolReport, WallReport
from sand_sim.integrator import VERLET
from sand_sim.readout.driven import driven_speed, forces_on_walls, work_of_plungers, work_of_pushes, work_of_tools
from sand_sim.readout.trust import find_doubts
from sand_sim.tool_motion.track import Track

_CONTACT_BEGINS = 1e-3  # of the energy of an impact


@dataclass
class StartEnergy:
    """Against what the energy balance is drawn.

    Attributes:
        total: kinetic, potential and elastic energy at time zero [J].
        height: potential energy at time zero [J].
        rounding: error of the balance [J].
        per_contact: error of the balance for each contact, over the square of its speed [kg].
        grains: in the domain at time zero.
        most_dissipated: largest dissipation seen so far [J].
        fastest: largest speed of grains, tools and plungers seen so far [m/s].
    """

    total: float
    height: float
    rounding: float
    per_contact: float
    grains: int
    most_dissipated: float = 0.0
    fastest: float = 0.0


def start_energy(assembly: Assembly) -> StartEnergy:
    """The balance at time zero and what it may be wrong by.

    A contact that begins in the middle of a step is wrong by up to ``(v dt/(2 d_max))^2.5`` of the energy of its impact, 8e-4 for
    a step of 1/25 contact time. Impacts are as fast as grains or tools have been seen; what a tool may do at most says nothing of
    them.
    """
    sums, mass = assembly.solver.measure(), assembly.solver.arrays.grains.motion.numpy()[:, 3]
    return StartEnergy(
        total=sums.translation + sums.rotation + sums.height + sums.elastic,
        height=sums.height,
        rounding=balance_rounding(assembly),
        grains=count_grains(assembly),
        per_contact=float(_CONTACT_BEGINS * 0.5 * np.median(mass.astype(float))),
    )


def balance_rounding(assembly: Assembly) -> float:
    """What the balance may be wrong by because potential energies are rounded, as if nothing of that cancelled out [J]."""
    lattice, mass = assembly.lattice, assembly.solver.arrays.grains.motion.numpy()[:, 3].astype(float)
    weight, span = mass.sum() * np.linalg.norm(assembly.scene.gravity), np.linalg.norm(lattice.high - lattice.low)
    return float(assembly.recipe.precision.epsilon * weight * 0.5 * span)


def observe_spheres(assembly: Assembly) -> GrainCloud:
    """All spheres in the domain, in the order of the scene's table, as the solver has last measured them.

    Those of one rigid body share its grain's identity; their masses are those that the contact laws see.
    """
    arrays, lattice = assembly.solver.arrays, assembly.lattice
    grains = arrays.grains
    active = grains.active.get()
    place = grains.place.numpy()[:active]
    here = np.flatnonzero(place[:, 3] > 0)
    identity = grains.identity.numpy()[here]
    order = here[np.argsort(identity)]
    place, motion = place[order], arrays.seen_motion.numpy()[order]
    spin = arrays.seen_spin.numpy()[order, :3] if grains.spin is not None else np.zeros_like(motion[:, :3])
    return GrainCloud(
        identity=assembly.grain_of_sphere[np.sort(identity)],
        position=lattice.to_world(place[:, :3]),
        velocity=motion[:, :3],
        spin=spin,
        radius=(place[:, 3] * lattice.quantum).astype(motion.dtype),
        mass=grains.motion.numpy()[order, 3],
        orientation=np.tile([0.0, 0.0, 0.0, 1.0], (len(order), 1)),
    )


def observe_grains(assembly: Assembly, spheres: GrainCloud | None = None) -> GrainCloud:
    """All grains in the domain, in the order of their identities: single spheres, and rigid bodies as one row each.

    Args:
        assembly: the world's.
        spheres: from ``observe_spheres``, if it is at hand.
    """
    spheres = spheres or observe_spheres(assembly)
    bodies, table = assembly.solver.arrays.bodies, assembly.table
    if bodies is None:
        return spheres
    alone = assembly.lone_grain[spheres.identity]
    here = bodies.place.numpy()
    alive = here[:, 3] > 0
    parts = [getattr(spheres, name)[alone] for name in GrainCloud.__dataclass_fields__]
    rows = [
        assembly.grain_of_body[alive],
        assembly.lattice.to_world(here[alive, :3]),
        bodies.seen_velocity.numpy()[alive],
        bodies.seen_spin.numpy()[alive],
        assembly.body_extent[alive],
        table.bodies.mass[alive],
        rotation.multiply(bodies.turn.numpy()[alive], assembly.own_frames[alive]),
    ]
    joined = [np.concatenate([part, row]) for part, row in zip(parts, rows, strict=True)]
    order = np.argsort(joined[0], kind="stable")
    return GrainCloud(*(column[order] for column in joined))


def observe_bodies(assembly: Assembly, cloud: GrainCloud) -> tuple[BodyReport, ...]:
    """Reports of the scene's free rigid bodies that are in the domain, read off the grains."""
    reports, first = [], sum(assembly.fill_numbers)
    for number, model in enumerate(assembly.bodies, first):
        row = np.flatnonzero(cloud.identity == number)
        if len(row):
            position, orientation = model.own_frame(cloud.position[row[0]], cloud.orientation[row[0]])
            velocity, spin = cloud.velocity[row[0]].astype(float), cloud.spin[row[0]].astype(float)
            reports.append(BodyReport(model.body.name, position, orientation, velocity, spin, model.mass))
    return tuple(reports)


def observe_tools(
    assembly: Assembly, tracks: list[Track], cloud: GrainCloud, time: float, means: np.ndarray, swept: np.ndarray
) -> tuple[ToolReport, ...]:
    """Reports of all tools.

    Args:
        assembly: the world's.
        tracks: where the tools are going.
        cloud: the grains now.
        time: now [s].
        means: wrenches on the tools since the last observation, from ``MeanWrenches``, shape (tools, 4, 3) [N], [N m].
        swept: volume that each tool has swept, shape (tools,) [m^3].
    """
    tools = assembly.solver.arrays.tools
    if tools is None:
        return ()
    work, twist = tools.work.numpy(), tools.twist.numpy().copy()
    reports = []
    for index, (model, track) in enumerate(zip(assembly.tools, tracks, strict=True)):  # terrains come after the tools
        position, orientation = track.at(time)
        world_force, world_torque, force, torque = means[index].copy()
        reports.append(
            ToolReport(
                name=model.tool.name,
                position=position,
                orientation=orientation,
                velocity=twist[index, 0],
                spin=twist[index, 1],
                force=force,
                torque=torque,
                world_force=world_force,
                world_torque=world_torque,
                work=float(work[index]),
                carried=float(cloud.mass[model.holds(cloud.position, position, orientation)].sum()),
                swept=float(swept[index]),
            )
        )
    return tuple(reports)


def observe_walls(assembly: Assembly) -> tuple[WallReport, ...]:
    """Forces on all walls at the last step, and where plungers are; terrains come last."""
    arrays, reports = assembly.solver.arrays, []
    if arrays.walls:
        states = arrays.plungers.states.numpy() if arrays.plungers else None
        for one, total, plunger in zip(assembly.walls, forces_on_walls(assembly), arrays.walls.numpy()["plunger"], strict=True):
            offset, speed = (states[plunger]["offset"], states[plunger]["seen"]) if plunger >= 0 else (0.0, 0.0)
            reports.append(WallReport(one.name, total, one.point + offset * one.direction, speed * one.direction))
    for index, ground in enumerate(assembly.grounds, start=len(assembly.tools)):
        reports.append(WallReport(ground.name, arrays.tools.wrench.numpy()[index, 0].copy(), ground.place.copy(), np.zeros(3)))
    return tuple(reports)


def count_grains(assembly: Assembly) -> int:
    """Grains in the domain."""
    arrays = assembly.solver.arrays
    active = arrays.grains.active.get()
    alone = arrays.grains.place.numpy()[:active, 3] > 0
    if arrays.bodies is None:
        return int(alone.sum())
    alone = alone & (arrays.grains.member.numpy()[:active] < 0)
    return int(alone.sum() + (arrays.bodies.place.numpy()[:, 3] > 0).sum())


def outer_force(assembly: Assembly, mass: float) -> tuple[np.ndarray, float]:
    """What weight, walls, terrains, tools and pushes do to the grains now, shape (3,), and the sum of the sizes of it [N].

    Args:
        assembly: the world's, with forces brought up to now (``ExplicitDem.measure``).
        mass: of all grains [kg].
    """
    arrays = assembly.solver.arrays
    outer = mass * np.asarray(assembly.scene.gravity)
    size = np.abs(outer).sum()
    if arrays.wall_list:
        on_grains = arrays.wall_list.force.numpy()[: arrays.wall_list.pairs.get(), :3].astype(float)
        outer, size = outer + on_grains.sum(axis=0), size + np.abs(on_grains).sum()
    if arrays.tools:
        on_tools = arrays.tools.wrench.numpy()[:, 0]
        outer, size = outer - on_tools.sum(axis=0), size + np.abs(on_tools).sum()
    if arrays.bodies and arrays.bodies.pushes:
        pushed = arrays.bodies.pushes.numpy()["acted_force"][arrays.bodies.place.numpy()[arrays.bodies.unpushed :, 3] > 0]
        outer, size = outer + pushed.sum(axis=0), size + np.abs(pushed).sum()
    return outer, float(size)


def momentum_residual(assembly: Assembly) -> float:
    """Net force on the grains now beyond what weight, walls and tools exert, over the sum of their sizes [1].

    Read off the half steps of velocity Verlet, ``F = 2 m (v - w) / dt``, which the solver has just completed; so it tests that
    each grain has gathered all forces between grains, and their reactions.
    """
    arrays, dt = assembly.solver.arrays, assembly.time_step.value
    if assembly.recipe.integrator != VERLET:
        return float("nan")
    grains, bodies = arrays.grains, arrays.bodies
    active = grains.active.get()
    alone = grains.place.numpy()[:active, 3] > 0
    if bodies:
        alone &= grains.member.numpy()[:active] < 0
    seen, half = arrays.seen_motion.numpy()[:active][alone].astype(float), grains.half_motion.numpy()[:active][alone]
    mass, now = seen[:, 3], seen[:, :3]
    if bodies:
        alive = bodies.place.numpy()[:, 3] > 0
        mass = np.append(mass, bodies.motion.numpy()[alive, 3])
        now = np.concatenate([now, bodies.seen_velocity.numpy()[alive]])
        half = np.concatenate([half, bodies.half_motion.numpy()[alive]])
    gained = now - half
    if not gained.any():  # no step has been done
        return 0.0
    force = 2.0 * mass[:, None] * gained / dt
    outer, size = outer_force(assembly, mass.sum())
    size += np.abs(force).sum()
    # Rounding of the velocities shows as a force, which matters where there are hardly any.
    rounding = assembly.recipe.precision.epsilon * np.abs(2.0 * mass[:, None] * now / dt).sum()
    return float(max(np.abs(force.sum(axis=0) - outer).max() - rounding, 0.0) / size) if size > 0.0 else 0.0


def observe_health(assembly: Assembly, start: StartEnergy, beforehand: tuple[str, ...]) -> Health:
    """Error indicators now; brings the solver's measurements up to date.

    Args:
        assembly: the world's.
        start: energies at time zero; its peaks of dissipation and speed are brought up to date.
        beforehand: doubts that were there before the first step.
    """
    chosen, sums = assembly.time_step, assembly.solver.measure()
    work = float(sum(of(assembly).sum() for of in (work_of_tools, work_of_plungers, work_of_pushes)))
    kinetic = sums.translation + sums.rotation
    dissipated = start.total + work - kinetic - sums.height - sums.elastic - sums.carried_off
    start.most_dissipated = max(start.most_dissipated, dissipated)
    start.fastest = max(start.fastest, sums.fastest, driven_speed(assembly))
    slack = start.rounding + sums.touching * start.per_contact * min(start.fastest, chosen.speed) ** 2
    health = Health(
        time_step=chosen.value,
        step_ratio=chosen.value / chosen.safe,
        deepest=sums.deepest,
        kinetic=kinetic,
        potential=sums.height - start.height,
        elastic=sums.elastic,
        tool_work=work,
        dissipated=dissipated,
        momentum_residual=momentum_residual(assembly),
        fastest=sums.fastest,
        contacts=sums.touching,
        retired=int(start.grains) - count_grains(assembly),
        doubts=(),
        gained=max(start.most_dissipated - dissipated - slack, 0.0),
    )
    safe_now = np.inf if sums.fastest <= chosen.speed else assembly.safe_step(sums.fastest, 0.0)
    return find_doubts(health, safe_now, beforehand)
