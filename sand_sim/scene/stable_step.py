"""How large a time step a stiff, damped contact network bears: the linear stability of the integrators.

Symplectic Euler, with damping taken at the velocity of half a step ago, turns ``x'' = -w^2 x - c x'`` into
``x_(n+1) = (2 - w^2 dt^2 - c dt) x_n - (1 - c dt) x_(n-1)``. By Jury's criterion both roots of its characteristic polynomial lie
inside the unit circle if and only if

    ``dt < 2/w (sqrt(1 + zeta^2) - zeta)``  with ``zeta = c/(2 w)``.

Without damping this is the well known ``2/w``; damping tightens it, in the limit to ``2/c``. Velocity Verlet takes damping at a
velocity predicted with the acceleration of the step before; it has a root at -1 where ``w^2 dt^2 + 4 c dt = 4``, which is the
same with ``2 zeta`` in place of zeta. Beyond the limit an oscillation that changes sign at every step grows.

In a network of spheres in contact, ``w^2`` is at most the largest eigenvalue of the stiffness over the mass matrix. Let each
sphere have N contacts of normal stiffness k and tangential stiffness t k, evenly spread over all directions. The energy of a
contact is at most twice the sum of what its two partners would store in it alone, hence (Gershgorin)

    ``w^2 <= 2 N (1 + 2 t)/3 k/m`` for translation, ``w^2 <= 2 N (2 t/3) (5/2) k/m`` for rotation (``I = 2/5 m r^2``),

and the same with dashpots in place of springs for c. At an immovable surface the factor 2 is missing and all N normals point the
same way: ``w^2 <= N k/m``, with friction ``(1 + 5/2) N t k/m``.

A plunger that a force moves is a mass M with as many contacts as grains can come under it. All grains, of mass m each, weigh
s = n m/M times as much, so that it alone would have ``w^2 = s k/m``; a grain that it presses on to walls in N contacts adds N.

Source: Jury 1964 (Theory and Application of the z-Transform Method); for granular networks O'Sullivan & Bray 2004,
https://doi.org/10.1108/02644400410519794, who find 2/w of the network below that of a single contact by a factor of sqrt(N).
"""

import math
from collections.abc import Iterator, Sequence

from sand_sim.contact.damping import damping_ratio
from sand_sim.contact.law import PairNumbers
from sand_sim.contact.model import ContactModel
from sand_sim.integrator import VERLET
from sand_sim.scene.pairing import pair_numbers
from sand_sim.scene.side_springs import friction_spring, rolling_spring
from sand_sim.scene.types import SMOOTH, Scene

DEEP = 0.1  # overlap over radius up to which a step shall be stable; deeper ones are reported as not to be trusted

COORDINATION = 9.0  # contacts of a sphere: 6 to 7 in a jammed packing on the mean, 11 at most
CRYSTAL = 12.0  # the same in a crystal
SURFACE_CONTACTS = 2.0  # a grain in a corner of three walls is no stiffer than two that face the same way
TANGENT = 1.0  # at most: Mindlin's k_t / k_n is 2 (1 - nu)/(2 - nu)


def stable_step(square: float, damping: float, integrator: str) -> float:
    """Largest stable step for ``x'' = -square x - damping x'`` [s].

    Args:
        square: ``w^2`` [1/s^2].
        damping: ``c`` [1/s].
        integrator: name.
    """
    frequency = math.sqrt(square)
    ratio = 0.5 * damping / frequency * (2.0 if integrator == VERLET else 1.0)
    return 2.0 / (frequency * (math.sqrt(1.0 + ratio * ratio) + ratio))


def spring_and_dashpot(model: ContactModel, pair: PairNumbers, radius: float, mass: float, overlap: float) -> tuple[float, float]:
    """Tangent stiffness [N/m] and damping [N s/m] of a contact, the larger of those along and across the normal.

    Args:
        model: laws.
        pair: of the two materials.
        radius: effective [m].
        mass: effective [kg].
        overlap: at which the stiffness is taken [m].
    """
    given = pair.given
    stiffness = given["stiffness"] if model.normal == "linear" else 2.0 * pair.young * math.sqrt(radius * overlap)
    if model.normal == "viscoelastic":
        damping = stiffness * given["viscous_time"]
    else:
        exponent = 1.0 if model.normal == "linear" else 1.5
        damping = 2.0 * damping_ratio(given["restitution"], exponent) * math.sqrt(stiffness * mass)
    across, drag = friction_spring(model, pair, radius, mass, overlap)
    stiffness, damping = max(stiffness, across), max(damping, drag)
    if model.tangential == "viscous":
        damping = max(damping, given["shear_viscosity"])
    return stiffness, damping


