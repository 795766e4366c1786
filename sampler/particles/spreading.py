"""Spread particles evenly over a surface: throw them apart, let them push each other along it, then find gaps and fill them."""

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from sampler.launching import launch_shares
from sampler.particles.cells import empty_cells, sort_into_cells
from sampler.particles.gaps import Gaps, Verdict, within
from sampler.particles.lattice import lattice_spacing
from sampler.particles.skin import Skin
from sampler.particles.spreading_kernels import push_apart, throw_darts

_SCATTERED = 12  # random places per wanted particle
_HALVINGS = 7  # of the range in which the distance of the first placing is sought
_TURNS, _REFILL_TURNS = 60, 30
_FEW = (100, 8), (1000, 2)  # fewer particles turn so many times as often: more of them lie on rims and small pieces, or in rows
_REFILLS = 16
_SAMPLED = 40  # places per particle at which gaps are looked for, over the area; and as many over the edges
_CONFIRMED, _LOOKS = 60, 3  # and at fresh ones where hardly any is left, until none is found there, so often at most
_HARDLY, _FINE = 1.0, 0.03  # sum of faults in spacings at which that is so, and at which all is well
_STRENGTH = 0.25  # of a push, in spacings
_CELL = 2.0  # width of the cells of the grid that particles are found with, in spacings
_AROUND = 2.0  # distance from a filled gap or a removed particle within which others move, in spacings; wider disturbs as much
_SPARE, _MORE = 0.005, 0.009  # share of the particles kept back for gaps, and share that may be added above the wanted number
_PATIENCE = 6  # refills without improvement after which the best is taken

