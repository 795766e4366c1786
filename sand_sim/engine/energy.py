"""Sums over all grains and contacts, in blocks of fixed size so that they do not depend on the number of shares."""

from functools import cache

import warp as wp

from sand_sim.engine.count import count_of, part_start
from sand_sim.engine.kernel import kernel
from sand_sim.engine.recipe import Recipe
from sand_sim.integrator import VERLET
from sand_sim.precision import Precision

BLOCK = 256  # items per partial sum


def blocks_for(items: int) -> int:
    """Partial sums for a number of items."""
    return -(-items // BLOCK)


@cache
def build_grain_energy(recipe: Recipe) -> wp.Kernel:
    """Kernel for energies of spheres that are no members of a body: ``blocks`` holds translation, rotation and height [J].

    ``fastest`` is the top speed of all spheres [m/s], members of clumps and bodies with what they gain by turning.
    """
    precision, rotation, bodies = recipe.precision, recipe.rotation, recipe.bodies
    spin_type = precision.vec3 if recipe.integrator == VERLET else precision.vec4
    real, whole, vec3, vec4, whole4 = precision.real, precision.whole, precision.vec3, precision.vec4, precision.whole4

    @kernel
    def grain_energy(
        lane: int,
        shares: int,
        spans: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        turning_now: wp.array(dtype=spin_type),
        spin: wp.array(dtype=vec4),
        member: wp.array(dtype=int),
        gravity: vec3,
        quantum: real,
        blocks: wp.array(dtype=wp.vec3d),
        fastest: wp.array(dtype=real),
    ):
        own = lane + wp.tid()
        grains = count_of(spans)
        number = (grains + wp.static(BLOCK) - 1) // wp.static(BLOCK)
        top = real(0.0)
        for block in range(part_start(number, own, shares), part_start(number, own + 1, shares)):
            total = wp.vec3d(wp.float64(0.0))
            first = block * wp.static(BLOCK)
            for i in range(first, wp.min(first + wp.static(BLOCK), grains)):
                here = place[i]
                if here[3] > whole(0):
                    of_i = motion[i]
                    velocity = vec3(of_i[0], of_i[1], of_i[2])
                    square = wp.dot(velocity, velocity)
                    top = wp.max(top, square)  # members count as well: their contacts, too, are as short as they are fast
                    part = int(-1)
                    if wp.static(bodies):
                        part = member[i]
                    if part >= 0:
                        continue
                    height = -wp.dot(gravity, vec3(real(here[0]), real(here[1]), real(here[2])) * quantum)
                    turning = real(0.0)
                    if wp.static(rotation):
                        omega = vec3(turning_now[i][0], turning_now[i][1], turning_now[i][2])
                        turning = spin[i][3] * wp.dot(omega, omega)
                    total += wp.vec3d(
                        wp.float64(real(0.5) * of_i[3] * square),
                        wp.float64(real(0.5) * turning),
                        wp.float64(of_i[3] * height),
                    )
            blocks[block] = total
        fastest[own] = wp.sqrt(top)

    return grain_energy


@cache
def build_body_energy(precision: Precision) -> wp.Kernel:
    """Kernel for energies of rigid bodies: ``blocks`` holds translation, rotation and height [J]."""
    real, whole, vec3, vec4, whole4 = precision.real, precision.whole, precision.vec3, precision.vec4, precision.whole4

    @kernel
    def body_energy(
        lane: int,
        shares: int,
        bodies: int,
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        velocity: wp.array(dtype=wp.vec3d),
        spin: wp.array(dtype=wp.vec3d),
        turn: wp.array(dtype=wp.quatd),
        inertia: wp.array(dtype=wp.vec3d),
        gravity: vec3,
        quantum: real,
        blocks: wp.array(dtype=wp.vec3d),
    ):
        own = lane + wp.tid()
        number = (bodies + wp.static(BLOCK) - 1) // wp.static(BLOCK)
        for block in range(part_start(number, own, shares), part_start(number, own + 1, shares)):
            total = wp.vec3d(wp.float64(0.0))
            first = block * wp.static(BLOCK)
            for b in range(first, wp.min(first + wp.static(BLOCK), bodies)):
                here = place[b]
                if here[3] > whole(0):
                    mass = wp.float64(motion[b][3])
                    omega = wp.quat_rotate_inv(turn[b], spin[b])
                    height = -wp.dot(gravity, vec3(real(here[0]), real(here[1]), real(here[2])) * quantum)
                    total += wp.vec3d(
                        wp.float64(0.5) * mass * wp.dot(velocity[b], velocity[b]),
                        wp.float64(0.5) * wp.dot(wp.cw_mul(inertia[b], omega), omega),
                        mass * wp.float64(height),
                    )
            blocks[block] = total

    return body_energy


@cache
def build_contact_energy(precision: Precision) -> wp.Kernel:
    """Kernel that sums the energies stored in contacts [J] and counts those that act."""
    real = precision.real

    @kernel
    def contact_energy(
        lane: int, shares: int, spans: wp.array(dtype=int), energy: wp.array(dtype=real), blocks: wp.array(dtype=wp.vec2d)
    ):
        own = lane + wp.tid()
        contacts = count_of(spans)
        number = (contacts + wp.static(BLOCK) - 1) // wp.static(BLOCK)
        for block in range(part_start(number, own, shares), part_start(number, own + 1, shares)):
            total = wp.vec2d(wp.float64(0.0))
            first = block * wp.static(BLOCK)
            for contact in range(first, wp.min(first + wp.static(BLOCK), contacts)):
                stored = wp.float64(energy[contact])
                if stored != wp.float64(0.0):
                    total += wp.vec2d(stored, wp.float64(1.0))
            blocks[block] = total

    return contact_energy
