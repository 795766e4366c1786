"""A free rigid body put somewhere else at once, between two steps."""

from dataclasses import replace

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.assemble import Assembly
from sand_sim.border import BodyReport, CommandError, GrainCloud
from sand_sim.changes.carrying_over import rebuild
from sand_sim.changes.clearance import find_obstacles
from sand_sim.changes.exchange import FASTEST
from sand_sim.engine.pushes import forget_push
from sand_sim.engine.reviving import revive
from sand_sim.grain_table import GrainTable
from sand_sim.readout.observing import observe_bodies, observe_grains
from sand_sim.scene.stable_step import DEEP
from sand_sim.scene.types import Body, Pose


def find_body(assembly: Assembly, name: str) -> int:
    """Number of a body among those of the scene.

    Raises:
        CommandError: if there is no such body.
    """
    names = [model.body.name for model in assembly.bodies]
    if name not in names:
        raise CommandError("unknown_body", f"body '{name}' is unknown; known are {', '.join(names) or 'none'}")
    return names.index(name)


def read_numbers(label: str, values, number: int) -> np.ndarray:
    """So many finite numbers.

    Raises:
        CommandError: if they are none, which names them by the label.
    """
    try:
        values = np.asarray(values, float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (number,):
        raise CommandError("misshapen", f"{label} must be {number} numbers")
    if not np.isfinite(values).all():
        raise CommandError("not_finite", f"{label} must be finite")
    return values


def read_body(assembly: Assembly, spheres: GrainCloud, name: str, position, orientation, velocity, spin) -> GrainTable:
    """A body and its spheres as they shall be.

    Args:
        assembly: the world's, measured.
        spheres: from ``observe_spheres``.
        name: of the body.
        position: of its own frame's origin, shape (3,) [m].
        orientation: of its own frame, shape (4,).
        velocity: of its centre of mass, shape (3,) [m/s].
        spin: world frame, shape (3,) [rad/s]; of all, what is None stays as it is, where it has left the domain as in the scene.

    Raises:
        CommandError: if there is no such body, the numbers make no sense, or it would be outside of the domain or too fast.
    """
    model, label = assembly.bodies[find_body(assembly, name)], f"body '{name}'"
    seen = {report.name: report for report in observe_bodies(assembly, observe_grains(assembly, spheres))}
    here = seen.get(name) or _as_in_scene(model.body)
    asked = {"position": (position, 3), "orientation": (orientation, 4), "velocity": (velocity, 3), "spin": (spin, 3)}
    position, orientation, velocity, spin = (
        read_numbers(f"{label}: {field}", getattr(here, field) if values is None else values, number)
        for field, (values, number) in asked.items()
    )
    try:
        pose = Pose(tuple(position.tolist()), tuple(rotation.unit(orientation).tolist()))
    except ValueError as error:
        raise CommandError("zero_quaternion", f"{label}: orientation is {error}") from None
    moved = replace(model.body, pose=pose, velocity=tuple(velocity), spin=tuple(spin))
    rows, lattice = replace(model, body=moved).table(0), assembly.lattice
    if not np.all((rows.bodies.position > lattice.low) & (rows.bodies.position < lattice.high)):
        box = f"{np.round(lattice.low, 3).tolist()} to {np.round(lattice.high, 3).tolist()} m"
        raise CommandError(
            "outside", f"{label}: its centre would be at {rows.bodies.position[0].tolist()} m, the domain is {box}"
        )
    if np.any(np.linalg.norm(rows.velocity, axis=1) * assembly.time_step.value > FASTEST * rows.radius):
        raise CommandError("too_fast", f"{label}: a sphere of it would cross half its radius in a step; make it slower")
    return rows


def put_body(assembly: Assembly, name: str, rows: GrainTable, spheres: GrainCloud, poses: list) -> None:
    """Put a body where there is room for it; nothing remembers it.

    Args:
        assembly: the world's, measured.
        name: of the body.
        rows: from ``read_body``.
        spheres: from ``observe_spheres``.
        poses: position [m] and orientation of each tool now.

    Raises:
        CommandError: if it overlaps anything by more than ``DEEP`` of a radius; nothing is changed then.
    """
    number = sum(assembly.fill_numbers) + find_body(assembly, name)
    others = spheres.identity != number
    rest = GrainCloud(*(getattr(spheres, field)[others] for field in GrainCloud.__dataclass_fields__))
    if blocked := find_obstacles(assembly, rest, poses, rows.position, (1.0 - DEEP) * rows.radius, of_body=name):
        raise CommandError("blocked", f"body '{name}' has no room there: it overlaps {', '.join(blocked)}; put it elsewhere")
    table, own = assembly.table, np.flatnonzero(assembly.grain_of_sphere == number)
    bodies = _with(table.bodies, table.body[own[:1]], rows.bodies, ("position", "orientation", "velocity", "spin"))
    moved = _with(replace(table, bodies=bodies), own, rows, ("position", "velocity", "spin"))
    begun = rebuild(assembly, moved, assembly.tools)
    assembly.solver.remove(own)
    assembly.solver.renew_lists()
    revive(assembly.solver, begun.solver.take_state(), own)
    forget_push(assembly.solver.arrays.bodies.pushes, find_body(assembly, name))


def _as_in_scene(body: Body) -> BodyReport:
    return BodyReport(body.name, body.pose.position, body.pose.orientation, body.velocity, body.spin, 0.0)


def _with(table, at: np.ndarray, rows, names: tuple[str, ...]):
    """A table that has some columns of other rows in the place of its own."""
    columns = {name: getattr(table, name).copy() for name in names}
    for name, column in columns.items():
        column[at] = getattr(rows, name)
    return replace(table, **columns)
