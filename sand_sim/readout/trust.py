"""Whether a run can be trusted, and if not, why."""

import re
from dataclasses import replace

from sand_sim.border import Health
from sand_sim.scene.stable_step import DEEP

GAINED = 0.01  # share of the energy handled that may appear from nowhere
HASTY = 2.0  # times the step that the present top speed asks for
UNBALANCED = 1e-3  # of all forces that may be without a cause
_CRUSHED = 0.5  # of a radius, more than any bed bears by its own weight
BLOWN_UP = 0.5  # share beyond which the run is stopped


def find_doubts(health: Health, safe_now: float, beforehand: tuple[str, ...] = ()) -> Health:
    """Fill in ``doubts``.

    Args:
        health: indicators.
        safe_now: time step that would be chosen for the present top speed, infinite where that is no more than expected [s].
        beforehand: doubts that were there before the first step.
    """
    doubts = list(beforehand)
    if health.step_ratio > 1.0001:
        doubts.append(f"time step is {health.step_ratio:.2g} times the safe one")
    if health.deepest > DEEP:
        remedy = "stiffen the material or slow what presses on it"
        if health.deepest > _CRUSHED:
            remedy += "; or does a tool crush grains against a wall, which it goes through?"
        doubts.append(f"overlap reached {100.0 * health.deepest:.1f} % of a radius; {remedy}")
    if health.time_step > HASTY * safe_now:
        doubts.append(f"grains move at {health.fastest:.3g} m/s, which asks for a time step of {safe_now:.2g} s")
    if gained_share(health) > GAINED:
        doubts.append(f"{health.gained:.3g} J appeared from nowhere; take a smaller time step")
    if health.momentum_residual > UNBALANCED:
        share = 100.0 * health.momentum_residual
        doubts.append(f"{share:.2g} % of the forces on grains have no counterpart; a fault of the program, please report it")
    return replace(health, doubts=tuple(doubts))


def kind_of(doubt: str) -> str:
    """What a doubt is about, whatever its numbers are at the moment and what is advised."""
    return re.sub(r"\S*\d\S*", "#", re.split(r"[;,] ", doubt)[0])


def gained_share(health: Health) -> float:
    """Energy that appeared from nowhere over all energy handled so far [1].

    What bonds store lies below zero; taken with its sign it would leave nothing to compare with where grains stick together.
    """
    handled = health.kinetic + abs(health.potential) + abs(health.elastic) + abs(health.tool_work)
    return health.gained / handled if handled > 0.0 else 0.0
