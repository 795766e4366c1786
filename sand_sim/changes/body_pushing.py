"""Force and torque on a free rigid body, from one step to the next."""

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import CommandError
from sand_sim.changes.body_placing import find_body, read_numbers
from sand_sim.engine.pushes import set_push


def push(assembly: Assembly, name: str, force, torque) -> None:
    """Push a body from the next step on.

    Args:
        assembly: the world's.
        name: of the body.
        force: at the origin of its own frame, world frame, shape (3,) [N].
        torque: about that origin, world frame, shape (3,) [N m].

    Raises:
        CommandError: if there is no such body, it has left the domain, or the numbers make no sense; nothing is changed then.
    """
    index, label = find_body(assembly, name), f"body '{name}'"
    force, torque = read_numbers(f"{label}: force", force, 3), read_numbers(f"{label}: torque", torque, 3)
    bodies = assembly.solver.arrays.bodies
    if bodies.place.numpy()[bodies.unpushed + index, 3] == 0:
        raise CommandError("outside", f"{label} has left the domain; 'place_body' puts it back")
    set_push(bodies.pushes, index, force, torque)
