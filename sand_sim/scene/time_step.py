"""The largest time step that resolves a scene, and what it comes from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sand_sim.contact.cohesion import CohesionLaw
from sand_sim.contact.law import PairNumbers
from sand_sim.contact.model import ContactModel
from sand_sim.precision import Precision
from sand_sim.scene.pairing import pair_numbers
from sand_sim.scene.side_springs import friction_spring, rolling_spring
from sand_sim.scene.stable_step import DEEP, network_steps
from sand_sim.scene.types import Material, Scene, SceneError

CONTACT_FRACTION = 1.0 / 25.0  # of the shortest contact time
RAYLEIGH_FRACTION = 0.2  # of the shortest Rayleigh time
STABLE_FRACTION = 1.0  # of the largest step that is stable in a dense bed; a bound, see there what margin it leaves
PARTING_FRACTION = 1.0 / 25.0  # of the shortest parting time
TRAVEL_FRACTION = 0.05  # of the smallest radius, which nothing crosses in one step
REFUSED = 3.0  # times the chosen step: a user's step beyond is refused unless forced
_WRITTEN = 1.0001  # times the chosen step, which a user may have copied with few digits; beyond, a user's step is warned about
_ROUNDED = 1e-3  # share of what gravity adds in a step that rounding may change before its errors are carried over
_RESISTED = 5e-3  # the same share of what friction or rolling resistance takes
_LEVEL = 1e-6  # of gravity: less of it along an axis is none
_BED, _BOND = "stability of damped contacts", "range of cohesion"


def contact_time(radius: float, mass: float, young: float, speed: float) -> float:
    """Duration of an elastic Hertz impact, ``2.868 (m*^2 / (R* E*^2 v))^0.2`` [s]."""
    return 2.868 * (mass**2 / (radius * young**2 * speed)) ** 0.2


def shortest_oscillation(model: ContactModel, pair: PairNumbers, radius: float, mass: float, speed: float) -> float:
    """Shortest half period among the springs of a contact, and the decay times of its history-free dampers [s].

    Args:
        model: laws.
        pair: of the two materials.
        radius: effective, of the smallest spheres that meet [m].
        mass: effective [kg].
        speed: at impact [m/s].
    """
    numbers = pair.given
    if model.normal == "linear":
        shortest = np.pi * np.sqrt(mass / numbers["stiffness"])
    else:
        shortest = contact_time(radius, mass, pair.young, speed)
    # A sphere yields to a push in the tangent plane by turning too, as 2/7 of its mass would.
    if model.tangential == "linear":
        shortest = min(shortest, np.pi * np.sqrt(2.0 / 7.0 * mass / numbers["shear_stiffness"]))
    if model.tangential == "viscous" and numbers["shear_viscosity"] > 0.0:
        shortest = min(shortest, np.pi * 2.0 / 7.0 * mass / numbers["shear_viscosity"])
    if model.normal == "linear":
        overlap = speed * np.sqrt(mass / numbers["stiffness"])
        for spring in (friction_spring, rolling_spring):
            stiffness, _ = spring(model, pair, radius, mass, overlap)
            shortest = min(shortest, np.pi * np.sqrt(2.0 / 7.0 * mass / stiffness)) if stiffness > 0.0 else shortest
    elif model.rolling == "spring":
        # k_r / I over k_n / m is 2.25 mu_r^2 R^2 m / (2/5 m R^2).
        shortest /= max(1.0, np.sqrt(2.25 / 0.4) * numbers["rolling_friction"])
    return float(shortest)


def parting_time(law: CohesionLaw, pair: PairNumbers, least: float, radius: float, mass: float) -> float:
    """Time in which grains cross the range of a bond at the speed that just tears it, ``sqrt(W m* / 2) / P`` [s].

    W is the work of the bond and P its pull, hence ``W / P`` its range and ``sqrt(2 W / m*)`` that speed. Who parts more slowly
    is drawn back about as fast; who parts faster loses a lesser share. A pull sets in at full strength anywhere within a step, so
    the energy that a bounce loses is wrong by up to P times half the way of a step, in the mean by nothing. At 25 steps that is
    2 % of the kinetic energy before a bounce at most, at any speed and with any volume of a liquid bridge; without a range, as
    ``dmt``, of one that is no slower than W allows.

    Args:
        law: of cohesion.
        pair: of the two materials.
        least: radius of the smaller one [m].
        radius: effective [m].
        mass: effective [kg].
    """
    work, pull = law.bond(pair, least, radius)
    return float(np.sqrt(0.5 * work * mass) / pull) if work > 0.0 else np.inf


def rayleigh_time(radius: float, material: Material) -> float:
    """Time in which a Rayleigh wave crosses a grain, ``pi R sqrt(rho/G) / (0.1631 nu + 0.8766)`` [s]."""
    shear = material.young / (2.0 * (1.0 + material.poisson))
    return np.pi * radius * np.sqrt(material.density / shear) / (0.1631 * material.poisson + 0.8766)


@dataclass(frozen=True)
class TimeStep:
    """A chosen time step and its reasons.

    Attributes:
        value: [s].
        safe: what ``auto`` would choose [s].
        contact: shortest contact time at the fastest speed, or half period of a spring [s].
        rayleigh: shortest Rayleigh time, infinite with linear springs [s].
        speed: fastest relative speed reckoned with [m/s].
        reason: which of the limits decided.
        warning: empty, or what is doubtful about a step given by the user.
        stable: largest step at which damped contacts in a dense bed are stable, see stable_step.py [s].
    """

    value: float
    safe: float
    contact: float
    rayleigh: float
    speed: float
    reason: str
    warning: str = ""
    stable: float = np.inf


def fastest_speed(scene: Scene, height: float, given: float) -> float:
    """Relative speed of the hardest contact to expect [m/s]: free fall from a height [m], grains' own speeds [m/s], tools."""
    fall = float(np.sqrt(2.0 * np.linalg.norm(scene.gravity) * height))
    plungers = [max(abs(b.drive.velocity), b.drive.max_speed) for b in scene.boundaries if b.drive]
    tools = max([*plungers, *(tool.max_speed for tool in scene.tools)], default=0.0)
    return max(fall + 2.0 * given, tools + given, 1e-3)


