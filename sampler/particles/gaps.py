"""How particles cover a surface: where gaps are, which particles are too near to others, and which would be missed the least."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from sampler.geometry.vectors import lengths
from sampler.launching import launch_shares
from sampler.particles.cells import add_lists, cell_numbers, cells_around, empty_cells, sort_into_cells
from sampler.particles.climbing import climb
from sampler.particles.gap_kernels import Nearest, find_gaps, find_neighbours
from sampler.particles.skin import Skin

_WATCHED = 0.15  # places that were found so near to being a gap are looked at the next time, too, in spacings
_PORTION = 500_000  # random places that are thrown at a time
_STEPS = 8, 4  # from the worst places known to the worst ones near by, and trials for each
CLOSE_STEPS = 16, 8  # the same where the worst must not be missed: before particles are accepted, and when they are measured
_GAP = 0.785, 0.965  # a place farther from all particles, or from those of its own skin, is a gap; in spacings
_GRAVE, _WEIGHT = (0.785, 0.99), 4.0  # and from these ways on a grave one; that, and loneliness, counts so much more
_GAPS_APART = 1.2  # gaps nearer than this to a deeper one wait, in spacings
_ROOM, _NEAR = 0.55, 0.4  # a gap is filled so far from particles of other skins, or as far as can be so near to it; in spacings
_BEHIND = 0.1  # so near a particle of another skin is right behind a gap, and any place beside it is better
_LEAST, _TOO_NEAR = 0.40, 0.37  # particles nearer than this to one another are a fault, and a grave one, in spacings
_LONELY, _BESIDE = 1.09, (0.25, 1.06)  # those farther than this from all others get a neighbour, how far beside them; in spacings
_MOVED, _TURNED = 1e-3, 0.999  # what has moved less, in spacings, and turned less, by the cosine, lies where it was
_CELL = 0.6  # width of the cells of the grid that particles are found with, in spacings
_NEAR_CELL = 0.5  # and of those with which places near particles that have moved are found
FAR = 2.0  # how far particles are looked for, in spacings; farther ones are as bad


@dataclass(frozen=True)
class Places:
    """Places on a surface and the particles nearest to them.

    Attributes:
        points: in the frame and unit of the kernels, shape (n, 3) float32.
        normals: of the surface there, shape (n, 3) float32.
        closest: particle nearest to each, how far it is and how far the next one; shape (n,) of ``Nearest``, in spacings.
        own: the same along the surface.
        fixed: places looked at every time, shape (n,).
        cell: number of the one they lie in, of a grid over the surface, shape (n,).
    """

    points: np.ndarray
    normals: np.ndarray
    closest: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    cell: np.ndarray

    def at(self, which: np.ndarray) -> "Places":
        """Some of them, true in a mask."""
        chosen = np.flatnonzero(which)
        return Places(*(values.take(chosen, axis=0) for values in vars(self).values()))

    def joined(self, *others: "Places") -> "Places":
        """These and others."""
        fields = zip(*(vars(places).values() for places in (self, *others)), strict=True)
        return Places(*map(np.concatenate, fields))

    @property
    def excess(self) -> np.ndarray:
        """By how much they lie in gaps, in spacings."""
        return _excess(self.closest["way"], self.own["way"])


@dataclass(frozen=True)
class Verdict:
    """What is wrong with the particles.

    Attributes:
        points, normals: places to fill, the worst first and none near a worse one, shape (n, 3) [m].
        crowded: particles too near to others.
        missed: how far in a gap the worst place would be without each particle, in spacings.
        fault: sum of all faults, in spacings.
    """

    points: np.ndarray
    normals: np.ndarray
    crowded: np.ndarray
    missed: np.ndarray
    fault: float


class Gaps:
    """What is known of the gaps between particles that move.

    Args:
        skin: where they lie.
        spacing: of the particles [m].
    """

    def __init__(self, skin: Skin, spacing: float):
        self.skin, self.spacing, self.device = skin, spacing, skin.device
        self._unit = spacing / skin.unit  # a spacing, in the kernels' unit, in which all is told here
        self._grid = empty_cells(skin.mesh.points.numpy(), _NEAR_CELL * self._unit)
        self.points = self.normals = np.empty((0, 3), np.float32)
        nothing = np.empty((2, 0), Nearest.numpy_dtype())
        self.places = Places(self.points, self.normals, *nothing, np.empty(0, bool), np.empty(0, np.int64))

    def look(self, points: np.ndarray, normals: np.ndarray) -> None:
        """Take note of particles, shape (n, 3) [m], and their normals; only near those that have moved is measured anew."""
        points, normals = self.skin.shifted(points), normals.astype(np.float32)
        before = slice(len(self.points))
        moved = np.ones(len(points), bool)
        moved[before] = lengths(points[before] - self.points) > _MOVED * self._unit
        moved[before] |= np.einsum("ij,ij->i", normals[before], self.normals) < _TURNED
        changed = np.concatenate([points[moved], self.points[moved[before]]])
        self.points, self.normals = (
            np.where(moved[:, None], new, np.concatenate([old, new[len(old) :]]))
            for new, old in ((points, self.points), (normals, self.normals))
        )
        self.cells = sort_into_cells(self.points, self.normals, _CELL * self._unit, self.device)
        add_lists(self.cells, self._unit, self.device)
        places = self.places
        near = cells_around(self._grid, changed, self._unit)
        stale = np.flatnonzero(near[places.cell] | (places.own["way"] > 1.0))  # farther ones may be anywhere
        places.closest[stale], places.own[stale] = self.measure(places.points[stale], places.normals[stale])

    def add(self, points: np.ndarray, normals: np.ndarray, fixed: bool = False) -> None:
        """Look at more places, shape (n, 3) [m], with the normals there; for good if they are fixed, else those in doubt."""
        self.places = self.places.joined(self._looked_at(self.skin.shifted(points), normals.astype(np.float32), fixed))

    def scatter(self, number: int, random: np.random.Generator, fixed: bool = False) -> None:
        """Look at so many random places over the area, and as many over longest edges; in portions, as memory is scarce."""
        portions = [min(_PORTION, number - begin) for begin in range(0, number, _PORTION)]
        scattered = (self.skin.scatter(portion, random) for portion in portions)
        new = [self._looked_at(self.skin.shifted(points), normals.astype(np.float32), fixed) for points, normals in scattered]
        self.places = self.places.joined(*new)

    def _looked_at(self, points: np.ndarray, normals: np.ndarray, fixed: bool) -> Places:
        found = self.measure(points, normals)
        new = Places(points, normals, *found, np.full(len(points), fixed), cell_numbers(self._grid, points))
        return new if fixed else new.at(new.excess > -_WATCHED)

    def judge(self, pinned: np.ndarray, random: np.random.Generator, closely: bool = False) -> Verdict:
        """Say what is wrong, as closely as it is measured in the end if so asked.

        Of particles too near to others those that are not pinned, shape (n,), are to blame.
        """
        nearest = self.neighbour_distances()
        self._seek(random, CLOSE_STEPS if closely else _STEPS)
        places, free, excess = self.places, self.places.closest["way"], self.places.excess
        for i, beside in self._places_beside(np.flatnonzero(nearest > _LONELY)):
            k = beside[free[beside].argmax()]
            excess[k] = max(excess[k], _WEIGHT * (nearest[i] - _LONELY))
        crowded = np.flatnonzero(nearest < _LEAST)
        crowded = crowded[np.lexsort((nearest[crowded], pinned[crowded]))]
        gaps = self._worst(excess, len(crowded))
        grave = np.maximum(_excess(free[gaps], places.own["way"][gaps], _GRAVE), 0.0).sum()
        grave += np.maximum(_TOO_NEAR - nearest[crowded], 0.0).sum()
        fault = float(_WEIGHT * grave + np.maximum(excess[gaps], 0.0).sum() + (_LEAST - nearest[crowded]).sum())
        fill = self._roomiest(gaps)
        verdict = Verdict(self.skin.back(places.points[fill]), places.normals[fill].astype(float), crowded, self._missed(), fault)
        self.places = places.at(places.fixed | (excess > -_WATCHED))
        return verdict

    def neighbour_distances(self, most: float = FAR) -> np.ndarray:
        """Distance of particles from the nearest other one, at most ``most``; in spacings."""
        nearest = wp.empty(len(self.points), dtype=float, device=self.device)
        launch_shares(find_neighbours, len(self.points), [self.cells, self._unit, most], [nearest], self.device)
        return nearest.numpy()

    def measure(self, points: np.ndarray, normals: np.ndarray, most: float = FAR) -> tuple[np.ndarray, np.ndarray]:
        """Particles nearest to places, in the kernels' unit, and along the surface, as ``find_gaps``."""
        found = tuple(wp.empty(len(points), dtype=Nearest, device=self.device) for _ in range(2))
        places = (wp.array(x, dtype=wp.vec3, device=self.device) for x in (points, normals))
        launch_shares(find_gaps, len(points), [self.cells, *places, self._unit, most], list(found), self.device)
        return tuple(values.numpy() for values in found)

    def climb(
        self, along: bool, steps: tuple[int, int], random: np.random.Generator, most: float = FAR
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Worst places near the worst ones known, in the kernels' unit, the normals there, and how far they are, as ``climb``."""
        found = self.places.own if along else self.places.closest
        known = self.places.points, self.places.normals, found["which"], found["way"]
        return climb(self.skin, self.cells, known, along, steps, self._unit, most, random)

    def _seek(self, random: np.random.Generator, steps: tuple[int, int]) -> None:
        """Look at the worst places near the worst ones known, too."""
        worst = [self.climb(along, steps, random)[:2] for along in (False, True)]
        self.places = self.places.joined(self._looked_at(*map(np.concatenate, zip(*worst, strict=True)), fixed=False))

    def _places_beside(self, which: np.ndarray):
        """Yield each of some particles and the numbers of the places beside it, if there are any."""
        points = self.places.points
        axis = int(np.ptp(self.points, axis=0).argmax())
        order = np.argsort(points[:, axis], kind="stable") if len(which) else which
        here, reach = self.points[which, axis], _BESIDE[1] * self._unit
        first, last = (np.searchsorted(points[order, axis], x) for x in (here - reach, here + reach))
        for i, begin, end in zip(which, first, last, strict=True):
            near = np.sort(order[begin:end])
            away = np.linalg.norm(points[near] - self.points[i], axis=1) / self._unit
            beside = near[(away > _BESIDE[0]) & (away < _BESIDE[1])]
            if len(beside):
                yield i, beside

    def _missed(self) -> np.ndarray:
        """How far in a gap the worst place would be without each particle."""
        left = []
        for nearest in (self.places.closest, self.places.own):
            far, found = np.zeros(len(self.points), np.float32), nearest["which"] >= 0
            np.maximum.at(far, nearest["which"][found], nearest["next"][found])
            left.append(far)
        return _excess(*left)

    def _worst(self, excess: np.ndarray, crowded: int) -> np.ndarray:
        """Places that lie in gaps, the worst first and none near a worse one, and room for half of the crowded particles."""
        chosen: list[int] = []
        enough = min(len(excess), np.count_nonzero(excess > 0.0) + (len(self.points) if crowded else 1))
        left = np.argpartition(-excess, enough - 1)[:enough]
        left = left[np.argsort(-excess[left], kind="stable")]
        while len(left) and len(chosen) < (max(4, len(self.points) // 20) if excess[left[0]] > 0.0 else crowded / 2):
            chosen.append(int(left[0]))
            left = left[~within(self.places.points[left], self.places.points[left[0]], _GAPS_APART * self._unit)]
        return np.array(chosen, int)

    def _roomiest(self, gaps: np.ndarray) -> np.ndarray:
        """Gaps, or in place of those with a particle of another skin behind them, places beside them that are farther from it."""
        points, normals, free = self.places.points, self.places.normals, self.places.closest["way"]
        room, chosen, narrow = np.minimum(free, self.places.own["way"]), gaps.copy(), np.flatnonzero(free[gaps] < _ROOM)
        near = cells_around(self._grid, points[gaps[narrow]], _NEAR * self._unit)
        known = np.flatnonzero(near[self.places.cell])
        around = points[known]
        for n in narrow:
            near = known[within(around, points[gaps[n]], _NEAR * self._unit)]
            near = near[normals[near] @ normals[gaps[n]] > 0.5]
            best = near[room[near].argmax()] if len(near) else gaps[n]
            if room[best] > _LEAST or free[gaps[n]] < _BEHIND:
                chosen[n] = best
        return chosen


def _excess(free: np.ndarray, own: np.ndarray, gap: tuple[float, float] = _GAP) -> np.ndarray:
    return np.maximum(free - gap[0], own - gap[1])


def within(points: np.ndarray, place: np.ndarray, reach: float) -> np.ndarray:
    """Whether points, shape (n, 3), are within reach of a place; shape (n,)."""
    return lengths(points - place) <= reach
