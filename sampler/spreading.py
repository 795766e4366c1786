"""Spread particles evenly over a surface: throw them apart, let them push each other along it, then find gaps and fill them."""

from collections.abc import Callable

import numpy as np
import warp as wp

from sampler.body import Evenness
from sampler.skin import Skin
from sampler.spreading_kernels import find_gaps, find_nearest, push_apart, throw_darts
from sampler.surface import launch_shares

_SCATTERED = 12  # random places per wanted particle
_HALVINGS = 7  # of the range in which the distance of the first placing is sought
_TURNS, _REFILL_TURNS = 120, 12
_REFILLS = 16
_SAMPLED = 40  # places per particle at which gaps are looked for, over the area; and as many over the edges
_CONFIRMED = 80  # and where hardly any is left, once more
_HARDLY, _FINE = 0.5, 0.02  # sum of faults in spacings at which that is so, and at which all is well
_DOUBT = 0.08  # places so near to being a gap are looked at more closely, in spacings
_WATCHED = 0.15  # and other places that were found so near to being one, the next time, too
_CLOSER = (0.10, 0.10, 0.05, 0.05)  # how far beside them, in spacings
_STRENGTH = 0.25  # of a push, in spacings
_GAP, _SKIN_GAP = 0.78, 0.95  # a place farther from all particles, or from those of its own skin, is a gap; in spacings
_GAPS_APART = 1.2  # gaps nearer than this to a deeper one wait, in spacings
_ROOM, _NEAR = 0.55, 0.4  # a gap is filled so far from particles of other skins, or as far as can be so near to it; in spacings
_LEAST = 0.40  # particles nearer than this to one another are a fault, in spacings
_LONELY, _BESIDE = 1.09, (0.6, 1.06)  # those farther than this from all others get a neighbour, how far beside them; in spacings
_AROUND = 4.0  # distance from a filled gap or a removed particle within which others move, in spacings
_MEASURED = 100  # places per particle at which the result is measured
_SPARE, _MORE = 0.005, 0.009  # share of the particles kept back for gaps, and share that may be added above the wanted number
_PATIENCE = 6  # refills without improvement after which the best is taken

Observer = Callable[[np.ndarray], None]
Settler = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
Places = tuple[np.ndarray, np.ndarray]  # on the surface, shape (n, 3) [m], and the normals there, shape (n, 3)


def particle_count(area: float, spacing: float) -> int:
    """Particles that cover an area [m^2] as a triangular lattice of the given spacing [m]: ``A / (sqrt(3)/2 h^2)``."""
    return max(1, round(2.0 * area / (np.sqrt(3.0) * spacing**2)))


def lattice_spacing(area: float, number: int) -> float:
    """Spacing [m] of a triangular lattice of so many particles on an area [m^2]: ``h = sqrt(2 A / (sqrt(3) N))``."""
    return float(np.sqrt(2.0 * area / (np.sqrt(3.0) * number)))


def spread_particles(
    skin: Skin,
    number: int,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
    observe: Observer | None = None,
    settle: Settler = lambda points, normals: (points, normals),
) -> tuple[np.ndarray, np.ndarray]:
    """Spread particles over a surface.

    Args:
        skin: where they lie.
        number: of particles.
        seed: of the random start.
        progress: called with the share of the work done, 0 to 1.
        observe: called with the particles, shape (n, 3) [m], as they relax.
        settle: moves particles a little, given their centres and normals, before they are judged.

    Returns:
        Particle centres on the surface, shape (number, 3) [m], and the normals of the triangles they lie on, shape (number, 3).
    """
    random = np.random.default_rng(seed)
    state = _State(skin, number, observe)
    start = number - int(_SPARE * number)
    points, normals, state.apart = _throw(skin, start, state.spacing, random)
    state.place(points, normals, np.zeros(start, bool))
    total = _TURNS + _REFILLS * _REFILL_TURNS
    for turn in range(_TURNS):
        state.push(_STRENGTH * (1.0 - 0.8 * turn / _TURNS))
        progress((turn + 1) / total)
    state.pinned = np.zeros(start, bool)
    places = skin.places(_SAMPLED * number, random)
    state.fixed = len(places[0])
    best, least, stuck, sure = None, np.inf, 0, False
    for turn in range(_REFILLS + 1):
        found = settle(*state.result())  # on an edge either face may be the nearest; judge by the final choice
        state.points, state.normals = skin.shift(found[0]), state.vectors(found[1])
        places, gaps, crowded, fault = state.faults(places, random)
        if fault < _HARDLY and not sure:  # a gap on a small piece may have had no place
            places, gaps, crowded, fault = state.faults(_joined(places, skin.places(_CONFIRMED * number, random)), random)
            sure = True
        stuck = 0 if fault < least else stuck + 1
        if fault < least:
            best, least = found, fault
        if fault < _FINE or turn == _REFILLS or stuck == _PATIENCE:
            break
        state.refill(*gaps, crowded, pin=turn > 0)
        for k in range(_REFILL_TURNS):
            state.push(_STRENGTH * (0.6 - 0.5 * k / _REFILL_TURNS))
            progress((_TURNS + turn * _REFILL_TURNS + k) / total)
    progress(1.0)
    return best


