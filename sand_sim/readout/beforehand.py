"""What is doubtful about a world before its first step: overlaps, surfaces too fine, lengths too small for its numbers."""

from collections.abc import Iterator

import numpy as np

from sand_sim.assembly.assemble import Assembly, material_order
from sand_sim.readout.driven import wall_numbers
from sand_sim.readout.observing import observe_grains
from sand_sim.scene.pairing import effective_young, pair_numbers
from sand_sim.scene.stable_step import DEEP, particles_touched

_CROWD = 2.0  # spheres of a surface that a grain may touch at once in an impact
_DASHPOTS = 50.0  # times its own speed: the most that dashpots in a dense bed may give a grain
_COARSE = 0.1  # resolution over the overlap under a grain's own weight, or of an impact at the expected speed


def find_overlap(assembly: Assembly) -> tuple[str, ...]:
    """Doubts that grains start inside one another, a wall or a tool; contact lists must be up to date."""
    sums, doubts = assembly.solver.measure(), []
    driven = _driven(assembly)
    if sums.deepest > DEEP or driven > _harmless(assembly):
        share = f"{100.0 * sums.deepest:.2g} % of a radius"
        stored = f"the {sums.elastic:.3g} J stored there drive them apart"
        doubts.append(f"grains overlap {_strained(assembly)} by {share} at the start; {stored}, at some {driven:.2g} m/s")
    position = observe_grains(assembly).position
    for tool in assembly.tools:
        inside = int((tool.distance(position) < -tool.margin).sum())
        if inside:
            doubts.append(f"grains start inside tool '{tool.tool.name}' ({inside} of them), where nothing touches them")
    return tuple(doubts)


def _strained(assembly: Assembly) -> str:
    """What the grain overlaps in the contact that stores most energy."""
    arrays, most = assembly.solver.arrays, {}
    for name, contacts in arrays.lists.items():
        energy = arrays.energy[name].numpy()[: contacts.pairs.get()]
        if len(energy):
            at = int(np.argmax(energy))
            most[name] = energy[at], int(contacts.partner.numpy()[at])
    name = max(most, key=most.get)
    partner = most[name][1]
    if name == "wall":
        return assembly.walls[wall_numbers(assembly, partner)].label
    if name == "tool":
        return [*assembly.tools, *assembly.grounds][arrays.tools.tool_of.numpy()[partner]].label
    return "one another"


def _harmless(assembly: Assembly) -> float:
    """A speed [m/s] that grains would have anyway: as expected, from dashpots, or by a fall of their radius."""
    table, gravity = assembly.table, float(np.linalg.norm(assembly.scene.gravity))
    given, fall = np.linalg.norm(table.velocity, axis=1).max(), np.sqrt(2.0 * gravity * table.radius.min())
    return float(assembly.time_step.speed + _DASHPOTS * given + fall)


def _driven(assembly: Assembly) -> float:
    """Highest speed that energy stored in contacts can give a grain, ``F/sum(f) sqrt(2 E/m)`` [m/s]; zero where forces balance.

    F is the sum of contact forces f and weight, E the energy of the contacts, half of it where both sides are grains.

    Args:
        assembly: whose solver has just measured.
    """
    table, arrays = assembly.table, assembly.solver.arrays
    mass = np.zeros(table.grains)
    mass[assembly.lone_grain], mass[assembly.grain_of_body] = table.mass[table.lone], table.bodies.mass
    grain = assembly.grain_of_sphere[arrays.grains.identity.numpy()]
    force = mass[:, None] * np.asarray(assembly.scene.gravity)
    size, stored = np.linalg.norm(force, axis=1), np.zeros(table.grains)
    for name, contacts in arrays.lists.items():
        number = contacts.pairs.get()
        acting = np.flatnonzero(contacts.force.numpy()[:number].any(axis=1))
        push = contacts.force.numpy()[acting, :3].astype(float)
        energy = np.maximum(arrays.energy[name].numpy()[acting].astype(float), 0.0)
        sides = [(contacts.owner, 1.0), (contacts.partner, -1.0)] if name == "pair" else [(contacts.owner, 1.0)]
        for spheres, sign in sides:
            met = grain[spheres.numpy()[acting]]
            np.add.at(force, met, sign * push)
            np.add.at(size, met, np.linalg.norm(push, axis=1))
            np.add.at(stored, met, energy / len(sides))
    share = np.linalg.norm(force, axis=1) / np.where(size > 0.0, size, 1.0)
    return float((share * np.sqrt(2.0 * stored / mass)).max())


