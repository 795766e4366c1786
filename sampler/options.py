"""What the numbers of a body must keep to."""

from numbers import Integral, Real

import numpy as np
import warp as wp

from sampler.errors import MeshError


def is_positive(value: object) -> bool:
    """Whether it is a finite number above zero, not its text or a truth."""
    return isinstance(value, Real) and not isinstance(value, bool) and bool(np.isfinite(value)) and value > 0.0


def check_weight(density: float | None, mass: float | None) -> None:
    """See that exactly one of a density [kg/m^3] and a mass [kg] is given.

    Raises:
        MeshError: if not, or it is not positive and finite.
    """
    given = [value for value in (density, mass) if value is not None]
    if len(given) != 1 or not is_positive(given[0]):
        raise MeshError("give either a density [kg/m^3] or a mass [kg], positive")


def check_options(lengths: dict[str, float | None], count: int | None, seed: int, device: str) -> None:
    """See that numbers make sense.

    Args:
        lengths: by name, in metres; None where they are not given, as all but the radius may be.
        count: wanted number of particles.
        seed: of the random start.
        device: Warp device.

    Raises:
        MeshError: if a length is not positive and finite, the count or the seed no whole number, or the device not here.
    """
    for name, value in lengths.items():
        if (value is not None or name == "radius") and not is_positive(value):
            raise MeshError(f"particle {name} must be positive, got {value!r}")
    for name, value, least in (("particle count", count, 1), ("seed", seed, 0)):
        if value is not None and not (isinstance(value, Integral) and not isinstance(value, bool) and value >= least):
            raise MeshError(f"{name} must be a whole number from {least} on, got {value!r}")
    try:
        wp.get_device(device)
    except (ValueError, RuntimeError):
        present = ", ".join(one.alias for one in wp.get_devices())
        raise MeshError(f"device '{device}' is not here; present are {present}") from None
