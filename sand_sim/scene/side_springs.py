"""Springs of a contact across its normal and against rolling.

Mindlin's spring and the rolling spring follow the moduli of the materials. Beside a Hertz contact of stiffness ``S = 2 E* a``
Mindlin's is the softer one, ``8 G* a <= S``. A linear normal law has a stiffness of its own: a thousand times softer than stone,
it leaves the friction and the rolling spring of stone as stiff as ever.
"""

import math

from sand_sim.contact.damping import damping_ratio
from sand_sim.contact.law import PairNumbers
from sand_sim.contact.model import ContactModel
from sand_sim.contact.rolling import ROLLING_DAMPING


def friction_spring(model: ContactModel, pair: PairNumbers, radius: float, mass: float, overlap: float) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of the tangential law's spring, zero without one.

    Marshall's twisting spring, ``4 G* a^3``, needs no room beside Mindlin's: it resists turning about the normal, where friction
    does not, with at most ``xi / (2 R*)`` of what friction has at the rim.

    Args:
        model: laws.
        pair: of the two materials.
        radius: effective, R* [m].
        mass: effective [kg].
        overlap: at which the stiffness is taken [m].
    """
    if model.tangential == "linear":
        stiffness, exponent = pair.given["shear_stiffness"], 1.0
    elif model.tangential in ("mindlin", "mindlin_rescaled"):
        stiffness, exponent = 8.0 * pair.shear * math.sqrt(radius * overlap), 1.5
    else:
        return 0.0, 0.0
    damping = 2.0 * damping_ratio(pair.given["restitution"], exponent) * math.sqrt(stiffness * mass)
    return stiffness, damping


def rolling_spring(
    model: ContactModel, pair: PairNumbers, radius: float, mass: float, overlap: float, arm: float = 1.0
) -> tuple[float, float]:
    """Stiffness [N/m] and damping [N s/m] of the rolling spring, as of a spring at the rim; zero with other laws.

    ``k_r = 2.25 S (mu_r R*)^2`` turns a sphere of radius r with ``2.25 S (mu_r R*/r)^2`` at its rim. There it finds ``2/5 m``, a
    spring that pushes too ``2/7 m``; one of that kind with 5/7 of the stiffness is as fast.

    Args:
        model: laws.
        pair: of the two materials.
        radius: effective, R* [m].
        mass: effective [kg].
        overlap: at which the stiffness is taken [m].
        arm: R*/r, one on a surface [1].
    """
    if model.rolling != "spring":
        return 0.0, 0.0
    stiffness = 2.25 * 2.0 * pair.young * math.sqrt(radius * overlap) * (pair.given["rolling_friction"] * arm) ** 2
    damping = 2.0 * ROLLING_DAMPING * math.sqrt(7.0 / 5.0 * stiffness * mass)
    return 5.0 / 7.0 * stiffness, 5.0 / 7.0 * damping
