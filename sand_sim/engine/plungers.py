"""Plungers: walls that move along their normal, at a velocity or as a mass that a force presses on the grains."""

from functools import cache

import numpy as np
import warp as wp

from sand_sim.engine.count import count_of, part_start
from sand_sim.engine.kernel import kernel
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.surfaces import Surface, build_surface_of

SUM_BLOCK = 128  # contacts per partial sum of a force; fixed, so that the sum does not depend on the number of shares


@wp.struct
class Plunger:
    """How a plunger is driven."""

    pressed: int  # by a force; otherwise it keeps its velocity
    velocity: wp.float64  # [m/s] towards the grains
    force: wp.float64  # [N] towards the grains
    mass: wp.float64  # [kg]
    max_speed: wp.float64  # [m/s]
    travel: wp.float64  # [m] farthest from the start, either way


@wp.struct
class PlungerState:
    """Where a plunger is; all along its direction."""

    shift: wp.float64  # [quantum] from the start
    offset: wp.float64  # [m] the same
    velocity: wp.float64  # [m/s] half a step ago
    seen: wp.float64  # [m/s] of now, which the grains feel
    travelled: wp.float64  # [m] since the contact lists were made
    force: wp.float64  # [N] of the grains on it
    work: wp.float64  # [J] on the grains since the start


class Plungers:
    """All plungers of a world.

    Attributes:
        number: how many.
        drives: ``Plunger`` structs, shape (plungers,).
        states: ``PlungerState`` structs, shape (plungers,).
        engaged: whether they move yet, int, shape (1,): 0 no, 1 from the next step on, 2 yes.
    """

    def __init__(self, drives: list, device: str):
        self.number = len(drives)
        self.drives = wp.array(drives, dtype=Plunger, device=device)
        self.states = wp.zeros(self.number, dtype=PlungerState, device=device)
        self.engaged = wp.zeros(1, dtype=int, device=device)

    def engage(self) -> None:
        """Let them move from now on."""
        states, drives = self.states.numpy().copy(), self.drives.numpy()
        states["velocity"] = states["seen"] = np.where(drives["pressed"], 0.0, drives["velocity"])
        states["work"] = 0.0
        self.states.assign(wp.array(states, dtype=PlungerState, device="cpu"))
        self.engaged.fill_(1)


@cache
def build_plunger_blocks(recipe: Recipe) -> wp.Kernel:
    """Kernel that sums the force of the grains on each plunger over blocks of contacts, shape (blocks * plungers,) [N]."""
    vec4, surface_of = recipe.precision.vec4, build_surface_of(recipe)

    @kernel
    def plunger_blocks(
        lane: int,
        shares: int,
        pair_spans: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        force: wp.array(dtype=vec4),
        walls: wp.array(dtype=Surface),
        plungers: int,
        blocks: wp.array(dtype=wp.float64),
    ):
        own = lane + wp.tid()
        pairs = count_of(pair_spans)
        number = (pairs + wp.static(SUM_BLOCK) - 1) // wp.static(SUM_BLOCK)
        for block in range(part_start(number, own, shares), part_start(number, own + 1, shares)):
            for plunger in range(plungers):
                blocks[block * plungers + plunger] = wp.float64(0.0)
            first = block * wp.static(SUM_BLOCK)
            for contact in range(first, wp.min(first + wp.static(SUM_BLOCK), pairs)):
                wall = surface_of(walls, partner[contact])
                plunger = walls[wall].plunger
                if plunger >= 0:
                    push = force[contact]
                    along = wp.dot(wp.vec3d(wp.float64(push[0]), wp.float64(push[1]), wp.float64(push[2])), walls[wall].direction)
                    blocks[block * plungers + plunger] = blocks[block * plungers + plunger] - along

    return plunger_blocks


@kernel
def advance_plungers(
    pair_spans: wp.array(dtype=int),
    blocks: wp.array(dtype=wp.float64),
    drives: wp.array(dtype=Plunger),
    states: wp.array(dtype=PlungerState),
    engaged: wp.array(dtype=int),
    dt: wp.float64,
    inverse_quantum: wp.float64,
    skin: wp.array(dtype=wp.float64),
    moved: wp.array(dtype=int),
):
    """Sum the forces and move all plungers by one step, as the grains: ``w += a dt``, ``x += w dt``, ``v = w + a dt/2``.

    The first step takes ``w += a dt/2``.

    The work of a force is that over half the step before and half the step after.

    Raises the flag ``moved`` if one has moved farther than half the skin [quantum] since the contact lists were made.
    """
    plungers = drives.shape[0]
    pairs = count_of(pair_spans)
    number = (pairs + wp.static(SUM_BLOCK) - 1) // wp.static(SUM_BLOCK)
    for k in range(plungers):
        drive = drives[k]
        state = states[k]
        total = wp.float64(0.0)
        for block in range(number):
            total += blocks[block * plungers + k]
        state.force = total
        if engaged[0] != 0:
            before = state.velocity * dt
            if drive.pressed != 0:
                gained = (drive.force + total) / drive.mass * dt
                half = wp.float64(0.5) * gained
                if engaged[0] == 1:
                    gained = half
                state.velocity = wp.clamp(state.velocity + gained, -drive.max_speed, drive.max_speed)
                state.seen = wp.clamp(state.velocity + half, -drive.max_speed, drive.max_speed)
            reached = state.offset + state.velocity * dt
            if wp.abs(reached) >= drive.travel and state.velocity * state.offset >= wp.float64(0.0):
                reached = wp.clamp(reached, -drive.travel, drive.travel)
                state.velocity = wp.float64(0.0)
                state.seen = wp.float64(0.0)
            step = reached - state.offset
            state.work = state.work - total * wp.float64(0.5) * (before + step)
            state.offset = reached
            state.shift = reached * inverse_quantum
            state.travelled = state.travelled + wp.abs(step)
            if state.travelled * inverse_quantum > wp.float64(0.5) * skin[0]:
                moved[0] = 1
        states[k] = state
    if engaged[0] == 1:
        engaged[0] = 2


@kernel
def forget_plunger_travel(states: wp.array(dtype=PlungerState)):
    """The contact lists are new: no plunger has moved since."""
    for k in range(states.shape[0]):
        state = states[k]
        state.travelled = wp.float64(0.0)
        states[k] = state
