"""Force and torque on a free rigid body, from one step to the next."""

import numpy as np

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import CommandError
from sand_sim.changes.body_placing import find_body, read_numbers
from sand_sim.changes.exchange import FASTEST
from sand_sim.engine.pushes import set_push


def push(assembly: Assembly, name: str, force, torque) -> None:
    """Push a body from the next step on.

    Args:
        assembly: the world's.
        name: of the body.
        force: at the origin of its own frame, world frame, shape (3,) [N].
        torque: about that origin, world frame, shape (3,) [N m].

    Raises:
        CommandError: if there is no such body, it has left the domain, or the numbers make no sense, or tear it away by half
            the radius of a sphere in one step; nothing is changed then.
    """
    index, label = find_body(assembly, name), f"body '{name}'"
    force, torque = read_numbers(f"{label}: force", force, 3), read_numbers(f"{label}: torque", torque, 3)
    bodies = assembly.solver.arrays.bodies
    if bodies.place.numpy()[bodies.unpushed + index, 3] == 0:
        raise CommandError("outside", f"{label} has left the domain; 'place_body' puts it back")
    model, dt = assembly.bodies[index], assembly.time_step.value
    reach = np.linalg.norm(model.shape.centres, axis=1).max()
    with np.errstate(over="ignore", invalid="ignore"):
        turning = np.linalg.norm(torque) + np.linalg.norm(model.lever) * np.linalg.norm(force)
        gained = np.linalg.norm(force) / model.mass + reach * turning / (model.mass * model.gyration.min())
        if not gained * dt**2 < FASTEST * model.shape.radii.min():
            raise CommandError(
                "too_strong", f"{label}: would be torn away by {force.tolist()} N, {torque.tolist()} N m in one step"
            )
    set_push(bodies.pushes, index, force, torque)
