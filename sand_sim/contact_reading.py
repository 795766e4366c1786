"""Reading the contacts of a tool off its contact list."""

import numpy as np

from sand_sim.assemble import Assembly
from sand_sim.border import ToolContacts


def observe_tool_contacts(assembly: Assembly, name: str) -> ToolContacts:
    """All contacts that act on a tool, as the solver has last measured them.

    The engine keeps of each contact the force and the contact point, which lies inside the grain by half the overlap, or on a
    smooth tool's surface by all of it. Normal and overlap follow from that and the grain's centre.

    Args:
        assembly: the world's.
        name: of the tool.

    Raises:
        KeyError: if there is no such tool.
    """
    index = {model.tool.name: k for k, model in enumerate(assembly.tools)}[name]
    arrays, lattice = assembly.solver.arrays, assembly.lattice
    row, force, moment, lever = _acting(arrays, index)
    place = arrays.grains.place.numpy()[row]
    origin = arrays.tools.states.numpy()["place"][index]
    away = (place[:, :3].astype(float) - origin) * lattice.quantum - lever  # from the contact point to the grain's centre
    distance = np.linalg.norm(away, axis=1)
    return ToolContacts(
        tool=name,
        origin=lattice.to_world(origin),
        point=lattice.to_world(origin) + lever,
        normal=away / distance[:, None],
        force=-force,
        couple=-moment,
        overlap=(1.0 if assembly.tools[index].smooth else 2.0) * (place[:, 3] * lattice.quantum - distance),
        identity=assembly.grain_of_sphere[arrays.grains.identity.numpy()[row]],
    )


def _acting(arrays, tool: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Row of the grain, force [N] and moment [N m] on it, and lever from the tool's origin [m], of each contact that acts."""
    contacts = arrays.tool_list
    number = contacts.pairs.get()
    force, lever = contacts.force.numpy()[:number, :3], arrays.lever.numpy()[:number]
    own = arrays.tools.tool_of.numpy()[contacts.partner.numpy()[:number]] == tool
    chosen = np.flatnonzero(own & (force.any(axis=1) | lever.any(axis=1)))  # of a contact let go both are zero
    moment = np.zeros((len(chosen), 3)) if contacts.moment is None else contacts.moment.numpy()[chosen, :3].astype(float)
    return contacts.owner.numpy()[chosen], force[chosen].astype(float), moment, lever[chosen].astype(float)