def measure_evenness(skin: Skin, points: np.ndarray, normals: np.ndarray) -> Evenness:
    """Measure particles, shape (n, 3) [m], with their normals, on the surface they lie on."""
    state = _State(skin, len(points), None)
    state.place(points, normals, np.zeros(len(points), bool))
    free, own = state.distances(*skin.places(_MEASURED * len(points), np.random.default_rng(1)))
    nearest = state.nearest()
    variation = nearest.std() / nearest.mean()
    return Evenness(*map(float, (variation, nearest.min(), nearest.max(), free.max(), own.max())))


class _State:
    """Particles on the device."""

    def __init__(self, skin: Skin, number: int, observe: Observer | None):
        self.skin, self.device, self.observe = skin, skin.device, observe
        self.spacing = lattice_spacing(float(skin.areas.sum()), number)
        self.unit_spacing = self.spacing / skin.unit
        self.grid = wp.HashGrid(128, 128, 128, device=self.device)
        self.corners = skin.shift(skin.triangles.reshape(-1, 3))
        self.face_normals = self.vectors(skin.normals)
        self.most = number + int(_MORE * number)

    def vectors(self, values: np.ndarray) -> wp.array:
        return wp.array(np.asarray(values, np.float32), dtype=wp.vec3, device=self.device)

    def place(self, points: np.ndarray, normals: np.ndarray, held: np.ndarray) -> None:
        self.points, self.normals = self.skin.shift(points), self.vectors(normals)
        self.held = wp.array(held.astype(np.int32), dtype=int, device=self.device)
        self.moved, self.moved_normals = wp.empty_like(self.points), wp.empty_like(self.normals)
        self.without = tuple(wp.zeros(len(points), dtype=float, device=self.device) for _ in range(2))

    def push(self, strength: float) -> None:
        h = self.unit_spacing
        self.grid.build(self.points, 2.0 * h)
        inputs = [self.grid.id, self.skin.mesh.id, self.points, self.normals, self.corners, self.face_normals, self.held]
        outputs = [self.moved, self.moved_normals]
        launch_shares(push_apart, len(self.points), [*inputs, h, self.apart, strength * h], outputs, self.device)
        self.points, self.moved = self.moved, self.points
        self.normals, self.moved_normals = self.moved_normals, self.normals
        if self.observe:
            self.observe(self.positions())

    def positions(self) -> np.ndarray:
        return self.points.numpy() * self.skin.unit + self.skin.centre

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        points, face = self.skin.closest(self.positions(), up=self.normals.numpy())
        return points, self.skin.normals[face]

    def faults(self, places: Places, random: np.random.Generator) -> tuple[Places, Places, np.ndarray, float]:
        """What is wrong, judged at places with their normals.

        Returns:
            Places to be judged at the next time, the fixed ones and those in doubt; places to fill, the worst first and none
            near a worse one; particles too near to others; the sum of all faults.
        """
        nearest, found = self.nearest(), self.distances(*places)
        for _ in range(2):
            closer = self._beside(places, np.flatnonzero(_excess(*found) > -_DOUBT)[: len(self.points)], random)
            places, found = _joined(places, closer), _joined(found, self.distances(*closer))
        free, excess = found[0], _excess(*found)
        for i in np.flatnonzero(nearest > _LONELY):
            away = np.linalg.norm(places[0] - self.positions()[i], axis=1) / self.spacing
            beside = np.flatnonzero((away > _BESIDE[0]) & (away < _BESIDE[1]))
            if len(beside):
                k = beside[free[beside].argmax()]
                excess[k] = max(excess[k], 4.0 * (nearest[i] - _LONELY))
        crowded = np.flatnonzero(nearest < _LEAST)
        crowded = crowded[np.lexsort((nearest[crowded], self.pinned[crowded]))]
        chosen: list[int] = []
        enough = min(len(excess), np.count_nonzero(excess > 0.0) + (len(self.points) if len(crowded) else 1))
        left = np.argpartition(-excess, enough - 1)[:enough]
        left = left[np.argsort(-excess[left], kind="stable")]
        while len(left) and len(chosen) < (max(4, len(self.points) // 20) if excess[left[0]] > 0.0 else len(crowded) / 2):
            chosen.append(int(left[0]))
            left = left[np.linalg.norm(places[0][left] - places[0][left[0]], axis=1) > _GAPS_APART * self.spacing]
        gaps = np.array(chosen, int)
        open_ = np.maximum(free[gaps] - _GAP, 0.0).sum()
        fault = float(4.0 * open_ + np.maximum(excess[gaps], 0.0).sum() + (_LEAST - nearest[crowded]).sum())
        fill = self._roomiest(places, gaps, *found)
        watched = (np.arange(len(excess)) < self.fixed) | (excess > -_WATCHED)
        return _at(places, watched), _at(places, fill), crowded, fault

    def _roomiest(self, places: Places, gaps: np.ndarray, free: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Gaps, or in place of those with a particle of another skin behind them, places beside them that are farther from it."""
        roomy = np.flatnonzero((free > _ROOM) & (own > _ROOM))
        chosen = gaps.copy()
        for n, k in enumerate(gaps):
            if free[k] < _ROOM:
                near = np.linalg.norm(places[0][roomy] - places[0][k], axis=1) < _NEAR * self.spacing
                near = roomy[near & (places[1][roomy] @ places[1][k] > 0.5)]
                if len(near):
                    chosen[n] = near[free[near].argmax()]
        return chosen

    def _beside(self, places: Places, doubtful: np.ndarray, random: np.random.Generator) -> Places:
        """Places a little aside of doubtful ones."""
        points, normals = (np.tile(values[doubtful], (len(_CLOSER), 1)) for values in places)
        aside = np.repeat(_CLOSER, len(doubtful))[:, None] * self.spacing * random.standard_normal(points.shape)
        points, face = self.skin.closest(points + aside, up=normals)
        return points, self.skin.normals[face]

    def distances(self, places: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance of places from the nearest particle and from the nearest on their own skin, at most 2; in spacings.

        Notes how far they would be without it.
        """
        reach = 2.0 * self.unit_spacing
        self.grid.build(self.points, 0.5 * reach)
        found = tuple(wp.empty(len(places), dtype=float, device=self.device) for _ in range(2))
        inputs = [self.grid.id, self.points, self.normals, self.skin.shift(places), self.vectors(normals), reach]
        launch_shares(find_gaps, len(places), inputs, [*found, *self.without], self.device)
        return tuple(values.numpy() / self.unit_spacing for values in found)

    def nearest(self) -> np.ndarray:
        """Distance of particles from the nearest other one, at most 2; in spacings."""
        reach = 2.0 * self.unit_spacing
        self.grid.build(self.points, 0.5 * reach)
        nearest = wp.empty(len(self.points), dtype=float, device=self.device)
        launch_shares(find_nearest, len(self.points), [self.grid.id, self.points, reach], [nearest], self.device)
        return nearest.numpy() / self.unit_spacing

    def refill(self, places: np.ndarray, normals: np.ndarray, crowded: np.ndarray, pin: bool) -> None:
        """Move particles that are too near to others, and those that are missed the least, into gaps; pinned ones stay there.

        Only what is near moves afterwards.
        """
        points, up = self.positions(), self.normals.numpy()
        taken: list[int] = []
        added = max(0, min(self.most - len(points), len(places)))
        missed = _excess(*(far.numpy() / self.unit_spacing for far in self.without))
        for rank, k in enumerate([*crowded, *np.argsort(missed, kind="stable")]):
            if len(taken) == len(places) or (rank >= len(crowded) and len(taken) >= len(places) - added):
                break
            way = np.linalg.norm(np.concatenate([places, points[taken]]) - points[k], axis=1).min()
            if (rank < len(crowded) or not self.pinned[k]) and way > 2.0 * self.spacing:
                taken.append(int(k))
        added = min(added, len(places) - len(taken))
        places, normals = places[: len(taken) + added], normals[: len(taken) + added]
        changed = np.concatenate([places, points[taken]])
        keep = np.ones(len(points), bool)
        keep[taken] = False
        points, up = np.concatenate([points[keep], places]), np.concatenate([up[keep], normals])
        self.pinned = np.concatenate([self.pinned[keep], np.full(len(places), pin)])
        moving = np.zeros(len(points), bool)
        for place in changed:
            moving |= np.linalg.norm(points - place, axis=1) < _AROUND * self.spacing
        self.place(points, up, self.pinned | ~moving)


def _at(places: Places, which: np.ndarray) -> Places:
    return places[0][which], places[1][which]


def _joined(*pairs: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.concatenate(values) for values in zip(*pairs, strict=True))


def _excess(free: np.ndarray, own: np.ndarray) -> np.ndarray:
    """By how much places lie in gaps, in spacings."""
    return np.maximum(free - _GAP, own - _SKIN_GAP)


def _throw(skin: Skin, number: int, spacing: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """So many random places as far apart as a halving search finds, first come first kept; and how far, in the kernels' units."""
    points, normals = skin.sample(_SCATTERED * number, random)
    order = random.permutation(len(points))
    points, normals = points[order], normals[order]
    where = skin.shift(points).to("cpu")  # one after another, so on the CPU wherever the rest runs
    up = wp.array(normals.astype(np.float32), dtype=wp.vec3, device="cpu")
    grid = wp.HashGrid(128, 128, 128, device="cpu")
    low, high, best = 0.2, 1.0, np.ones(len(points), bool)
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        apart = share * spacing / skin.unit
        grid.build(where, apart)
        kept = wp.zeros(len(points), dtype=int, device="cpu")
        wp.launch(throw_darts, dim=1, inputs=[grid.id, where, up, apart, len(points), kept], device="cpu")
        enough = kept.numpy().sum() >= number
        low, high = (share, high) if enough else (low, share)
        best = kept.numpy() == 1 if enough else best
    chosen = np.flatnonzero(best)[:number]
    return points[chosen], normals[chosen], low * spacing / skin.unit
