"""The rigid particle body made from a mesh."""

from dataclasses import dataclass, field

import numpy as np

from sampler.errors import MeshError
from sampler.mass import MassProperties, principal_axes
from sampler.options import check_weight


@dataclass(frozen=True)
class Evenness:
    """How the particles lie, in spacings ``h = sqrt(2 A / (sqrt(3) N))``.

    Attributes:
        variation: of the distance to the nearest neighbour, standard deviation over mean.
        nearest, farthest: smallest and largest distance to the nearest neighbour.
        coverage: largest distance of a place of the surface from the nearest particle.
        skin_coverage: the same, measured along the surface, so that the other skin of a thin wall does not count; one across a
            gap narrower than 0.05 spacings does.
    """

    variation: float
    nearest: float
    farthest: float
    coverage: float
    skin_coverage: float


@dataclass(frozen=True)
class ParticleBody:
    """A rigid list of spheres with the mass properties of the solid it was sampled from; mesh frame throughout.

    Attributes:
        points: particle centres, shape (n, 3) [m].
        normals: outward normals of the faces they lie on, shape (n, 3).
        radius: of every particle [m].
        spacing: of the triangular lattice with as many particles on the same area [m].
        area: that particles cover [m^2], below the surface if they are inset.
        volume: of the solid [m^3]; NaN where it cannot be told.
        centre: centre of mass at uniform density, shape (3,) [m].
        inertia: about the centre per unit density, shape (3, 3) [m^5].
        triangles: closed surface of the solid after repair, outward, shape (m, 3, 3) [m].
        thinnest_wall: [m]; infinite where no two skins face away from one another.
        evenness: of the particles.
        steps: what was mended and how often.
        warnings: what the user should know of surface and particles.
        mass_warnings: what the user should know of volume, centre and inertia.
    """

    points: np.ndarray
    normals: np.ndarray
    radius: float
    spacing: float
    area: float
    volume: float
    centre: np.ndarray
    inertia: np.ndarray
    triangles: np.ndarray
    thinnest_wall: float
    evenness: Evenness
    steps: dict[str, int] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    mass_warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.points)

    @property
    def coverage(self) -> float:
        """Largest distance of a place of the surface from the nearest particle [m]."""
        return self.evenness.coverage * self.spacing

    @property
    def smallest_grain(self) -> float:
        """Radius of the smallest grain that cannot pass between the particles, however it is pushed sideways [m]."""
        return max(0.0, self.coverage - self.radius)

    def roughness(self, grain: float) -> float:
        """Largest angle [rad] between the normal of a contact with a grain of this radius [m] and that of the surface.

        On a flat face a grain that touches a particle from a place at distance ``R_c`` from it leans by
        ``asin(R_c / (r + grain))``; ``R_c`` is at most the coverage along the skin. Particles of the other skin of a wall,
        which lie deeper, are touched from nearer places only.
        """
        return float(np.arcsin(min(1.0, self.evenness.skin_coverage * self.spacing / (self.radius + grain))))

    def mass_properties(self, density: float | None = None, mass: float | None = None) -> MassProperties:
        """Mass, centre and principal inertia.

        Args:
            density: [kg/m^3], or
            mass: [kg], of which exactly one is given.

        Raises:
            MeshError: if the volume is unknown, or not exactly one positive number is given.
        """
        check_weight(density, mass)
        if not np.isfinite(self.volume):
            raise MeshError("the mesh has no sound volume, so mass and inertia cannot be told; give them by hand")
        density = mass / self.volume if density is None else density
        inertia = density * self.inertia
        moments, axes = principal_axes(inertia)
        return MassProperties(density * self.volume, self.centre, inertia, moments, axes)
