"""The largest time step that resolves a scene, and what it comes from."""

from dataclasses import dataclass

import numpy as np

from sand_sim.scene.types import Material, Scene, SceneError

CONTACT_FRACTION = 1.0 / 25.0  # of the shortest contact time
RAYLEIGH_FRACTION = 0.2  # of the shortest Rayleigh time
REFUSED = 3.0  # times the chosen step: a user's step beyond is refused
WARNED = 1.0  # times the chosen step: a user's step beyond is warned about


def effective_young(a: Material, b: Material) -> float:
    """``E* = [(1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b]^-1`` [Pa]."""
    return 1.0 / ((1.0 - a.poisson**2) / a.young + (1.0 - b.poisson**2) / b.young)


def effective_shear(a: Material, b: Material) -> float:
    """``G* = [(2 - nu_a)/G_a + (2 - nu_b)/G_b]^-1`` with ``G = E / (2 (1 + nu))`` [Pa]."""
    shear_a, shear_b = (m.young / (2.0 * (1.0 + m.poisson)) for m in (a, b))
    return 1.0 / ((2.0 - a.poisson) / shear_a + (2.0 - b.poisson) / shear_b)


def contact_time(radius: float, mass: float, young: float, speed: float) -> float:
    """Duration of an elastic Hertz impact, ``2.868 (m*^2 / (R* E*^2 v))^0.2`` [s]."""
    return 2.868 * (mass**2 / (radius * young**2 * speed)) ** 0.2


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
        contact: shortest contact time at the fastest speed [s].
        rayleigh: shortest Rayleigh time [s].
        speed: fastest relative speed reckoned with [m/s].
        reason: which of the two decided.
        warning: empty, or what is doubtful about a step given by the user.
    """

    value: float
    safe: float
    contact: float
    rayleigh: float
    speed: float
    reason: str
    warning: str = ""


def fastest_speed(scene: Scene, top: float, bottom: float, given: float) -> float:
    """Relative speed of the hardest contact to expect [m/s]: free fall through the scene, grains' own speeds, tools."""
    fall = float(np.sqrt(2.0 * np.linalg.norm(scene.gravity) * max(top - bottom, 0.0)))
    tools = max((tool.max_speed for tool in scene.tools), default=0.0)
    return max(fall + 2.0 * given, tools + given, 1e-3)


def choose_time_step(scene: Scene, smallest: dict[str, float], speed: float) -> TimeStep:
    """Choose the time step, or check the one the scene gives.

    Args:
        scene: materials and the step asked for.
        smallest: smallest grain radius of each grain material [m].
        speed: fastest relative speed to expect [m/s].

    Raises:
        SceneError: if the scene's own step is far beyond what is stable.
    """
    named = {m.name: m for m in scene.materials}
    contact = rayleigh = np.inf
    surfaces = {b.material for b in scene.boundaries} | {t.material for t in scene.tools}
    for grain, radius in smallest.items():
        material = named[grain]
        mass = material.density * 4.0 / 3.0 * np.pi * radius**3
        rayleigh = min(rayleigh, float(rayleigh_time(radius, material)))
        for other in smallest:
            contact = min(contact, contact_time(0.5 * radius, 0.5 * mass, effective_young(material, named[other]), speed))
        for other in surfaces:
            contact = min(contact, contact_time(radius, mass, effective_young(material, named[other]), speed))
    safe = min(CONTACT_FRACTION * contact, RAYLEIGH_FRACTION * rayleigh)
    reason = "contact time" if CONTACT_FRACTION * contact < RAYLEIGH_FRACTION * rayleigh else "Rayleigh time"
    asked = scene.solver.time_step
    if asked is None:
        return TimeStep(safe, safe, contact, rayleigh, speed, reason)
    if asked > REFUSED * safe:
        raise SceneError(
            f"solver.time_step: {asked:.3g} s is {asked / safe:.1f} times the safe step of {safe:.3g} s ({reason}); "
            f"use 'auto' or at most {REFUSED * safe:.3g}"
        )
    warning = ""
    if asked > WARNED * safe * 1.0001:
        warning = f"time step {asked:.3g} s is {asked / safe:.1f} times the safe step of {safe:.3g} s ({reason})"
    return TimeStep(asked, safe, contact, rayleigh, speed, reason, warning)
