"""The rigid particle body made from a mesh."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh

from sampler.distance import SignedDistance
from sampler.errors import MeshError
from sampler.spreading import spread_particles

SPACING = 1.5  # default distance between neighbours in particle radii; below 2 so that particles overlap into a closed skin


@dataclass(frozen=True)
class ParticleBody:
    """A rigid list of spheres with the mass properties of the solid it was sampled from; mesh frame throughout.

    Attributes:
        points: particle centres, on the surface, shape (n, 3) [m].
        normals: outward normals of the faces they lie on, shape (n, 3).
        radius: of every particle [m].
        spacing: asked distance between neighbours [m].
        volume: of the solid [m^3]; NaN where the mesh is not closed.
        centre: centre of mass at uniform density, shape (3,) [m].
        inertia: about the centre per unit density, shape (3, 3) [m^5].
    """

    points: np.ndarray
    normals: np.ndarray
    radius: float
    spacing: float
    volume: float
    centre: np.ndarray
    inertia: np.ndarray

    def __len__(self) -> int:
        return len(self.points)


def sample_body(
    mesh: trimesh.Trimesh,
    radius: float,
    spacing: float | None = None,
    seed: int = 0,
    device: str = "cpu",
    progress: Callable[[float], None] = lambda share: None,
) -> ParticleBody:
    """Sample a mesh into a particle body.

    Args:
        mesh: in metres.
        radius: of every particle [m].
        spacing: wanted distance between neighbours [m]; 1.5 radii if None.
        seed: of the random start.
        device: Warp device.
        progress: called with the share of the work done, 0 to 1.

    Raises:
        MeshError: if radius or spacing are not positive, or the particles would be too many to be meant.
    """
    spacing = SPACING * radius if spacing is None else spacing
    for name, value in (("radius", radius), ("spacing", spacing)):
        if not np.isfinite(value) or value <= 0.0:
            raise MeshError(f"particle {name} must be positive [m], got {value}")
    if mesh.area / spacing**2 > 2e6:
        raise MeshError(
            f"a surface of {mesh.area:.3g} m^2 would need {mesh.area / spacing**2:.2g} particles of radius {radius:.3g} m; "
            "check the mesh's scale, or take larger particles"
        )
    field = SignedDistance(mesh, device)
    points = spread_particles(mesh, field, spacing, seed, progress)
    _, _, normals = field.query(points)
    closed = bool(mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0)
    solid = mesh.mass_properties if closed else None
    return ParticleBody(
        points=points,
        normals=normals.astype(float),
        radius=radius,
        spacing=spacing,
        volume=float(solid.volume) if closed else float("nan"),
        centre=np.asarray(solid.center_mass if closed else mesh.centroid, float),
        inertia=np.asarray(solid.inertia, float) if closed else np.full((3, 3), np.nan),
    )
