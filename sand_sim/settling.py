"""What happens to a world before its time zero: grains come to rest, and what lies too high is struck off."""

import numpy as np

from sand_sim.assembly.assemble import Assembly, fall_height
from sand_sim.assembly.tool_model import Progress
from sand_sim.changes.clearance import find_obstacles
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.engine.reviving import revive
from sand_sim.readout.contact_reading import observe_grain_contacts
from sand_sim.readout.observing import observe_grains, observe_spheres, outer_force
from sand_sim.scene.types import SceneError

_CHUNKS = 50
_BORNE = 0.02  # share of the weight by which what bears a bed at rest may differ from it
_PERCHED = 0.02  # share of the grains that may stand on one other in a bed that has collapsed from its lattice
_UPRIGHT = 0.9  # cosine of the angle from the vertical at which a grain stands on another, not leans on it and on a wall
_TOPPLED = 10.0  # times sqrt(d/g): whoever stands askew by a twentieth of d has by then rolled off what it stood on
_FALL = 0.3  # of the speed at which the highest grain would end its fall
_THROWN = 10.0  # times the speed of a bed at rest: grains that are given more are meant to fly
_SLOWED = 0.2  # share of the time in which drag slows grains down, after which it is applied anew


def settle(assembly: Assembly, doubts: tuple[str, ...], progress: Progress) -> list[str]:
    """Let the grains come to rest as the scene asks, and strike off what then lies above the height of its fill.

    Bodies that are thrown are not there meanwhile: a ball that shall hit a bed would lie on it at time zero.

    Args:
        assembly: the world's.
        doubts: that were there before the first step.
        progress: called with the name of the stage and the share of it that is done, 0 to 1.

    Returns:
        What the user should know: that grains have lost velocities that they were given, have not come to rest, have left, or do
        not come up to the height of their fill.

    Raises:
        SceneError: if the bed blows up, all grains leave, or there is no room for a body that is thrown.
    """
    if assembly.scene.settle.time > 0.0:
        thrown, told = _thrown(assembly), _spent(assembly)
        if len(thrown):
            start = assembly.solver.take_state()
            assembly.solver.remove(thrown)
        struck = 0
        if len(thrown) < len(assembly.table):
            moving = _come_to_rest(assembly, doubts, progress)
            struck, short = _strike_off(assembly)
            if struck:  # what bore that load springs back
                moving = _come_to_rest(assembly, doubts, progress)
            told += moving + short
        if len(thrown):
            _check_room(assembly, thrown)
            revive(assembly.solver, start, thrown)
        left = assembly.table.grains - struck - len(observe_grains(assembly))
        if left:
            told.append(
                f"settle: {left} of {assembly.table.grains} grains left the domain while they settled; close the boundaries or "
                "enlarge 'domain'"
            )
    else:
        early = [f"'{fill.name}'" for fill in assembly.scene.fills if fill.height is not None and any(assembly.scene.gravity)]
        told = [f"fills: {name} is struck off at its 'height' before it settles; give 'settle' a time" for name in early]
        told += _strike_off(assembly)[1]
    return told


def _come_to_rest(assembly: Assembly, doubts: tuple[str, ...], progress: Progress) -> list[str]:
    asked, step = assembly.scene.settle, assembly.time_step.value
    chunk = max(1, round(asked.time / _CHUNKS / step))
    gravity = float(np.linalg.norm(assembly.scene.gravity))
    turning = 2.0 * asked.speed / gravity if gravity else 0.0  # so long grains that begin to fall or turn are slow
    drag = _drag(assembly, gravity)
    part = min(chunk, max(1, round(_SLOWED / drag / step))) if drag else chunk
    toppling = _TOPPLED * np.sqrt(2.0 * np.mean(assembly.table.radius) / gravity) if gravity else 0.0
    slow = 0.0
    for done in range(_CHUNKS):
        try:
            for first in range(0, chunk, part):
                assembly.solver.run(min(part, chunk - first))
                if drag:
                    _slow_down(assembly, np.exp(-drag * min(part, chunk - first) * step))
        except UnstableError as error:
            why = "; ".join(doubts) or f"try a smaller time step than {step:.2g} s"
            raise SceneError(f"settle: the bed blows up while it settles: {error}; {why}") from None
        assembly.solver.measure()
        cloud = observe_grains(assembly)
        if not len(cloud):
            raise SceneError("settle: all grains have left the domain; give the scene a floor and walls, or a larger 'domain'")
        mass = np.sum(cloud.mass)
        speed = np.sqrt(np.sum(cloud.mass * cloud.speed**2) / mass)
        unborne = np.linalg.norm(outer_force(assembly, mass)[0]) / (mass * gravity) if gravity else 0.0
        progress("settling", (done + 1) / _CHUNKS)
        slow = slow + chunk * step if speed < asked.speed else 0.0
        if slow > turning and unborne < _BORNE:  # a soft bed springs slowly
            perched = _perched(assembly) if slow < toppling else 0.0
            if perched < _PERCHED:
                progress("settling", 1.0)
                return []
    if slow > turning and unborne < _BORNE:
        return [
            f"settle: grains are slow after {asked.time:g} s, but {100.0 * perched:.2g} % of them stand on one other and may "
            "roll off it; give it more time"
        ]
    if slow > turning:
        return [
            f"settle: grains are slow after {asked.time:g} s, but what bears them differs from their weight by "
            f"{100.0 * unborne:.2g} %: they fall or spring; give it more time"
        ]
    if slow:
        return [
            f"settle: grains have been slower than {asked.speed:g} m/s for only {slow:.2g} s after {asked.time:g} s, not for the "
            f"{turning:.2g} s in which those that begin to fall are slow, too; give it more time"
        ]
    return [
        f"settle: grains still move at {speed:.2g} m/s (root mean square) after {asked.time:g} s, speed {asked.speed:g} m/s was "
        "asked; give it more time or ask for less"
    ]


