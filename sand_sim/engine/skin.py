"""How far each grain may move before the contact lists are made anew, chosen while a world runs.

A pair is listed if the two come within reach when each has moved as far as it is allowed to. Grains that have moved little since
the lists were made are allowed little, so that a bed at rest around a moving tool lists hardly a pair that does not touch. A
search costs as much as, in ``_SEARCH`` steps, the useless pairs of grains that are allowed half a radius r each. With grains that
move by t a step on the mean lists for S steps cost ``_SEARCH/S + 2 _SPARE t S/r``, least at ``S = sqrt(_SEARCH r/(2 _SPARE t))``.
"""

from functools import cache

import warp as wp

from sand_sim.engine.count import count_of, part_start
from sand_sim.engine.kernel import kernel, sure
from sand_sim.precision import Precision

_SEARCH = 2.4  # measured: benchmarks/profile.py says 3.5; lists seldom last as long as they should, so that less is better
_SPARE = 1.5  # a grain may go this many times as far as it would at its last pace
_LEAST, _FIRST = 0.1, 0.4  # of the widest allowance, of grains at rest and in the first lists
_FIRST_LIFETIME = 50.0  # steps, while nothing is known of the motion
_TOO_LONG = 4.0  # lists that have lasted this many times as long as they should are too wide
_SAMPLES = 1024  # grains whose pace is looked at


class Skin:
    """What grains are allowed now.

    Attributes:
        radius: of a grain, on the mean [quantum]; 0 for an allowance that stays as it is.
        widest: twice what a grain is allowed at most, which the cells are made for, float64, shape (1,) [quantum].
        lifetime: steps that the lists shall last for, float64, shape (1,).
        pace: factor from how far a grain has moved to what it is allowed, and the least, float64, shape (2,) [1], [quantum].
        renewed_at: step at which the lists were made, int64, shape (1,).
        travel: how far grains have moved since, of those that are looked at, float64, shape (2 samples,) [quantum].
    """

    def __init__(self, widest: float, radius: float, device: str):
        self.radius = radius
        self.widest = wp.full(1, widest, dtype=wp.float64, device=device)
        self.lifetime = wp.full(1, _FIRST_LIFETIME, dtype=wp.float64, device=device)
        self.pace = wp.zeros(2, dtype=wp.float64, device=device)
        self.renewed_at = wp.zeros(1, dtype=wp.int64, device=device)
        self.travel = wp.zeros(2 * _SAMPLES, dtype=wp.float64, device=device)


@wp.func
def look_at_every(number: int) -> int:
    """Of how many grains one is looked at."""
    return wp.max(number / wp.static(_SAMPLES), 1)


@cache
def build_note_travel(precision: Precision) -> wp.Kernel:
    """Kernel that notes how far some grains have moved, at most what they are allowed.

    They lie all over memory, which a thread that looked at all of them would have to wait for each time.
    """
    whole4 = precision.whole4

    @kernel
    def note_travel(
        lane: int,
        shares: int,
        spans: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        origin: wp.array(dtype=whole4),
        came_from: wp.array(dtype=int),
        widest: wp.array(dtype=wp.float64),
        travel: wp.array(dtype=wp.float64),
    ):
        own = lane + wp.tid()
        every = look_at_every(count_of(spans))
        samples = count_of(spans) / every
        for k in range(part_start(samples, own, shares), part_start(samples, own + 1, shares)):
            here = place[k * every]
            was = origin[came_from[k * every]]
            moved = wp.vec3d(wp.float64(here[0] - was[0]), wp.float64(here[1] - was[1]), wp.float64(here[2] - was[2]))
            travel[k] = wp.min(wp.length(moved), wp.float64(0.5) * widest[0])

    return note_travel


@kernel
def set_pace(
    spans: wp.array(dtype=int),
    travel: wp.array(dtype=wp.float64),
    radius: wp.float64,
    widest: wp.array(dtype=wp.float64),
    steps_done: wp.array(dtype=wp.int64),
    renewed_at: wp.array(dtype=wp.int64),
    lifetime: wp.array(dtype=wp.float64),
    pace: wp.array(dtype=wp.float64),
):
    """Choose how long the lists about to be made shall last."""
    steps = steps_done[0] - renewed_at[0]
    most = wp.float64(0.5) * widest[0]
    pace[0] = wp.float64(0.0)
    if radius == wp.float64(0.0):
        pace[1] = most
    elif steps <= wp.int64(0):
        pace[1] = wp.float64(wp.static(_FIRST)) * most
    else:
        samples = count_of(spans) / look_at_every(count_of(spans))
        mean = wp.float64(0.0)
        for k in range(samples):
            mean += travel[k]
        mean = mean / (wp.float64(wp.max(samples, 1)) * wp.float64(steps))
        best = wp.sqrt(wp.float64(wp.static(0.5 * _SEARCH / _SPARE)) * radius / wp.max(mean, wp.float64(1.0e-12)))
        lifetime[0] = best
        pace[0] = wp.float64(wp.static(_SPARE)) * best / wp.float64(steps)
        pace[1] = wp.float64(wp.static(_LEAST)) * most


@cache
def build_allow(precision: Precision) -> wp.Kernel:
    """Kernel for what each grain is allowed [quantum]."""
    real, vec3, whole, whole4 = precision.real, precision.vec3, precision.whole, precision.whole4

    @kernel
    def allow(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        origin: wp.array(dtype=whole4),
        came_from: wp.array(dtype=int),
        widest: wp.array(dtype=wp.float64),
        pace: wp.array(dtype=wp.float64),
        allowed: wp.array(dtype=whole),
    ):
        for item in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = sure(item)
            here = place[i]
            was = origin[sure(came_from[i])]
            moved = vec3(real(here[0] - was[0]), real(here[1] - was[1]), real(here[2] - was[2]))
            far = real(pace[0]) * wp.length(moved)
            allowed[i] = whole(wp.clamp(far, real(pace[1]), real(wp.float64(0.5) * widest[0])))

    return allow


@cache
def build_remember(precision: Precision) -> wp.Kernel:
    """Kernel that keeps where each grain is when the lists are made, with what it is allowed as the fourth number."""
    whole, whole4 = precision.whole, precision.whole4

    @kernel
    def remember(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        allowed: wp.array(dtype=whole),
        origin: wp.array(dtype=whole4),
    ):
        for item in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = sure(item)
            here = place[i]
            origin[i] = whole4(here[0], here[1], here[2], allowed[i])

    return remember


@kernel
def begin_lifetime(steps_done: wp.array(dtype=wp.int64), renewed_at: wp.array(dtype=wp.int64)):
    """Note when the lists were made."""
    renewed_at[0] = steps_done[0]


@kernel
def end_lifetime(
    steps_done: wp.array(dtype=wp.int64),
    renewed_at: wp.array(dtype=wp.int64),
    lifetime: wp.array(dtype=wp.float64),
    grains_moved: wp.array(dtype=int),
):
    """Have lists made anew that have turned out to be too wide."""
    if wp.float64(steps_done[0] - renewed_at[0]) > wp.float64(wp.static(_TOO_LONG)) * lifetime[0]:
        grains_moved[0] = 1
