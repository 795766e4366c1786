"""Reading what a world shows from its device arrays."""

import numpy as np

from sand_sim import rotation
from sand_sim.assemble import Assembly, ToolModel
from sand_sim.border import GrainCloud, Health, ToolReport, WallReport
from sand_sim.engine.explicit_dem import Sums
from sand_sim.track import Track
from sand_sim.trust import find_doubts


def observe_grains(assembly: Assembly) -> GrainCloud:
    """All grains in the domain, in the order of their identities, as the solver has last measured them."""
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
        identity=np.sort(identity),
        position=lattice.to_world(place[:, :3]),
        velocity=motion[:, :3],
        spin=spin,
        radius=(place[:, 3] * lattice.quantum).astype(motion.dtype),
        mass=motion[:, 3],
    )


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


def observe_health(assembly: Assembly, sums: Sums, start_energy: float, start_height: float) -> Health:
    """Error indicators now.

    Args:
        assembly: the world's.
        sums: of now.
        start_energy: kinetic, potential and elastic energy at time zero [J].
        start_height: potential energy at time zero [J].
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
        retired=int(arrays.grains.retired.numpy()[0]),
        doubts=(),
    )
    return find_doubts(health, chosen.speed)


def _mass_inside(cloud: GrainCloud, model: ToolModel, position: np.ndarray, back: np.ndarray) -> float:
    low, high = model.mesh.bounds
    near = np.linalg.norm(cloud.position - position, axis=1) < model.extent
    local = rotation.rotate(back, cloud.position[near] - position)
    return float(cloud.mass[near][np.all((local > low) & (local < high), axis=1)].sum())
