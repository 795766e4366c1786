"""Reading what a world shows from its device arrays."""

import numpy as np

from sand_sim import rotation
from sand_sim.assemble import Assembly, ToolModel
from sand_sim.border import BodyReport, GrainCloud, Health, ToolReport, WallReport
from sand_sim.engine.explicit_dem import Sums
from sand_sim.track import Track
from sand_sim.trust import find_doubts


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
        bodies.turn.numpy()[alive],
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
    assembly: Assembly, tracks: list[Track], cloud: GrainCloud, time: float, means: np.ndarray
) -> tuple[ToolReport, ...]:
    """Reports of all tools.

    Args:
        assembly: the world's.
        tracks: where the tools are going.
        cloud: the grains now.
        time: now [s].
        means: force and torque on each tool since the last observation, world frame, shape (tools, 2, 3) [N], [N m].
    """
    tools = assembly.solver.arrays.tools
    if tools is None:
        return ()
    work = tools.work.numpy()
    reports = []
    for index, (model, track) in enumerate(zip(assembly.tools, tracks, strict=True)):
        position, orientation = track.at(time)
        moving = track.moving_at(time - 0.5 * assembly.time_step.value)
        back = rotation.inverse(orientation)
        force, torque = means[index]
        reports.append(
            ToolReport(
                name=model.tool.name,
                position=position,
                orientation=orientation,
                velocity=track.velocity if moving else np.zeros(3),
                spin=track.spin if moving else np.zeros(3),
                force=rotation.rotate(back, force),
                torque=rotation.rotate(back, torque),
                world_force=force.copy(),
                work=float(work[index]),
                carried=_mass_inside(cloud, model, position, back),
            )
        )
    return tuple(reports)


def observe_walls(assembly: Assembly) -> tuple[WallReport, ...]:
    """Forces on all walls at the last step."""
    contacts = assembly.solver.arrays.wall_list
    if contacts is None:
        return ()
    number = contacts.pairs.get()
    wall, force = contacts.partner.numpy()[:number], contacts.force.numpy()[:number].astype(float)
    totals = np.column_stack([np.bincount(wall, force[:, k], len(assembly.walls)) for k in range(3)])
    return tuple(WallReport(one.name, -total) for one, total in zip(assembly.walls, totals, strict=True))


def observe_health(assembly: Assembly, sums: Sums, start_energy: float, start_height: float, retired: int) -> Health:
    """Error indicators now.

    Args:
        assembly: the world's.
        sums: of now.
        start_energy: kinetic, potential and elastic energy at time zero [J].
        start_height: potential energy at time zero [J].
        retired: grains that have left the domain.
    """
    arrays, chosen = assembly.solver.arrays, assembly.time_step
    work = float(arrays.tools.work.numpy().sum()) if arrays.tools else 0.0
    kinetic = sums.translation + sums.rotation
    health = Health(
        time_step=chosen.value,
        step_ratio=chosen.value / chosen.safe,
        deepest=sums.deepest,
        kinetic=kinetic,
        potential=sums.height - start_height,
        elastic=sums.elastic,
        tool_work=work,
        dissipated=start_energy + work - kinetic - sums.height - sums.elastic,
        fastest=sums.fastest,
        contacts=sums.touching,
        retired=retired,
        doubts=(),
    )
    return find_doubts(health, chosen.speed)


def _mass_inside(cloud: GrainCloud, model: ToolModel, position: np.ndarray, back: np.ndarray) -> float:
    low, high = model.mesh.bounds
    near = np.linalg.norm(cloud.position - position, axis=1) < model.extent
    local = rotation.rotate(back, cloud.position[near] - position)
    return float(cloud.mass[near][np.all((local > low) & (local < high), axis=1)].sum())
