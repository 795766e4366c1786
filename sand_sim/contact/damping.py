"""From the asked coefficient of restitution to the damping ratio of a contact law that never pulls.

Granular codes clip the normal force at zero so that grains do not stick while they part. The well known closed forms
(Tsuji 1992; Antypov & Elliott 2011, https://doi.org/10.1209/0295-5075/94/50004) assume an unclipped force and return too much
speed. Here the impact of the clipped law is integrated numerically for many damping ratios at once, and the curve inverted.
"""

from functools import cache

import numpy as np

_STEPS = 600  # of Runge and Kutta over the longest contact
_RATIOS = np.concatenate([[0.0], np.geomspace(1e-4, 6.0, 300)])


def restitution_of_damping(exponent: float, ratios: np.ndarray) -> np.ndarray:
    """Restitution of a unit impact ``x'' = -max(0, x^p + 2 z sqrt(p) x^((p-1)/2) x')``.

    ``p = 3/2`` is Hertz with damping force ``2 z sqrt(S m) x'`` (S the tangent stiffness), ``p = 1`` the linear
    spring-dashpot; in both the result depends on neither impact speed, mass nor stiffness.

    Args:
        exponent: p [1], power of the overlap in the elastic force.
        ratios: damping ratios z [1], shape (n,).

    Returns:
        Restitution coefficients [1], shape (n,).
    """
    damping = 2.0 * ratios * np.sqrt(exponent)

    def force(x, u):
        x = np.maximum(x, 0.0)
        return np.maximum(x**exponent + damping * x ** (0.5 * (exponent - 1.0)) * u, 0.0)

    x, u = np.zeros_like(ratios), np.ones_like(ratios)
    # Strong damping prolongs a contact, so each ratio has a step of its own.
    dt = (3.3 + 6.0 * ratios) / _STEPS
    for _ in range(_STEPS):
        x1, u1 = u, -force(x, u)
        x2, u2 = u + 0.5 * dt * u1, -force(x + 0.5 * dt * x1, u + 0.5 * dt * u1)
        x3, u3 = u + 0.5 * dt * u2, -force(x + 0.5 * dt * x2, u + 0.5 * dt * u2)
        x4, u4 = u + dt * u3, -force(x + dt * x3, u + dt * u3)
        x = x + dt / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4)
        u = u + dt / 6.0 * (u1 + 2.0 * u2 + 2.0 * u3 + u4)
    # Once the clipped force is zero it stays zero, so the speed after the last step is the rebound speed.
    return -u


@cache
def _curve(exponent: float) -> tuple[np.ndarray, np.ndarray]:
    restitution = restitution_of_damping(exponent, _RATIOS)
    falling = np.concatenate([[True], np.diff(restitution) < 0.0])
    return restitution[falling][::-1], _RATIOS[falling][::-1]


def damping_ratio(restitution: float, exponent: float) -> float:
    """Damping ratio z [1] for which the clipped law with elastic exponent p returns the asked restitution.

    Raises:
        ValueError: if the restitution is outside (0, 1].
    """
    if not 0.0 < restitution <= 1.0:
        raise ValueError(f"restitution must be in (0, 1], got {restitution}")
    known, ratios = _curve(exponent)
    return float(np.interp(restitution, known, ratios))
