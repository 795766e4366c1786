"""Closed forms that extreme cases are judged by. Hertz 1882; Johnson, Contact Mechanics, 1985, chapters 4 and 11."""

import numpy as np


def sphere_mass(radius, density: float):
    """``4/3 pi r^3 rho`` [kg]."""
    return 4.0 / 3.0 * np.pi * np.asarray(radius, float) ** 3 * density


def plane_modulus(young: float, poisson: float) -> float:
    """Effective modulus against a rigid plane, ``E/(1 - nu^2)`` [Pa]; between equal grains it is half of this."""
    return young / (1.0 - poisson**2)


def impact_overlap(mass: float, radius: float, modulus: float, speed: float) -> float:
    """Largest overlap of an elastic impact, ``(15 m* v^2/(16 E* sqrt(R*)))^0.4`` [m]."""
    return float((15.0 * mass * speed**2 / (16.0 * modulus * np.sqrt(radius))) ** 0.4)


def impact_time(overlap: float, speed: float) -> float:
    """Duration of an elastic impact, ``2.94 d_max/v`` [s]."""
    return 2.9433 * overlap / speed


def static_overlap(force: float, radius: float, modulus: float) -> float:
    """Overlap under a force, ``(3 F/(4 E* sqrt(R*)))^(2/3)`` [m]."""
    return float((0.75 * force / (modulus * np.sqrt(radius))) ** (2.0 / 3.0))


def impact_limit(mass: float, radius: float, modulus: float, speed: float) -> float:
    """Largest stable step at the deepest point of an elastic impact [s].

    There the tangent stiffness is ``k = 2 E* sqrt(R* d_max)``, and with ``w = sqrt(k/m*) = 1.369 v/d_max`` the limit ``2/w`` is
    0.497 of the impact's duration; see ``scene/stable_step.py``.
    """
    stiffness = 2.0 * modulus * np.sqrt(radius * impact_overlap(mass, radius, modulus, speed))
    return float(2.0 / np.sqrt(stiffness / mass))
