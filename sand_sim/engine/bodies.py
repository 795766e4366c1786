"""Free rigid bodies as arrays on the device: what moves as one, while its spheres are sorted and searched like grains."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from sand_sim.engine.count import Count
from sand_sim.engine.lattice import Lattice
from sand_sim.engine.pushes import no_pushes
from sand_sim.engine.recipe import Recipe
from sand_sim.grain_table import GrainTable
from sand_sim.integrator import VERLET
from sand_sim.rotation import to_matrices


class Bodies:
    """Rigid bodies on the device; they keep their numbers.

    The spheres of body b are its members ``starts[b]`` to ``starts[b + 1]``; member m is at present sphere ``sphere_at[m]``.

    Attributes:
        count: how many there are.
        members: how many spheres they have.
        starts: int, shape (n + 1,).
        body_of: body of a member, int, shape (members,).
        sphere_at: number of the sphere that is a member, int, shape (members,).
        offset: of a member in the body frame, vec3, shape (members,) [m].
        place: lattice position of the centre of mass and, last, one, or zero once retired, whole4, shape (n,) [quantum].
        remainder: what the position is beyond whole quanta, vec3, shape (n,) [quantum].
        motion: velocity [m/s] and mass [kg], vec4, shape (n,).
        half_motion: velocity half a step ago, vec3, shape (n,) [m/s]; None unless the integrator asks.
        motion_carry: what rounding took off the velocity, vec3, shape (n,) [m/s]; None unless the recipe asks.
        turn: body frame to world frame, quatd, shape (n,).
        momentum: angular, world frame, half a step ago if the integrator asks, vec3d, shape (n,) [kg m^2/s].
        inertia: principal moments, vec3d, shape (n,) [kg m^2].
        seen_velocity, seen_spin: of now, for those who look, vec3d, shape (n,) [m/s], [rad/s].
        pushes: ``Push`` structs of the last bodies, those that may be pushed; None unless the recipe asks.
        unpushed: number of the bodies before them.
    """

    def __init__(
        self,
        table: GrainTable,
        lattice: Lattice,
        recipe: Recipe,
        lanes: int,
        device: str,
        levers: Sequence[np.ndarray] = (),
    ):
        precision, bodies = recipe.precision, table.bodies
        number, owned = len(bodies), table.body[~table.lone]
        self.members = len(owned)
        self.count = Count(number, lanes, device)
        self.count.set(number)
        starts = np.searchsorted(owned, np.arange(number + 1))
        self.starts = wp.array(starts, dtype=int, device=device)
        self.body_of = wp.array(owned, dtype=int, device=device)
        self.sphere_at = wp.array(np.flatnonzero(~table.lone), dtype=int, device=device)
        real = precision.numpy_real
        self.offset = wp.array(table.offset[~table.lone].astype(real), dtype=precision.vec3, device=device)
        exact = (bodies.position - lattice.centre) / lattice.quantum
        place = np.column_stack([lattice.to_lattice(bodies.position), np.ones(number)]).astype(precision.numpy_whole)
        self.place = wp.array(place, dtype=precision.whole4, device=device)
        self.remainder = wp.array((exact - np.rint(exact)).astype(real), dtype=precision.vec3, device=device)
        motion = np.column_stack([bodies.velocity, bodies.mass]).astype(real)
        self.motion = wp.array(motion, dtype=precision.vec4, device=device)
        self.half_motion = None
        if recipe.integrator == VERLET:
            self.half_motion = wp.array(bodies.velocity.astype(real), dtype=precision.vec3, device=device)
        self.motion_carry = wp.zeros(number, dtype=precision.vec3, device=device) if recipe.carry else None
        self.turn = wp.array(bodies.orientation, dtype=wp.quatd, device=device)
        self.inertia = wp.array(bodies.inertia, dtype=wp.vec3d, device=device)
        self.momentum = wp.array(_angular_momentum(table), dtype=wp.vec3d, device=device)
        self.seen_velocity, self.seen_spin = (wp.zeros(number, dtype=wp.vec3d, device=device) for _ in range(2))
        self.pushes, self.unpushed = no_pushes(levers, device) if recipe.pushed else None, number - len(levers)


def _angular_momentum(table: GrainTable) -> np.ndarray:
    bodies = table.bodies
    axes = to_matrices(bodies.orientation)
    local = np.einsum("nji,nj->ni", axes, bodies.spin) * bodies.inertia
    return np.einsum("nij,nj->ni", axes, local)
