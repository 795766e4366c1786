"""Whether a run can be trusted, and if not, why."""

from dataclasses import replace

from sand_sim.border import Health

# Overlap over radius beyond which Hertz's assumption of a small contact patch fails: its radius is 0.22 of the grain's there.
DEEP = 0.1
GAINED = 0.01  # share of the energy handled that may appear from nowhere


def find_doubts(health: Health, expected_speed: float) -> Health:
    """Fill in ``doubts``.

    Args:
        health: indicators.
        expected_speed: fastest speed the time step was chosen for [m/s].
    """
    doubts = []
    if health.step_ratio > 1.0001:
        doubts.append(f"time step is {health.step_ratio:.2g} times the safe one")
    if health.deepest > DEEP:
        doubts.append(f"overlap reached {100.0 * health.deepest:.1f} % of a radius; stiffen the material or slow the tool")
    if health.fastest > 2.0 * expected_speed:
        doubts.append(f"grains move at {health.fastest:.3g} m/s, the time step expects {expected_speed:.3g}")
    handled = health.kinetic + abs(health.potential) + health.elastic + abs(health.tool_work)
    if -health.dissipated > GAINED * handled:
        doubts.append(f"{-health.dissipated:.3g} J appeared from nowhere; take a smaller time step")
    return replace(health, doubts=tuple(doubts))