def find_fine_surfaces(assembly: Assembly) -> tuple[str, ...]:
    """Doubts that surfaces have spheres so fine that grains touch many at once, each with springs and dashpots of its own.

    The largest grain touches most.
    """
    doubts, largest = [], int(np.argmax(assembly.table.radius))
    radius = float(assembly.table.radius[largest])
    material = material_order(assembly.scene)[assembly.table.material[largest]]
    for spheres, other, ball, spacing, field in _layers(assembly):
        overlap = min(_impact_overlap(assembly, material, radius, other), DEEP * radius)
        touched = particles_touched(radius, ball, spacing, overlap)
        if touched > _CROWD:
            doubts.append(
                f"grains touch about {touched:.0f} {spheres} at once, so contacts are stiffer and restitution lower than "
                f"asked; take {field} of at least {_coarse_enough(radius, overlap, spacing / ball):.2g} m"
            )
    return tuple(doubts)


def _coarse_enough(radius: float, overlap: float, spread: float) -> float:
    """Radius [m] from which on a grain touches few enough spheres ``spread`` radii apart, by ``particles_touched``."""
    share = particles_touched(radius, 0.0, spread, overlap) / (_CROWD * radius)
    return 1.05 * 0.5 * (share + np.sqrt(share * (share + 4.0 * radius)))  # more, because it is shown rounded


def _layers(assembly: Assembly) -> Iterator[tuple[str, str, float, float, str]]:
    """Spheres that make up surfaces: what they are called, their material, radius and spacing [m], and what to take instead."""
    bodies = [(f"particles of tool '{one.tool.name}'", one.tool.material, one.body) for one in assembly.tools if not one.smooth]
    bodies += [(f"particles of terrain '{one.name}'", one.material, one.body) for one in assembly.grounds if not one.smooth]
    for spheres, material, body in bodies:
        yield spheres, material, body.radius, body.spacing, "contact: smooth, or a particle_radius"
    field = "a rough.radius, and half the rough.spacing,"
    for wall in assembly.scene.boundaries:
        if wall.rough:
            yield f"virtual spheres of '{wall.name}'", wall.material, wall.rough.radius, wall.rough.spacing, field


def find_coarseness(assembly: Assembly) -> tuple[str, ...]:
    """The doubt that positions are not resolved finely enough for the overlaps to expect."""
    resolution, overlap = _resolution(assembly), _smallest_overlap(assembly)
    if resolution <= _COARSE * overlap:
        return ()
    remedy = "" if assembly.recipe.precision.name == "double" else " or solver.precision double"
    return (
        f"positions are resolved to {resolution:.2g} m, but the smallest grains overlap by only {overlap:.2g} m; "
        f"take a smaller domain, softer grains{remedy}",
    )


def _resolution(assembly: Assembly) -> float:
    """Rounding of the distance between a grain and what it touches [m]."""
    lattice, epsilon = assembly.lattice, assembly.recipe.precision.epsilon
    return max([lattice.quantum, *(epsilon * model.extent for model in (*assembly.tools, *assembly.grounds))])


def _smallest_overlap(assembly: Assembly) -> float:
    """Overlap of the smallest grains [m]: under their weight, ``(3 m g/(4 E* sqrt(R)))^(2/3)``, without gravity in an impact."""
    scene, overlaps = assembly.scene, []
    gravity = float(np.linalg.norm(scene.gravity))
    for name, radius in assembly.smallest.items():
        material = scene.materials[scene.material_index(name)]
        weight = material.density * 4.0 / 3.0 * np.pi * radius**3 * gravity
        if scene.contact.normal == "linear":
            static = weight / pair_numbers(scene, name, name).given["stiffness"]
        else:
            static = (0.75 * weight / (effective_young(material, material) * np.sqrt(radius))) ** (2.0 / 3.0)
        overlaps.append(static if gravity else _impact_overlap(assembly, name, radius, name))
    return float(min(overlaps))


def _impact_overlap(assembly: Assembly, grain: str, radius: float, other: str) -> float:
    """Overlap of a grain in an impact on something flat at the expected speed, ``(15 m v^2/(16 E* sqrt(R)))^(2/5)`` [m]."""
    scene = assembly.scene
    material, met = (scene.materials[scene.material_index(name)] for name in (grain, other))
    mass, speed = material.density * 4.0 / 3.0 * np.pi * radius**3, assembly.time_step.speed
    if scene.contact.normal == "linear":
        return float(speed * np.sqrt(mass / pair_numbers(scene, grain, other).given["stiffness"]))
    return float((0.9375 * mass * speed**2 / (effective_young(material, met) * np.sqrt(radius))) ** 0.4)
