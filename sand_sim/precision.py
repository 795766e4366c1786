"""Number types of a world: the same kernel source runs in single or double precision."""

from dataclasses import dataclass

import numpy as np
import warp as wp


@dataclass(frozen=True)
class Precision:
    """The Warp and NumPy types that every kernel factory builds with.

    Positions are whole numbers on a lattice that spans the domain (see ``lattice.py``), everything else is real.
    """

    name: str
    real: type
    whole: type
    vec3: type
    vec4: type
    quat: type
    mat33: type
    whole3: type
    whole4: type
    numpy_real: type
    numpy_whole: type
    lattice_bits: int

    @property
    def epsilon(self) -> float:
        """Relative rounding error of ``real``."""
        return float(np.finfo(self.numpy_real).eps)


SINGLE = Precision(
    "single",
    wp.float32,
    wp.int32,
    wp.vec3f,
    wp.vec4f,
    wp.quatf,
    wp.mat33f,
    wp.vec3i,
    wp.vec4i,
    np.float32,
    np.int32,
    30,
)
DOUBLE = Precision(
    "double",
    wp.float64,
    wp.int64,
    wp.vec3d,
    wp.vec4d,
    wp.quatd,
    wp.mat33d,
    wp.types.vector(3, wp.int64),
    wp.types.vector(4, wp.int64),
    np.float64,
    np.int64,
    62,
)
PRECISIONS = {p.name: p for p in (SINGLE, DOUBLE)}
