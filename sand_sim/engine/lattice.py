"""Positions as whole numbers on a lattice over the domain.

A float32 position loses digits with its distance from the origin, so that overlaps of micrometres drown in a metre-sized scene.
Here a position is an integer multiple of one ``quantum`` (about 5e-10 m for a domain of one metre in single precision).
Differences of positions are exact, resolution is the same everywhere, and a scene moved by 10 km gives the same bits.
What a step moves beyond whole quanta is kept in a remainder, so that slow creep is never rounded away.
"""

from dataclasses import dataclass

import numpy as np

from sand_sim.precision import Precision


@dataclass(frozen=True)
class Lattice:
    """Map between world coordinates [m] and lattice coordinates [quantum], centred on the domain.

    Args:
        low, high: corners of the domain in the world frame, shape (3,) [m].
        precision: decides the width of the whole numbers.
        reserve: room kept free around the domain [m], so that a tool held at the end of the lattice cannot reach into it.
    """

    low: np.ndarray
    high: np.ndarray
    precision: Precision
    reserve: float = 0.0

    @property
    def centre(self) -> np.ndarray:
        """World position of lattice point zero, shape (3,) [m]."""
        return 0.5 * (self.low + self.high)

    @property
    def quantum(self) -> float:
        """Edge of one lattice cell [m]."""
        half = 0.5 * float(np.max(self.high - self.low))
        return (half + max(self.reserve, 0.02 * half)) / self.end

    @property
    def room(self) -> float:
        """Width of the margin around the domain [m]: how far a tool may reach from its frame's origin."""
        return self.quantum * self.end - 0.5 * float(np.max(self.high - self.low))

    @property
    def end(self) -> int:
        """Largest lattice coordinate; grains that have left the domain are parked there."""
        return 2**self.precision.lattice_bits - 1

    @property
    def half_extent(self) -> np.ndarray:
        """Half the domain's edges in lattice units, shape (3,), whole."""
        return self.to_whole_length(0.5 * (self.high - self.low))

    def to_whole_length(self, length) -> np.ndarray:
        """Lengths [m] to the nearest number of quanta."""
        return np.rint(np.asarray(length, float) / self.quantum).astype(self.precision.numpy_whole)

    def to_lattice(self, position: np.ndarray) -> np.ndarray:
        """World positions, shape (n, 3) [m], to lattice coordinates, shape (n, 3)."""
        return self.to_whole_length(np.asarray(position, float) - self.centre)

    def to_world(self, place: np.ndarray) -> np.ndarray:
        """Lattice coordinates, shape (n, 3), to world positions, shape (n, 3) [m] in double precision."""
        return np.asarray(place, float) * self.quantum + self.centre