def _perched(assembly: Assembly) -> float:
    """Share of the grains that touch one other only, which bears them.

    A few layers stay the columns of the lattice that they began in for a while, slower than asked, until those roll off.
    """
    contacts, down = observe_grain_contacts(assembly), np.asarray(assembly.scene.gravity, float)
    steepness = contacts.normal @ down / np.linalg.norm(down)
    touching = np.bincount(np.concatenate([contacts.first, contacts.second]), minlength=assembly.table.grains)
    upper = np.concatenate([contacts.first[steepness < -_UPRIGHT], contacts.second[steepness > _UPRIGHT]])
    return float(np.sum(touching[upper] == 1) / len(observe_grains(assembly)))


def _thrown(assembly: Assembly) -> np.ndarray:
    """Identities of the spheres of bodies that are given a velocity or a spin, shape (n,)."""
    first = sum(assembly.fill_numbers)
    bodies = [k for k, body in enumerate(assembly.scene.bodies, first) if any(body.velocity) or any(body.spin)]
    return np.flatnonzero(np.isin(assembly.grain_of_sphere, bodies))


def _check_room(assembly: Assembly, thrown: np.ndarray) -> None:
    """See that bodies that are thrown, of whose spheres the identities are given, overlap nothing as they come in."""
    assembly.solver.measure()
    table, poses = assembly.table, [(tool.pose.position, tool.pose.orientation) for tool in assembly.scene.tools]
    there = find_obstacles(assembly, observe_spheres(assembly), poses, table.position[thrown], table.radius[thrown])
    there.pop("one another", None)
    if there:
        name, which = next(iter(there.items()))
        body = assembly.scene.bodies[assembly.grain_of_sphere[thrown[which[0]]] - sum(assembly.fill_numbers)]
        raise SceneError(
            f"bodies.{body.name}: is given a velocity or a spin, so it comes in when beds have settled, and overlaps {name} "
            "then; place it higher"
        )


def _spent(assembly: Assembly) -> list[str]:
    """Warnings of fills that are thrown: by time zero their grains have landed."""
    scene, speed = assembly.scene, np.linalg.norm(assembly.table.velocity, axis=1)
    fast, first, told = assembly.grain_of_sphere[speed > _THROWN * scene.settle.speed], 0, []
    for fill, number in zip(scene.fills, assembly.fill_numbers, strict=True):
        if np.any((fast >= first) & (fast < first + number)):
            told.append(
                f"settle: fill '{fill.name}' is given a velocity, which it has lost by time zero, as it flies while others "
                "settle; settle the bed in a scene of its own and read its grains from a file here, or throw a body"
            )
        first += number
    return told


def _drag(assembly: Assembly, gravity: float) -> float:
    """Rate at which a liquid slows grains down that fall in it no faster than asked, or than is good for a bed [1/s].

    A column that falls freely is braked by its walls and springs back: these then push it down for ever, and the floor of a silo
    carries more than its weight.
    """
    fall = assembly.scene.settle.fall
    if not gravity:
        return 0.0
    if fall is None:
        height = fall_height(assembly.scene, assembly.table, assembly.walls, assembly.grounds)
        fall = _FALL * np.sqrt(2.0 * gravity * (height + 2.0 * assembly.table.radius.max()))
    return float(gravity / fall)


def _slow_down(assembly: Assembly, share: float) -> None:
    """Leave grains a share of their velocities."""
    arrays = assembly.solver.arrays
    for movers in filter(None, (arrays.grains, arrays.bodies)):
        for motion in (movers.motion, movers.half_motion):
            if motion is not None:
                velocity = motion.numpy()
                velocity[:, :3] *= share
                motion.assign(velocity)


def _strike_off(assembly: Assembly) -> tuple[int, list[str]]:
    """Take away what lies above the asked height of each fill; returns how many grains, and warnings of fills far below it."""
    cloud, first, struck, told = observe_grains(assembly), 0, 0, []
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
            struck += len(gone)
        first += number
    return struck, told
