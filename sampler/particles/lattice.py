"""The triangular lattice, the most even way to cover a surface, against which particles are measured."""

import numpy as np


def particle_count(area: float, spacing: float) -> int:
    """Particles that cover an area [m^2] as a triangular lattice of the given spacing [m]: ``A / (sqrt(3)/2 h^2)``."""
    return max(1, round(2.0 * area / (np.sqrt(3.0) * spacing**2)))


def lattice_spacing(area: float, number: int) -> float:
    """Spacing [m] of a triangular lattice of so many particles on an area [m^2]: ``h = sqrt(2 A / (sqrt(3) N))``."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * number)))