def choose_time_step(
    scene: Scene, smallest: dict[str, float], speed: float, spacings: Sequence[float], load: float, depth: float = DEEP
) -> TimeStep:
    """Choose the time step, or check the one the scene gives.

    Args:
        scene: materials and the step asked for.
        smallest: smallest grain radius of each grain material [m].
        speed: fastest relative speed to expect [m/s].
        spacings: of the particles of each rough tool, then of each rough terrain, in the order of the scene [m].
        load: mass of all grains [kg].
        depth: overlap over radius up to which contacts shall be stable [1].

    Raises:
        SceneError: if the scene's own step is far beyond what is stable and not forced.
    """
    named = {m.name: m for m in scene.materials}
    contact = rayleigh = parting = np.inf
    cohesion = scene.contact.law("cohesion")
    surfaces = {b.material for b in scene.boundaries} | {t.material for t in scene.tools}
    for grain, radius in smallest.items():
        material = named[grain]
        mass = material.density * 4.0 / 3.0 * np.pi * radius**3
        if scene.contact.normal != "linear":
            rayleigh = min(rayleigh, float(rayleigh_time(radius, material)))
        meetings = [(other, 0.5 * radius, 0.5 * mass) for other in smallest] + [(other, radius, mass) for other in surfaces]
        for other, half_radius, half_mass in meetings:
            pair = pair_numbers(scene, grain, other)
            contact = min(contact, shortest_oscillation(scene.contact, pair, half_radius, half_mass, speed))
            parting = min(parting, parting_time(cohesion, pair, radius, half_radius, half_mass))
    stable = min(network_steps(scene, smallest, spacings, depth, load))
    limits = {
        "contact time": CONTACT_FRACTION * contact,
        "Rayleigh time": RAYLEIGH_FRACTION * rayleigh,
        _BED: STABLE_FRACTION * stable,
        _BOND: PARTING_FRACTION * parting,
        "travel in one step": TRAVEL_FRACTION * min(smallest.values()) / speed,
    }
    reason = min(limits, key=limits.get)
    safe, asked = limits[reason], scene.solver.time_step
    if asked is None:
        return TimeStep(safe, safe, contact, rayleigh, speed, reason, "", stable)
    # Grains that are not packed bear more than a dense bed does, and a bond that is torn inexactly is no blow-up: warnings only.
    loose = min(limit for name, limit in limits.items() if name not in (_BED, _BOND))
    if asked > REFUSED * loose and not scene.solver.force_time_step:
        raise SceneError(
            f"solver.time_step: {asked:.3g} s is {asked / safe:.1f} times the safe step of {safe:.3g} s ({reason}); "
            f"use 'auto' or at most {REFUSED * loose:.3g}, or set solver.force_time_step to see it fail"
        )
    warning = ""
    if asked > _WRITTEN * safe:
        warning = f"time step {asked:.3g} s is {asked / safe:.1f} times the safe step of {safe:.3g} s ({reason})"
    return TimeStep(asked, safe, contact, rayleigh, speed, reason, warning, stable)


def loses_digits(scene: Scene, time_step: TimeStep, precision: Precision, smallest: dict[str, float], rim: float = 0.0) -> bool:
    """Whether rounding the fastest velocity to expect may change it by a notable share of the least that it gains in a step.

    That is what gravity gives along an axis, or what friction, rolling or twisting resistance takes from a grain that it presses
    down.

    Args:
        scene: gravity, laws and their numbers.
        time_step: and the fastest velocity to expect.
        precision: of velocities.
        smallest: smallest grain radius of each grain material [m].
        rim: fastest that a grain turns, at its rim [m/s].
    """
    whole = float(np.linalg.norm(scene.gravity))
    allowed = [_ROUNDED * abs(along) for along in scene.gravity if abs(along) > _LEVEL * whole]
    numbers = {"friction", "rolling_friction"}.intersection(scene.contact.asks)
    allowed += [_RESISTED * rule.numbers[name] * whole for rule in scene.pairs for name in numbers & rule.numbers.keys()]
    if scene.contact.twisting != "none":
        allowed += [_RESISTED * slowing for slowing in _slowing_by_twisting(scene, smallest, whole)]
    least = min((share for share in allowed if share > 0.0), default=np.inf)
    return bool(0.5 * precision.epsilon * max(time_step.speed, rim) > least * time_step.value)  # not NumPy's


def _slowing_by_twisting(scene: Scene, smallest: dict[str, float], gravity: float) -> list[float]:
    """How fast twisting slows the rims of grains that lie on each material, ``5/3 mu g a/R``, a being the patch [m/s^2]."""
    found = []
    for name, radius in smallest.items():
        density = scene.materials[scene.material_index(name)].density
        for other in scene.materials:
            if pair := pair_numbers(scene, name, other.name):
                patch = (np.pi * density * gravity * radius / pair.young) ** (1.0 / 3.0)
                found.append(5.0 / 3.0 * pair.given["friction"] * gravity * patch)
    return found
