"""What grains touch of tools and terrains: the particles of rough ones, the triangles of smooth ones."""

import numpy as np

from sampler import ParticleBody
from sampler.geometry.surface import Surface
from sand_sim.reach import Reach, reach_of

_NEAR = 1e-5  # of the diagonal: where sides of a triangle are looked at


def reach_of_touched(body: ParticleBody, surface: np.ndarray | None) -> Reach:
    """Reach of what grains touch.

    Args:
        body: the particles.
        surface: of a smooth one, shape (n, 3, 3) [m], which counts instead.
    """
    return reach_of(body.points, body.radius) if surface is None else reach_of(surface.reshape(-1, 3), 0.0)


def outward_triangles(triangles: np.ndarray) -> np.ndarray:
    """Triangles turned so that all look out of the solid; those of badly damaged meshes that have it on no side look both ways.

    A grain just outside a triangle that looks the wrong way would be taken for one that is deep inside the tool.
    """
    around = Surface(triangles)
    centres, step = triangles.mean(axis=1), _NEAR * around.unit * around.normals
    solid_before, solid_behind = (np.abs(around.winding(centres + side * step)) > 0.5 for side in (1.0, -1.0))
    turned = np.where((solid_before & ~solid_behind)[:, None, None], triangles[:, ::-1], triangles)
    return np.concatenate([turned, triangles[~solid_before & ~solid_behind][:, ::-1]])
