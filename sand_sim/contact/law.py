"""What a contact law is: its Warp function, the numbers it needs of a pair of materials, and what its contacts remember."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

import warp as wp


@dataclass(frozen=True)
class Ask:
    """A number that a scene gives for a pair of materials.

    Attributes:
        unit: shown when a value is refused.
        above, least, most: range.
    """

    unit: str = ""
    above: float = -inf
    least: float = -inf
    most: float = inf


ASKS = {
    "restitution": Ask(above=0.0, most=1.0),
    "friction": Ask(least=0.0),
    "stiffness": Ask("N/m", above=0.0),
    "shear_stiffness": Ask("N/m", above=0.0),
    "shear_viscosity": Ask("N s/m", least=0.0),
    "viscous_time": Ask("s", least=0.0),
    "rolling_friction": Ask(least=0.0),
    "adhesion": Ask("J/m^2", least=0.0),
}


@dataclass(frozen=True)
class PairNumbers:
    """All that is known of a pair of materials on the host.

    Attributes:
        young: effective modulus E* [Pa].
        shear: effective modulus G* [Pa].
        given: numbers of the scene by the names of ``ASKS``.
        liquid: numbers of the liquid in wet sand by name, empty in dry.
    """

    young: float
    shear: float
    given: dict[str, float]
    liquid: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Law:
    """A choice for a slot.

    Its function chooses between numbers, not between vectors, where it branches, and calls no library that knows one number at a
    time; else the compiler could not do many contacts at once, see ``engine/pair_tiles.py``.

    Attributes:
        build: ``build(precision, types)`` gives the Warp function of the slot; its docstring is the law.
        fields: numbers it reads from ``MaterialPair``, name to ``[unit] meaning``.
        prepare: computes those fields for a pair of materials.
        asks: numbers the scene must give.
        memory: sign by which each remembered number changes when the bodies of a contact swap roles; its length is how many.
        rotation: whether it can turn a sphere.
        build_energy: ``build_energy(precision, types)`` gives the Warp function for the energy stored in the law's springs.
    """

    build: Callable
    build_energy: Callable[..., wp.Function] | None = None
    fields: dict[str, str] = field(default_factory=dict)
    prepare: Callable[[PairNumbers], dict[str, float]] = lambda pair: {}
    asks: tuple[str, ...] = ()
    memory: tuple[int, ...] = ()
    rotation: bool = False


NONE = Law(build=lambda precision, types: None)
VECTOR = (-1, -1, -1)  # memory of a displacement of body a against body b
