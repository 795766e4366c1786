"""Grains on the host, as a scene places them."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GrainTable:
    """Grains, one row each.

    Attributes:
        position: world frame, shape (n, 3) [m].
        velocity: shape (n, 3) [m/s].
        spin: shape (n, 3) [rad/s], world frame.
        radius: shape (n,) [m].
        density: shape (n,) [kg/m^3].
        material: index into the scene's materials, shape (n,), int.
    """

    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    radius: np.ndarray
    density: np.ndarray
    material: np.ndarray

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def mass(self) -> np.ndarray:
        """Masses of solid spheres, shape (n,) [kg]."""
        return self.density * 4.0 / 3.0 * np.pi * self.radius**3

    @classmethod
    def join(cls, tables: list["GrainTable"]) -> "GrainTable":
        """One table after the other."""
        return cls(*(np.concatenate([getattr(t, name) for t in tables]) for name in cls.__dataclass_fields__))
