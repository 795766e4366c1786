"""Mass properties of the solid that a surface encloses."""

from dataclasses import dataclass

import numpy as np

from sampler.geometry.surface import Surface

_COARSE, _ACROSS = 8, 64  # cells across the box in which places inside are counted, the largest and the smallest ones
_SURE = 0.4  # by how much winding numbers differ from a half where all of a cell is inside or outside


@dataclass(frozen=True)
class MassProperties:
    """Of a rigid solid.

    Attributes:
        mass: [kg].
        centre: of mass, mesh frame, shape (3,) [m].
        inertia: about the centre, mesh axes, shape (3, 3) [kg m^2].
        principal: moments of inertia, ascending, shape (3,) [kg m^2].
        axes: unit vectors they belong to, as columns of a right-handed rotation, shape (3, 3).
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    principal: np.ndarray
    axes: np.ndarray


def integrate(triangles: np.ndarray, share: np.ndarray | float = 1.0) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre and inertia per unit density by the divergence theorem, exact for a closed surface.

    Args:
        triangles: outward, shape (n, 3, 3) [m].
        share: that counts of each, where several lie on one another, shape (n,) [1].

    Returns:
        Volume [m^3], centre, shape (3,) [m], inertia about the centre, shape (3, 3) [m^5].
    """
    origin = triangles.mean(axis=(0, 1))
    a, b, c = np.moveaxis(triangles - origin, 1, 0)
    volumes = share * np.einsum("ij,ij->i", a, np.cross(b - a, c - a)) / 6.0  # of tetrahedra with the origin, also of far ones
    volume = float(volumes.sum())
    total = a + b + c
    first = (volumes @ total) / 4.0
    corners = sum(np.einsum("n,ni,nj->ij", volumes, x, x) for x in (a, b, c, total)) / 20.0
    if volume == 0.0:
        return 0.0, origin, np.full((3, 3), np.nan)
    centre = first / volume
    second = corners - volume * np.outer(centre, centre)
    return volume, origin + centre, inertia_of(second)


def inertia_of(second: np.ndarray) -> np.ndarray:
    """Inertia from the second moments ``integral x x^T dV``; what one leaves of their trace would be off for needles."""
    moments = np.diag(second)
    return np.diag(np.roll(moments, 1) + np.roll(moments, 2)) - second * (1.0 - np.eye(3))


def openness(triangles: np.ndarray, share: np.ndarray | float = 1.0) -> float:
    """How little a surface closes, so that what ``integrate`` tells depends on what is taken for its middle [1].

    Over a closed surface, ``integral x n^T dA`` is the volume times unity; this is by how much it is not, over the volume.
    """
    places = triangles - triangles.mean(axis=(0, 1))
    normal = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]) * np.reshape(share, (-1, 1)) / 2.0
    moment = places.mean(axis=1).T @ normal
    volume = np.trace(moment) / 3.0
    return float(np.linalg.norm(moment - volume * np.eye(3)) / abs(volume)) if volume else np.inf


def count_inside(surface: Surface) -> tuple[float, np.ndarray, np.ndarray]:
    """What ``integrate`` tells, from places inside of a surface, closed or not; within some thousandths if it is not thin.

    Cells of its box count as a whole where the surface is farther than their corners, others are cut into eight; in the smallest
    ones a place at random decides.
    """
    corners = surface.triangles.reshape(-1, 3)
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    across, random = _COARSE, np.random.default_rng(0)
    cell = np.indices((across,) * 3).reshape(3, -1).T
    eight = np.indices((2, 2, 2)).reshape(3, -1).T
    places, side = [], []
    while len(cell):
        width = size / across
        place = low + width * (cell + (0.5 if across < _ACROSS else random.random(cell.shape)))
        number = np.abs(surface.winding(place, rough=True))
        done = np.full(len(cell), across >= _ACROSS)
        if not done.any():
            sure = np.abs(number - 0.5) > _SURE  # it changes between, where an open surface does not lie
            done[sure] = surface.closest(place[sure], 0.5 * float(np.linalg.norm(width)))[1] < 0
        inside = done & (number > 0.5)
        places.append(place[inside])
        side.append(np.broadcast_to(width, (np.count_nonzero(inside), 3)))
        cell, across = (2 * cell[~done][:, None] + eight).reshape(-1, 3), 2 * across
    place, side = np.concatenate(places), np.concatenate(side)
    if not len(place):
        return joined([])
    share = side.prod(axis=1)
    volume = float(share.sum())
    centre = share @ place / volume
    spread = np.einsum("n,ni,nj->ij", share, place - centre, place - centre)
    larger = side[:, 0] > 1.5 * size[0] / _ACROSS
    spread += np.diag(share[larger] @ side[larger] ** 2) / 12.0  # that of places at random is in them
    return volume, centre, inertia_of(spread)


def joined(bodies: list[tuple[float, np.ndarray, np.ndarray]]) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre and inertia per unit density of several solids together."""
    volume = sum(one for one, _, _ in bodies)
    if volume == 0.0:
        return 0.0, np.zeros(3), np.full((3, 3), np.nan)
    centre = sum(one * middle for one, middle, _ in bodies) / volume
    inertia = np.zeros((3, 3))
    for one, middle, own in bodies:
        away = middle - centre
        inertia += (own if one else 0.0) + one * inertia_of(np.outer(away, away))
    return volume, centre, inertia


def is_physical(volume: float, centre: np.ndarray, inertia: np.ndarray, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a solid within a box can have such a volume, centre and inertia."""
    if not (np.isfinite(volume) and volume > 0.0 and np.all(np.isfinite(centre)) and np.all(np.isfinite(inertia))):
        return False
    size = high - low
    within = np.all(centre >= low - 1e-9 * size.max()) and np.all(centre <= high + 1e-9 * size.max())
    moment = np.linalg.eigvalsh(inertia)
    return bool(
        within and moment[0] > 0.0 and moment[0] + moment[1] >= moment[2] * (1.0 - 1e-9) and volume <= 1.001 * np.prod(size)
    )


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments, ascending, shape (3,), and a right-handed rotation to their axes, shape (3, 3)."""
    moment, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    return moment, axes