def turning_spring(
    model: ContactModel, pair: PairNumbers, radius: float, mass: float, overlap: float, grain: float, fixed: bool
) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] against turning a grain, as at its rim; zero without a rolling spring.

    Friction resists that two grains turn the same way, a rolling spring that they turn opposite ways, so that either is felt in
    full by a motion that the other does not hinder. On an immovable surface a grain feels both at once.

    Args:
        model: laws.
        pair: of the two materials.
        radius: effective [m].
        mass: effective [kg].
        overlap: at which the stiffness is taken [m].
        grain: radius of the grain [m].
        fixed: whether the other body is an immovable surface.
    """
    stiffness, damping = rolling_spring(model, pair, radius, mass, overlap, arm=1.0 if fixed else radius / grain)
    if stiffness > 0.0 and fixed:
        across, drag = friction_spring(model, pair, radius, mass, overlap)
        return stiffness + across, damping + drag
    return stiffness, damping


def grain_share(rotation: bool, contacts: float = COORDINATION) -> float:
    """Bound of ``w^2 m/k`` for a grain among its like [1]."""
    if not rotation:
        return 2.0 * contacts / 3.0
    return 2.0 * contacts * max((1.0 + 2.0 * TANGENT) / 3.0, 5.0 / 3.0 * TANGENT)


def surface_share(rotation: bool, contacts: float = SURFACE_CONTACTS) -> float:
    """Bound of ``w^2 m/k`` for a grain on an immovable surface that touches it in several points [1]."""
    return contacts * max(1.0, 3.5 * TANGENT * rotation)


def particles_touched(grain: float, particle: float, spacing: float, overlap: float) -> float:
    """Particles of a flat layer that a grain pressed into it touches at once [1].

    Spheres of radius p on a triangular lattice of spacing h are touched within ``rho^2 = 2 (R + p) overlap`` of the deepest
    point, which is ``pi rho^2 2/(sqrt(3) h^2)`` of them.

    Args:
        grain: its radius [m].
        particle: radius of each particle [m].
        spacing: of neighbouring particles [m].
        overlap: with the particle under the grain [m].
    """
    return 4.0 * math.pi / math.sqrt(3.0) * (grain + particle) * overlap / spacing**2


def network_steps(
    scene: Scene, smallest: dict[str, float], spacings: Sequence[float], depth: float, load: float
) -> Iterator[float]:
    """Largest stable step of the smallest grains among their like, at walls and at the particles of tools and rough walls [s].

    Args:
        scene: materials, pairs, boundaries, tools.
        smallest: smallest grain radius of each grain material [m].
        spacings: of the particles of each rough tool, then of each rough terrain, in the order of the scene [m].
        depth: overlap over radius up to which contacts shall be stable [1].
        load: mass of all grains [kg].
    """
    named = {m.name: m for m in scene.materials}
    rotation = scene.contact.rotation
    # A crystal of Hertzian grains has its margin in that it is softer than at the depth asked for; linear springs never are.
    contacts = CRYSTAL if "linear" in (scene.contact.normal, scene.contact.tangential) else COORDINATION
    sampled = [(tool.material, tool.particle_radius) for tool in scene.tools if tool.contact != SMOOTH]
    grounds = [(wall.material, wall.terrain) for wall in scene.boundaries if wall.terrain]
    sampled += [(material, ground.particle_radius) for material, ground in grounds if ground.contact != SMOOTH]
    layers = [(*body, spacing) for body, spacing in zip(sampled, spacings, strict=True)]
    flat = [*scene.boundaries, *(tool for tool in scene.tools if tool.contact == SMOOTH)]
    layers += [(wall.material, wall.rough.radius, wall.rough.spacing) for wall in scene.boundaries if wall.rough]
    for grain, radius in smallest.items():
        mass, overlap = named[grain].density * 4.0 / 3.0 * math.pi * radius**3, depth * radius
        meetings = [(other, 0.5 * radius, 0.5 * mass, grain_share(rotation, contacts)) for other in smallest]
        meetings += [(wall.material, radius, mass, surface_share(rotation)) for wall in flat]
        for material, particle, spacing in layers:
            touched = max(SURFACE_CONTACTS, particles_touched(radius, particle, spacing, overlap))
            meetings.append((material, radius * particle / (radius + particle), mass, surface_share(rotation, touched)))
        for other, effective_radius, reduced_mass, share in meetings:
            pair = pair_numbers(scene, grain, other)
            contact = scene.contact, pair, effective_radius, reduced_mass, overlap
            turning = turning_spring(*contact, radius, fixed=reduced_mass == mass)
            for stiffness, damping in (spring_and_dashpot(*contact), turning):
                if stiffness > 0.0:
                    yield stable_step(share * stiffness / mass, share * damping / mass, scene.solver.integrator)
        for wall in scene.boundaries:
            if wall.drive and wall.drive.force is not None:
                share = SURFACE_CONTACTS + load / (wall.drive.mass or load)
                pair = pair_numbers(scene, grain, wall.material)
                stiffness, damping = spring_and_dashpot(scene.contact, pair, radius, mass, overlap)
                yield stable_step(share * stiffness / mass, share * damping / mass, VERLET)  # whatever moves the grains
