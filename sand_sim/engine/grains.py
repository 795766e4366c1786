"""The grains of a world as arrays on the device."""

import numpy as np
import warp as wp

from sand_sim.engine.count import Count
from sand_sim.engine.lattice import Lattice
from sand_sim.engine.recipe import Recipe
from sand_sim.grain_table import GrainTable
from sand_sim.integrator import VERLET


class Grains:
    """Grains on the device, renumbered at every neighbour search to stay in the order of their cells.

    Attributes:
        active: how many there are; retired grains lie behind the last.
        place: lattice position and, last, radius, whole4, shape (n,) [quantum].
        remainder: what the position is beyond whole quanta, vec3, shape (n,) [quantum].
        motion: velocity [m/s] and, last, mass [kg], vec4, shape (n,).
        spin: angular velocity [rad/s] and, last, moment of inertia [kg m^2], vec4, shape (n,); None without rotation.
        half_motion, half_spin: velocities half a step ago, vec3, shape (n,) [m/s], [rad/s]; None unless the integrator asks.
        motion_carry, spin_carry: what rounding took off the velocities, vec3, shape (n,); None unless the recipe asks.
        member: which member of the rigid bodies a sphere is, -1 for none, shape (n,), int; None without bodies.
        material: shape (n,), int; None if all grains are of one material.
        identity: row of the sphere in the scene's table, shape (n,), int.
        came_from: its number when the contact lists were made, shape (n,), int.
        origin: place when the contact lists were made, whole4, shape (n,).
    """

    def __init__(self, table: GrainTable, lattice: Lattice, recipe: Recipe, lanes: int, device: str):
        self.lattice, self.recipe, self.device, self.capacity = lattice, recipe, device, len(table)
        precision, number = recipe.precision, len(table)
        self.active = Count(number, lanes, device)
        self.place = wp.zeros(number, dtype=precision.whole4, device=device)
        self.remainder = wp.zeros(number, dtype=precision.vec3, device=device)
        self.motion = wp.zeros(number, dtype=precision.vec4, device=device)
        self.spin = wp.zeros(number, dtype=precision.vec4, device=device) if recipe.rotation else None
        halves, vec3 = recipe.integrator == VERLET, precision.vec3
        self.half_motion = wp.zeros(number, dtype=vec3, device=device) if halves else None
        self.half_spin = wp.zeros(number, dtype=vec3, device=device) if halves and recipe.rotation else None
        self.motion_carry = wp.zeros(number, dtype=vec3, device=device) if recipe.carry else None
        self.spin_carry = wp.zeros(number, dtype=vec3, device=device) if recipe.carry and recipe.rotation else None
        self.member = wp.zeros(number, dtype=int, device=device) if recipe.bodies else None
        self.material = wp.zeros(number, dtype=int, device=device) if recipe.materials else None
        self.identity = wp.zeros(number, dtype=int, device=device)
        self.came_from = wp.zeros(number, dtype=int, device=device)
        self.origin = wp.zeros(number, dtype=precision.whole4, device=device)
        self.load(table)

    @property
    def sorted_arrays(self) -> list[wp.array]:
        """All arrays that are renumbered together."""
        arrays = [self.place, self.remainder, self.motion, self.spin, self.half_motion, self.half_spin]
        arrays += [self.motion_carry, self.spin_carry, self.member, self.material, self.identity, self.came_from]
        return [array for array in arrays if array is not None]

    def load(self, table: GrainTable) -> None:
        """Fill the arrays from a table of the same length."""
        lattice, number = self.lattice, len(table)
        precision = self.recipe.precision
        radius = np.maximum(lattice.to_whole_length(table.radius), 1)
        exact = (np.asarray(table.position, float) - lattice.centre) / lattice.quantum
        self.place.assign(np.column_stack([lattice.to_lattice(table.position), radius]))
        self.remainder.assign((exact - np.rint(exact)).astype(precision.numpy_real))
        self.motion.assign(np.column_stack([table.velocity, table.mass]).astype(precision.numpy_real))
        if self.spin is not None:
            inertia = 0.4 * table.mass * table.radius**2
            self.spin.assign(np.column_stack([table.spin, inertia]).astype(precision.numpy_real))
        if self.half_motion is not None:
            self.half_motion.assign(table.velocity.astype(precision.numpy_real))
        if self.half_spin is not None:
            self.half_spin.assign(table.spin.astype(precision.numpy_real))
        if self.member is not None:
            self.member.assign(np.where(table.lone, -1, np.cumsum(~table.lone) - 1))
        if self.material is not None:
            self.material.assign(table.material)
        self.identity.assign(np.arange(number))
        self.came_from.assign(np.arange(number))
        self.active.set(number)
