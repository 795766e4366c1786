"""Pushes: what drives free rigid bodies from outside, beside gravity and contacts."""

from collections.abc import Sequence

import numpy as np
import warp as wp


@wp.struct
class Push:
    """Force and torque on a body, and what they have done.

    A push changes between two steps: what has acted until then completes the step before, what acts from then on begins the next.
    """

    lever: wp.vec3d  # [m] from the centre of mass to where the force acts, principal frame
    force: wp.vec3d  # [N] from now on, world frame
    torque: wp.vec3d  # [N m] the same, about the point where the force acts
    acted_force: wp.vec3d  # [N] until now
    acted_torque: wp.vec3d  # [N m] until now
    way: wp.vec3d  # [m] of the centre of mass over the last step
    turn: wp.vec3d  # [rad] over the last step, world frame
    work: wp.float64  # [J] since the start, but for the half of the last step that its end completes


def no_pushes(levers: Sequence[np.ndarray], device: str) -> wp.array:
    """``Push`` structs that do nothing yet, one for each lever."""
    rows = []
    for lever in levers:
        row = Push()
        row.lever = wp.vec3d(*lever)
        rows.append(row)
    return wp.array(rows, dtype=Push, device=device)


def set_push(pushes: wp.array, index: int, force: np.ndarray, torque: np.ndarray) -> None:
    """Give one of them another force [N] and torque [N m], shape (3,) each, from the next step on."""
    rows = pushes.numpy().copy()
    rows["force"][index], rows["torque"][index] = force, torque
    pushes.assign(wp.array(rows, dtype=Push, device="cpu"))


def forget_push(pushes: wp.array, index: int) -> None:
    """Push one of them no more, which is somewhere else now; what has been done stays."""
    rows = pushes.numpy().copy()
    for name in ("force", "torque", "acted_force", "acted_torque", "way", "turn"):
        rows[name][index] = 0.0
    pushes.assign(wp.array(rows, dtype=Push, device="cpu"))


@wp.func
def begin_push(push: Push, fresh: bool) -> Push:
    """At the begin of a step; ``fresh`` if there is no step before that is to be completed."""
    begun = push
    if fresh:
        begun.acted_force = push.force
        begun.acted_torque = push.torque
    return begun


@wp.func
def mean_force(push: Push) -> wp.vec3d:
    """That takes velocities from the middle of a step to the middle of the next [N]."""
    return wp.float64(0.5) * (push.acted_force + push.force)


@wp.func
def torque_about_centre(push: Push, torque: wp.vec3d, force: wp.vec3d, orientation: wp.quatd) -> wp.vec3d:
    """Torque about the centre of mass [N m] of a torque and a force where this one acts, on a body that is turned so."""
    return torque + wp.cross(wp.quat_rotate(orientation, push.lever), force)


@wp.func
def end_push(push: Push, orientation: wp.quatd, way: wp.vec3d, turn: wp.vec3d) -> Push:
    """At the end of a step that began with this orientation: add work, half the step before and half this one."""
    acted = torque_about_centre(push, push.acted_torque, push.acted_force, orientation)
    acts = torque_about_centre(push, push.torque, push.force, orientation)
    ended = push
    ended.acted_force = push.force
    ended.acted_torque = push.torque
    done = wp.dot(push.acted_force, push.way) + wp.dot(acted, push.turn) + wp.dot(push.force, way) + wp.dot(acts, turn)
    ended.work = push.work + wp.float64(0.5) * done
    ended.way = way
    ended.turn = turn
    return ended
