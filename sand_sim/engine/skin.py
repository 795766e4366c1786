"""How far grains may move before the contact lists are made anew, chosen while a world runs.

A wider skin makes lists that last longer but hold more pairs that do not touch. Let a search cost as much as, in ``_SEARCH``
steps, the useless pairs in a skin of one radius r do. With the fastest grain moving by t a step, a skin s costs
``_SEARCH 2 t/s + s/r``, least at ``s = sqrt(2 _SEARCH r t)``, when a list lasts for ``_SEARCH r/s`` steps. How long lists last
tells t.
"""

import warp as wp

from sand_sim.engine.kernel import kernel

_SEARCH = 5.0  # measured: benchmarks/profile.py
_NARROWEST, _FIRST = 0.1, 0.4  # of the widest skin
_TOO_LONG = 4.0  # a list that has lasted this many times as long as it should has a skin at least twice as wide as it should


class Skin:
    """The skin now.

    Attributes:
        widest: what the cells are made for [quantum].
        radius: of a grain, on the mean [quantum]; 0 for a skin that stays as it is.
        width: how far two grains may approach each other until the lists are made anew, float64, shape (1,) [quantum].
        renewed_at: step at which they were made, int64, shape (1,).
    """

    def __init__(self, widest: float, radius: float, device: str):
        self.widest, self.radius = widest, radius
        self.width = wp.full(1, _FIRST * widest if radius else widest, dtype=wp.float64, device=device)
        self.renewed_at = wp.zeros(1, dtype=wp.int64, device=device)


@kernel
def adapt_skin(
    radius: wp.float64,
    widest: wp.float64,
    steps_done: wp.array(dtype=wp.int64),
    width: wp.array(dtype=wp.float64),
    renewed_at: wp.array(dtype=wp.int64),
):
    """Choose the skin of the lists about to be made."""
    steps = steps_done[0] - renewed_at[0]
    renewed_at[0] = steps_done[0]
    if steps > wp.int64(0):
        travel = wp.float64(0.5) * width[0] / wp.float64(steps)
        best = wp.sqrt(wp.float64(2.0 * wp.static(_SEARCH)) * radius * travel)
        width[0] = wp.clamp(best, wp.float64(wp.static(_NARROWEST)) * widest, widest)


@kernel
def narrow_skin(
    radius: wp.float64,
    widest: wp.float64,
    steps_done: wp.array(dtype=wp.int64),
    width: wp.array(dtype=wp.float64),
    renewed_at: wp.array(dtype=wp.int64),
    grains_moved: wp.array(dtype=int),
):
    """Have lists made anew whose skin has turned out to be too wide."""
    steps = wp.float64(steps_done[0] - renewed_at[0])
    too_long = wp.float64(wp.static(_TOO_LONG * _SEARCH)) * radius / width[0]
    if steps > too_long and width[0] > wp.float64(wp.static(_NARROWEST)) * widest:
        grains_moved[0] = 1
