"""What happens to a world before its time zero: grains come to rest, and what lies too high is struck off."""

import numpy as np

from sand_sim.assemble import Assembly
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.observing import observe_grains
from sand_sim.scene.types import SceneError
from sand_sim.tool_model import Progress

_CHUNKS = 50


def settle(assembly: Assembly, doubts: tuple[str, ...], progress: Progress) -> list[str]:
    """Let the grains come to rest as the scene asks, and strike off what then lies above the height of its fill.

    Args:
        assembly: the world's.
        doubts: that were there before the first step.
        progress: called with the name of the stage and the share of it that is done, 0 to 1.

    Returns:
        What the user should know: that grains have not come to rest, have left, or do not come up to the height of their fill.

    Raises:
        SceneError: if the bed blows up, or all grains leave.
    """
    if assembly.scene.settle.time > 0.0:
        told = _come_to_rest(assembly, doubts, progress)
        left = assembly.table.grains - len(observe_grains(assembly))
        if left:
            told.append(
                f"settle: {left} of {assembly.table.grains} grains left the domain while they settled; close the boundaries or "
                "enlarge 'domain'"
            )
    else:
        early = [f"'{fill.name}'" for fill in assembly.scene.fills if fill.height is not None and any(assembly.scene.gravity)]
        told = [f"fills: {name} is struck off at its 'height' before it settles; give 'settle' a time" for name in early]
    return told + _strike_off(assembly)


def _come_to_rest(assembly: Assembly, doubts: tuple[str, ...], progress: Progress) -> list[str]:
    asked, step = assembly.scene.settle, assembly.time_step.value
    chunk = max(1, round(asked.time / _CHUNKS / step))
    gravity = float(np.linalg.norm(assembly.scene.gravity))
    turning = 2.0 * asked.speed / gravity if gravity else 0.0  # so long grains that begin to fall or turn are slow
    slow = 0.0
    for done in range(_CHUNKS):
        try:
            assembly.solver.run(chunk)
        except UnstableError as error:
            why = "; ".join(doubts) or f"try a smaller time step than {step:.2g} s"
            raise SceneError(f"settle: the bed blows up while it settles: {error}; {why}") from None
        assembly.solver.measure()
        cloud = observe_grains(assembly)
        if not len(cloud):
            raise SceneError("settle: all grains have left the domain; give the scene a floor and walls, or a larger 'domain'")
        speed = np.sqrt(np.sum(cloud.mass * cloud.speed**2) / np.sum(cloud.mass))
        progress("settling", (done + 1) / _CHUNKS)
        slow = slow + chunk * step if speed < asked.speed else 0.0
        if slow > turning:
            progress("settling", 1.0)
            return []
    return [
        f"settle: grains still move at {speed:.2g} m/s (root mean square) after {asked.time:g} s, speed {asked.speed:g} m/s was "
        "asked; give it more time or ask for less"
    ]


def _strike_off(assembly: Assembly) -> list[str]:
    """Take away what lies above the asked height of a fill; told is where nothing comes near to it."""
    cloud, first, told = observe_grains(assembly), 0, []
    for fill, number in zip(assembly.scene.fills, assembly.fill_numbers, strict=True):
        if fill.height is not None:
            own = (cloud.identity >= first) & (cloud.identity < first + number)
            top = cloud.position[:, 2] + cloud.radius - fill.low[2]
            above = top > fill.height
            highest = float(top[own].max(initial=-np.inf))
            if highest < fill.height - 2.0 * cloud.radius[own].max(initial=0.0):
                told.append(
                    f"fills: '{fill.name}' is only {highest:.3g} m high, not {fill.height:g} m; its grains pack densely or spread"
                )
            gone = cloud.identity[own & above]
            assembly.solver.remove(np.flatnonzero(np.isin(assembly.grain_of_sphere, gone)))
        first += number
    return told
