"""Rows of spheres and bodies for grains that are rigid lists of spheres."""

import numpy as np

from sand_sim import rotation
from sand_sim.grain_table import BodyTable, GrainTable
from sand_sim.scene.shapes import Shape


def place_clumps(
    shape: Shape,
    position: np.ndarray,
    orientation: np.ndarray,
    equal_radius: np.ndarray,
    velocity: np.ndarray,
    spin: np.ndarray,
    density: float,
    material: int,
) -> GrainTable:
    """Grains of one shape, scaled to the volumes of spheres.

    Args:
        shape: in any size.
        position: of the centres of mass, shape (n, 3) [m].
        orientation: principal frame to world frame, shape (n, 4).
        equal_radius: of the spheres of the same volume, shape (n,) [m].
        velocity: shape (n, 3) [m/s].
        spin: world frame, shape (n, 3) [rad/s].
        density: of the solid [kg/m^3].
        material: index of the material.
    """
    number, parts = len(equal_radius), len(shape.radii)
    scale = equal_radius / shape.equal_radius
    mass = density * shape.volume * scale**3
    bodies = BodyTable(position, orientation, velocity, spin, mass, mass[:, None] * scale[:, None] ** 2 * shape.gyration)
    offset = (scale[:, None, None] * shape.centres).reshape(-1, 3)
    return members_of(
        bodies, np.repeat(np.arange(number), parts), offset, np.outer(scale, shape.radii).ravel(), density, material
    )


def members_of(
    bodies: BodyTable, body: np.ndarray, offset: np.ndarray, radius: np.ndarray, density: float, material: int
) -> GrainTable:
    """The spheres of bodies.

    Args:
        bodies: one row each.
        body: row of the body a sphere belongs to, in order, shape (m,), int.
        offset: of the spheres in the body frames, shape (m, 3) [m].
        radius: shape (m,) [m].
        density: [kg/m^3].
        material: index of the material.
    """
    arm = np.einsum("nij,nj->ni", rotation.to_matrices(bodies.orientation)[body], offset)
    spin = bodies.spin[body]
    return GrainTable(
        position=bodies.position[body] + arm,
        velocity=bodies.velocity[body] + np.cross(spin, arm),
        spin=spin,
        radius=radius,
        density=np.full(len(radius), density),
        material=np.full(len(radius), material),
        body=body,
        offset=offset,
        bodies=bodies,
    )
