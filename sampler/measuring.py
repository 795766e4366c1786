"""How evenly particles lie and how far from them places of the surface are, in the end: without limit, up to the worst places."""

from functools import partial

import numpy as np

from sampler.body import Evenness
from sampler.climbing import climb
from sampler.gaps import FAR, Gaps
from sampler.lattice import lattice_spacing
from sampler.skin import Skin

_MEASURED = 50  # places per particle, over the area, and as many over the edges
_ENOUGH = 0.63  # particles nearer than this need no next one, in spacings
_WIDER = 4.0  # where none is found, they are looked for so much farther
_SURVEYED = 5000  # of the places that have none near, so many are asked where it is
_STEPS = 16  # from the worst of them to the worst ones near by


def measure_evenness(skin: Skin, points: np.ndarray, normals: np.ndarray) -> Evenness:
    """Measure particles, shape (n, 3) [m], with their normals, on the surface they lie on.

    Random places miss the worst ones by some percent, so from the worst of them those near by are sought.
    """
    gaps = Gaps(skin, lattice_spacing(float(skin.areas.sum()), len(points)))
    gaps.look(points, normals)
    random = np.random.default_rng(1)
    groups = skin.scatter(_MEASURED * len(points), random), skin.corners(gaps.spacing)
    places = tuple(map(np.concatenate, zip(*groups, strict=True)))
    worst = [_worst_place(gaps, *places, found, along, random) for along, found in enumerate(gaps.measure(*places, _ENOUGH))]
    nearest = _neighbours(gaps)
    variation = nearest.std() / nearest.mean() if len(points) > 1 else 0.0
    return Evenness(*map(float, (variation, nearest.min(), nearest.max(), worst[0], max(worst))))


def _worst_place(
    gaps: Gaps, points: np.ndarray, normals: np.ndarray, found: np.ndarray, along: int, random: np.random.Generator
) -> float:
    """Largest distance of a place from the nearest particle, straight or along the surface, in spacings; infinite if none is.

    Args:
        gaps: with the particles.
        points: places to begin with, shape (n, 3) [m].
        normals: of the surface there, shape (n, 3).
        found: the nearest particles, shape (n,) of ``Nearest``.
        along: 1 for the distance along the surface.
        random: where chance comes from.
    """
    far = np.flatnonzero(found["way"] >= FAR)
    far = far[:: 1 + len(far) // _SURVEYED]
    found[far] = _measure(gaps, points[far], normals[far], along)
    beside = partial(gaps.beside, random=random)
    way = climb(points, normals, found, beside, lambda *at: _measure(gaps, *at, along)["way"], _STEPS, gaps.spacing)[2]
    return way.max()


def _measure(gaps: Gaps, points: np.ndarray, normals: np.ndarray, along: int) -> np.ndarray:
    """Nearest particles, straight or along the surface, however far they are."""
    found, most = gaps.measure(points, normals)[along], FAR
    far = np.flatnonzero(found["way"] >= most)
    while len(far) and most * gaps.spacing < 2.0 * gaps.skin.unit:
        most *= _WIDER
        gaps.widen(most)
        found[far] = gaps.measure(points[far], normals[far], 1.0, most)[along]
        far = far[found["way"][far] >= most]
    found["way"][far] = np.inf
    if most > FAR:
        gaps.widen(FAR)
    return found


def _neighbours(gaps: Gaps) -> np.ndarray:
    """Distance of particles from the nearest other one, in spacings; infinite for a single one."""
    nearest, most = gaps.neighbour_distances(), FAR
    if len(nearest) == 1:
        return np.full(1, np.inf)
    while nearest.max() >= most:
        most *= _WIDER
        gaps.widen(most)
        nearest = gaps.neighbour_distances(most)
    gaps.widen(FAR)
    return nearest
