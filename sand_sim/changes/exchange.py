"""Grains that are to be put into a running world or taken out of it: what they must keep to."""

import numpy as np

from sand_sim.assembly.assemble import Assembly, material_order
from sand_sim.border import CommandError, GrainCloud
from sand_sim.changes.clearance import find_obstacles
from sand_sim.grain_table import GrainTable
from sand_sim.readout.cloud_selection import in_box

FASTEST = 0.5  # radii in a step, beyond which a grain would be taken for a blown-up run


def read_grains(assembly: Assembly, position, radius, material: str | None, velocity) -> GrainTable:
    """Check what grains are asked for, each by itself.

    Args:
        assembly: the world's.
        position: shape (n, 3) [m].
        radius: one number or shape (n,) [m].
        material: name; None where the scene has grains of one material only.
        velocity: one number, shape (3,) or (n, 3) [m/s].

    Raises:
        CommandError: if shapes or numbers make no sense, the material has no grains in the scene, a radius is below the
            smallest that the time step was chosen for, or a grain is outside of the domain or too fast.
    """
    known = [name for name in material_order(assembly.scene) if name in assembly.smallest]
    if material is None and len(known) == 1:
        material = known[0]
    if material not in known:
        raise CommandError("unknown_material", f"material '{material}' has no grains in this scene; known are {', '.join(known)}")
    try:
        position = np.atleast_2d(np.asarray(position, float))
        number = len(position) if position.size else 0
        position = position.reshape(number, 3)
        radius = np.broadcast_to(np.asarray(radius, float), number)
        velocity = np.broadcast_to(np.asarray(velocity, float), (number, 3))
    except (TypeError, ValueError) as error:
        raise CommandError("shape", f"grains: positions (n, 3), radii (n,) and velocities (n, 3) must fit: {error}") from None
    if not (np.isfinite(position).all() and np.isfinite(velocity).all() and np.isfinite(radius).all()):
        raise CommandError("not_finite", "grains: positions, radii and velocities must be finite")
    least = assembly.smallest[material]
    small = radius < least * (1.0 - 1e-6)
    if small.any():
        raise CommandError(
            "too_small",
            f"radius: {small.sum()} of {number} grains are smaller than {least:.6g} m, the smallest of '{material}' in the "
            "scene, which time step and tools were made for; ask for larger ones, or give the scene a fill with such grains",
        )
    outside = ~np.all((position > assembly.lattice.low) & (position < assembly.lattice.high), axis=1)
    if outside.any():
        box = f"{assembly.lattice.low.round(6).tolist()} to {assembly.lattice.high.round(6).tolist()} m"
        raise CommandError("outside", f"{_some(outside, position)} outside of the domain, {box}")
    fast = np.linalg.norm(velocity, axis=1) * assembly.time_step.value > FASTEST * radius
    if fast.any():
        most = FASTEST * float(radius[fast].min()) / assembly.time_step.value
        raise CommandError("too_fast", f"{_some(fast, position)} too fast for the time step; at most {most:.3g} m/s")
    density = assembly.scene.materials[assembly.scene.material_index(material)].density
    kind = np.full(number, material_order(assembly.scene).index(material))
    return GrainTable.of_spheres(position, velocity.copy(), np.zeros((number, 3)), radius.copy(), np.full(number, density), kind)


def check_room(assembly: Assembly, spheres: GrainCloud, poses: list, rows: GrainTable) -> None:
    """See that new grains overlap nothing.

    Raises:
        CommandError: with how many overlap what, and where the first of them are.
    """
    blocked = find_obstacles(assembly, spheres, poses, rows.position, rows.radius)
    if blocked:
        every = np.unique(np.concatenate(list(blocked.values())))
        parts = [f"{len(which)} overlap {name} (first at {_at(rows.position[which[0]])})" for name, which in blocked.items()]
        raise CommandError("blocked", f"{len(every)} of {len(rows)} grains have no room: {'; '.join(parts)}; nothing was added")


def find_grains(assembly: Assembly, cloud: GrainCloud, identity, box) -> np.ndarray:
    """Identities of the grains meant by a list of them, or by the corners of a box.

    Raises:
        CommandError: if there is no such grain, or not just one of the two is given.
    """
    if (identity is None) == (box is None):
        raise CommandError("shape", "remove_grains: give either identities or a box")
    if box is not None:
        try:
            low, high = box
            inside = in_box(cloud.position, low, high)
        except (TypeError, ValueError) as error:
            raise CommandError("shape", f"remove_grains: {error}") from None
        first = sum(assembly.fill_numbers)
        named = (cloud.identity >= first) & (cloud.identity < first + len(assembly.bodies))
        return cloud.identity[inside & ~named]
    try:
        asked = np.unique(np.asarray(identity).ravel())
    except (TypeError, ValueError) as error:
        raise CommandError("shape", f"remove_grains: identities: {error}") from None
    if len(asked) and asked.dtype.kind not in "iu":
        raise CommandError("shape", "remove_grains: identities must be whole numbers")
    unknown = asked[~np.isin(asked, cloud.identity)]
    if len(unknown):
        some = ", ".join(str(one) for one in unknown[:5]) + (", ..." if len(unknown) > 5 else "")
        raise CommandError("unknown_grain", f"{len(unknown)} of {len(asked)} grains are not in the domain: {some}")
    return asked


def _some(which: np.ndarray, position: np.ndarray) -> str:
    return f"{which.sum()} of {len(which)} grains (first at {_at(position[np.flatnonzero(which)[0]])}) are"


def _at(place: np.ndarray) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in place)}] m"
