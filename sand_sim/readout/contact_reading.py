"""Reading contacts off the contact lists of the engine."""

import numpy as np

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import GrainContacts, ToolContacts
from sand_sim.engine.contact_list import ContactList


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


def observe_grain_contacts(assembly: Assembly) -> GrainContacts:
    """All contacts between grains, as the solver has last measured them.

    Args:
        assembly: the world's.
    """
    arrays, lattice = assembly.solver.arrays, assembly.lattice
    contacts = arrays.pair_list
    acting = np.flatnonzero(contacts.force.numpy()[: contacts.pairs.get(), :3].any(axis=1))
    first, second = contacts.owner.numpy()[acting], contacts.partner.numpy()[acting]
    place = arrays.grains.place.numpy()
    identity = assembly.grain_of_sphere[arrays.grains.identity.numpy()]
    # Differences of whole numbers are exact where positions in metres would be rounded.
    apart = (place[first, :3].astype(float) - place[second, :3]) * lattice.quantum
    distance = np.linalg.norm(apart, axis=1)
    upwards = np.tile([0.0, 0.0, 1.0], (len(acting), 1))  # where centres coincide, as the contact laws have it
    normal = np.divide(apart, distance[:, None], out=upwards, where=distance[:, None] > 0.0)
    overlap = (place[first, 3].astype(float) + place[second, 3]) * lattice.quantum - distance
    arm = place[first, 3] * lattice.quantum - 0.5 * overlap
    return GrainContacts(
        first=identity[first],
        second=identity[second],
        point=lattice.to_world(place[first, :3]) - normal * arm[:, None],
        normal=normal,
        force=contacts.force.numpy()[acting, :3].astype(float),
        couple=_moments(contacts, acting),
        overlap=overlap,
    )


def _acting(arrays, tool: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Row of the grain, force [N] and moment [N m] on it, and lever from the tool's origin [m], of each contact that acts."""
    contacts = arrays.tool_list
    number = contacts.pairs.get()
    force, lever = contacts.force.numpy()[:number, :3], arrays.lever.numpy()[:number]
    own = arrays.tools.tool_of.numpy()[contacts.partner.numpy()[:number]] == tool
    chosen = np.flatnonzero(own & (force.any(axis=1) | lever.any(axis=1)))  # of a contact let go both are zero
    return contacts.owner.numpy()[chosen], force[chosen].astype(float), _moments(contacts, chosen), lever[chosen].astype(float)


def _moments(contacts: ContactList, chosen: np.ndarray) -> np.ndarray:
    return np.zeros((len(chosen), 3)) if contacts.moment is None else contacts.moment.numpy()[chosen, :3].astype(float)
