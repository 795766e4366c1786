"""Grains on the host, as a scene places them: spheres, some of which are parts of rigid bodies."""

from dataclasses import dataclass, fields

import numpy as np

FEW = 8
LONE = -1  # body of a sphere that is a grain by itself


@dataclass(frozen=True)
class BodyTable:
    """Free rigid bodies, one row each. The body frame lies along the principal axes in the centre of mass.

    Attributes:
        position: of the centre of mass, world frame, shape (n, 3) [m].
        orientation: body frame to world frame, quaternion x y z w, shape (n, 4).
        velocity: shape (n, 3) [m/s].
        spin: world frame, shape (n, 3) [rad/s].
        mass: shape (n,) [kg].
        inertia: principal moments, shape (n, 3) [kg m^2].
    """

    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray

    def __len__(self) -> int:
        return len(self.mass)

    @classmethod
    def none(cls) -> "BodyTable":
        """A table without bodies."""
        return cls(*(np.zeros(shape) for shape in ((0, 3), (0, 4), (0, 3), (0, 3), (0,), (0, 3))))


@dataclass(frozen=True)
class GrainTable:
    """Spheres, one row each.

    Attributes:
        position: world frame, shape (n, 3) [m].
        velocity: of the centre, shape (n, 3) [m/s].
        spin: shape (n, 3) [rad/s], world frame.
        radius: shape (n,) [m].
        density: shape (n,) [kg/m^3].
        material: index into the scene's materials, shape (n,), int.
        body: row of the body it belongs to, in the order of the bodies, ``LONE`` for a grain by itself, shape (n,), int.
        offset: of its centre in the body frame, shape (n, 3) [m].
        bodies: the bodies.
    """

    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    radius: np.ndarray
    density: np.ndarray
    material: np.ndarray
    body: np.ndarray
    offset: np.ndarray
    bodies: BodyTable

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def lone(self) -> np.ndarray:
        """Whether a sphere is a grain by itself, shape (n,)."""
        return self.body == LONE

    @property
    def mass(self) -> np.ndarray:
        """Masses that the contact laws see, shape (n,) [kg]: of solid spheres, or of the bodies they belong to.

        A body of N > ``FEW`` spheres touches with one of them at a corner and with about N on a face. Damping each contact for
        the whole mass would stop it dead on a face and need ever smaller steps; damping for a share 1/N would let it bounce off
        its corners. So its spheres count for the geometric mean of the two.
        """
        own = self.density * 4.0 / 3.0 * np.pi * self.radius**3
        spheres = np.bincount(self.body[~self.lone], minlength=len(self.bodies))
        shared = self.bodies.mass * np.sqrt(FEW / np.maximum(spheres, FEW))
        return np.where(self.lone, own, np.append(shared, 0.0)[self.body])

    @property
    def total_mass(self) -> float:
        """Mass of all grains and bodies [kg]."""
        return float(self.mass[self.lone].sum() + self.bodies.mass.sum())

    @property
    def grain(self) -> np.ndarray:
        """Number of the grain that a sphere is or belongs to, shape (n,), int."""
        begins = self.lone | (self.body != np.append([LONE], self.body[:-1]))
        return np.cumsum(begins) - 1

    @property
    def grains(self) -> int:
        """How many grains there are."""
        return int(self.lone.sum()) + len(self.bodies)

    @classmethod
    def of_spheres(cls, position, velocity, spin, radius, density, material) -> "GrainTable":
        """Grains that are spheres; the arguments are as the attributes."""
        body, offset = np.full(len(radius), LONE), np.zeros((len(radius), 3))
        return cls(position, velocity, spin, radius, density, material, body, offset, BodyTable.none())

    @classmethod
    def join(cls, tables: list["GrainTable"]) -> "GrainTable":
        """One table after the other."""
        first = np.cumsum([0] + [len(table.bodies) for table in tables])
        parts = {f.name: [getattr(table, f.name) for table in tables] for f in fields(cls)}
        parts["body"] = [np.where(body == LONE, LONE, body + k) for body, k in zip(parts["body"], first, strict=False)]
        bodies = parts.pop("bodies")
        joined = BodyTable(*(np.concatenate([getattr(b, f.name) for b in bodies]) for f in fields(BodyTable)))
        return cls(**{name: np.concatenate(columns) for name, columns in parts.items()}, bodies=joined)