Observer = Callable[[np.ndarray], None]
Settler = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def spread_particles(
    skin: Skin,
    number: int,
    seed: int | tuple[int, ...] = 0,
    progress: Callable[[float], None] = lambda share: None,
    observe: Observer | None = None,
    settle: Settler = lambda points, normals: (points, normals),
    beyond: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Spread particles over a surface.

    Args:
        skin: where they lie.
        number: of particles.
        seed: of the random start.
        progress: called with the share of the work done, 0 to 1.
        observe: called with the particles, shape (n, 3) [m], as they relax.
        settle: moves particles a little, given their centres and normals, before they are judged.
        beyond: places beyond rims, shape (n, 3) [m], that hold particles back from these, as if the lattice went on there.

    Returns:
        Particle centres on the surface, shape (number, 3) [m], and the normals of the triangles they lie on, shape (number, 3).
    """
    random = np.random.default_rng(seed)
    state = _State(skin, number, observe, np.empty((0, 3)) if beyond is None else beyond)
    start = number - int(_SPARE * number)
    points, normals, state.apart = _throw(skin, start, state.spacing, random)
    state.place(points, normals, np.zeros(start, bool))
    turns = _TURNS * next((times for few, times in _FEW if number < few), 1)
    total = turns + _REFILLS * _REFILL_TURNS
    for turn in range(turns):
        state.push(_STRENGTH * (1.0 - 0.8 * turn / turns))
        progress((turn + 1) / total)
    state.pinned = np.zeros(start, bool)
    gaps = Gaps(skin, state.spacing)
    best, least, stuck, looks = None, np.inf, 0, 0
    for turn in range(_REFILLS + 1):
        found = settle(*state.result())  # on an edge either face may be the nearest; judge by the final choice
        gaps.look(*found)
        if turn == 0:
            gaps.add(*skin.corners(state.spacing), fixed=True)
            gaps.scatter(_SAMPLED * number, random, fixed=True)
        verdict = gaps.judge(state.pinned, random)
        if looks < _LOOKS and verdict.fault < (_FINE if looks else _HARDLY):  # a gap on a small piece may have had no place
            gaps.scatter(_CONFIRMED * number, random)
            verdict = gaps.judge(state.pinned, random, closely=True)
            looks, least = looks + 1, np.inf  # what was found before had not been looked at so closely
        stuck = 0 if verdict.fault < least else stuck + 1
        if verdict.fault < least:
            best, least = found, verdict.fault
        if verdict.fault < _FINE or turn == _REFILLS or stuck == _PATIENCE:
            break
        state.refill(*found, verdict, pin=turn > 0)
        for k in range(_REFILL_TURNS):
            state.push(_STRENGTH * (0.6 - 0.5 * k / _REFILL_TURNS))
            progress((turns + turn * _REFILL_TURNS + k) / total)
    progress(1.0)
    return best


class _State:
    """Particles on the device."""

    def __init__(self, skin: Skin, number: int, observe: Observer | None, beyond: np.ndarray):
        self.skin, self.device, self.observe, self.beyond = skin, skin.device, observe, beyond
        self.spacing = lattice_spacing(float(skin.areas.sum()), number)
        self.unit_spacing = self.spacing / skin.unit
        self.most = number + int(_MORE * number)

    def place(self, points: np.ndarray, normals: np.ndarray, held: np.ndarray) -> None:
        self.number, more = len(points), len(self.beyond)
        self.points = self.skin.shift(np.concatenate([points, self.beyond]))
        self.normals = self.skin.vectors(np.concatenate([normals, np.zeros((more, 3))]))
        self.held = wp.array(np.concatenate([held, np.ones(more, bool)]), dtype=int, device=self.device)
        self.moved, self.moved_normals = wp.empty_like(self.points), wp.empty_like(self.normals)

    def push(self, strength: float) -> None:
        h = self.unit_spacing
        cells = sort_into_cells(self.points.numpy(), self.normals.numpy(), _CELL * h, self.device)
        inputs = [cells, *self.skin.faces, self.held]
        outputs = [self.moved, self.moved_normals]
        launch_shares(push_apart, len(self.points), [*inputs, h, self.apart, strength * h], outputs, self.device)
        self.points, self.moved = self.moved, self.points
        self.normals, self.moved_normals = self.moved_normals, self.normals
        if self.observe:
            self.observe(self.positions())

    def positions(self) -> np.ndarray:
        return self.skin.back(self.points.numpy()[: self.number])

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        points, face = self.skin.closest(self.positions(), 0.1 * self.spacing, up=self.normals.numpy()[: self.number])
        return points, self.skin.normals[face]

    def refill(self, points: np.ndarray, normals: np.ndarray, verdict: Verdict, pin: bool) -> None:
        """Move particles that are too near to others, and those that are missed the least, into gaps; pinned ones stay there.

        Only what is near moves afterwards.
        """
        places, crowded = verdict.points, len(verdict.crowded)
        taken, gone = [], places
        added = max(0, min(self.most - len(points), len(places)))
        for rank, k in enumerate([*verdict.crowded, *np.argsort(verdict.missed, kind="stable")]):
            if len(taken) == len(places) or (rank >= crowded and len(taken) >= len(places) - added):
                break
            if (rank < crowded or not self.pinned[k]) and not within(gone, points[k], 2.0 * self.spacing).any():
                taken.append(int(k))
                gone = np.concatenate([gone, points[k : k + 1]])
        filled = min(len(places), len(taken) + added)
        changed = np.concatenate([places[:filled], points[taken]])
        where = np.append(taken, np.arange(len(points), len(points) + filled - len(taken))).astype(int)
        points, normals, self.pinned = (
            np.concatenate([values, values[:1].repeat(filled - len(taken), axis=0)]) for values in (points, normals, self.pinned)
        )
        points[where], normals[where], self.pinned[where] = places[:filled], verdict.normals[:filled], pin
        moving = np.zeros(len(points), bool)
        for place in changed:
            moving |= within(points, place, _AROUND * self.spacing)
        self.place(points, normals, self.pinned | ~moving)


def _throw(skin: Skin, number: int, spacing: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """So many random places as far apart as a halving search finds, first come first kept; and how far, in the kernels' units."""
    points, normals = skin.sample(_SCATTERED * number, random)
    order = random.permutation(len(points))
    points, normals = points[order], normals[order]
    where = skin.shifted(points)
    cells = empty_cells(where, spacing / skin.unit)
    # One after another, so on the CPU wherever the rest runs.
    places, up = (wp.array(x.astype(np.float32), dtype=wp.vec3, device="cpu") for x in (where, normals))
    last, before, kept = (wp.empty(n, dtype=int, device="cpu") for n in (math.prod(cells.size), len(points), len(points)))
    low, high, best = 0.2, 1.0, np.ones(len(points), bool)
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        last.fill_(-1)
        kept.zero_()
        inputs = [cells, places, up, share * spacing / skin.unit, number, last, before, kept]
        wp.launch(throw_darts, dim=1, inputs=inputs, device="cpu")
        enough = kept.numpy().sum() >= number
        low, high = (share, high) if enough else (low, share)
        best = kept.numpy() == 1 if enough else best
    chosen = np.flatnonzero(best)[:number]
    return points[chosen], normals[chosen], low * spacing / skin.unit
