"""How evenly particles lie and how far from them places of the surface are, in the end: without limit, up to the worst places."""

import numpy as np

from sampler.body import Evenness
from sampler.particles.gaps import CLOSE_STEPS, FAR, Gaps
from sampler.particles.lattice import lattice_spacing
from sampler.particles.skin import Skin

_MEASURED = 50  # places per particle, over the area, and as many over the edges
_MANY = 10_000  # of so many particles, only places that may be among the worst are kept in mind
_SURVEYED = 5000  # of the places that have none near, so many are asked where it is


def measure_evenness(skin: Skin, points: np.ndarray, normals: np.ndarray) -> Evenness:
    """Measure particles, shape (n, 3) [m], with their normals, on the surface they lie on.

    Random places miss the worst ones by some percent, so from the worst of them those near by are sought.
    """
    gaps = Gaps(skin, lattice_spacing(float(skin.areas.sum()), len(points)))
    gaps.look(points, normals)
    random, most = np.random.default_rng(1), 2.0 * skin.unit / gaps.spacing
    gaps.scatter(_MEASURED * len(points), random, fixed=len(points) < _MANY)
    gaps.add(*skin.corners(gaps.spacing), fixed=True)
    worst = [_worst_place(gaps, along, most, random) for along in (False, True)]
    nearest = gaps.neighbour_distances(most) if len(points) > 1 else np.full(1, np.inf)
    variation = nearest.std() / nearest.mean() if len(points) > 1 and nearest.any() else 0.0
    return Evenness(*map(float, (variation, nearest.min(), nearest.max(), worst[0], max(worst))))


def _worst_place(gaps: Gaps, along: bool, most: float, random: np.random.Generator) -> float:
    """Largest distance of a place from the nearest particle, straight or along the surface, in spacings; infinite if none is."""
    found = gaps.places.own if along else gaps.places.closest
    far = np.flatnonzero(found["way"] >= FAR)
    far = far[:: 1 + len(far) // _SURVEYED]
    found[far] = gaps.measure(gaps.places.points[far], gaps.places.normals[far], most)[along]
    worst = gaps.climb(along, CLOSE_STEPS, random, most)[2].max()
    return worst if worst < most else np.inf
