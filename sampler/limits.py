"""What cannot be meant, and what the user should know of particles that lie otherwise than particles of this sampler should."""

import logging

import numpy as np

from sampler.body import Evenness
from sampler.errors import MeshError
from sampler.geometry.surface import Surface
from sampler.geometry.vectors import extremes

MOST = 2_000_000  # particles, more are not meant
_LONG = 200_000  # particles take so long that it is told before
_BURIED = 10.0  # times as large as what can be touched, at most, is all of a surface that is worth cutting
_HUGE = 1000.0  # particles of so many diagonals are not meant
_FINE = 1e-5  # nor are particles so much finer than the diagonal, which single precision would not place within their radius
_MOST = {"variation": 0.10, "farthest": 1.10, "coverage": 1.0, "skin_coverage": 1.10}  # beyond what hard meshes need
_LEAST = {"nearest": 0.30}
_MEANT, _APART = {"variation": 0.065, "farthest": 1.09, "coverage": 1.0, "skin_coverage": 1.0}, 0.35  # as nearly all keep to
_OFF = 0.01  # share by which the number of particles may differ from the wanted one
_FEWER = "check the mesh's scale (0.001 for millimetres), or take larger particles"
_LARGE = 0.5  # radius from which particles are large, in diagonals of the mesh


def check_scale(triangles: np.ndarray, radius: float, spacing: float) -> None:
    """Refuse numbers that cannot be meant before anything is cut for them, which takes long or overflows.

    Args:
        triangles: of the mesh, shape (n, 3, 3) [m].
        radius: of the particles [m].
        spacing: of the particles [m].

    Raises:
        MeshError: if they would be far too many, or far larger or far smaller than the mesh.
    """
    low, high = extremes(triangles)
    size = float(np.linalg.norm(high - low))
    if max(radius, spacing) > _HUGE * size:
        raise MeshError(
            f"particles of radius {radius:.3g} m, {spacing:.3g} m apart, are far larger than the mesh, {size:.3g} m across; "
            "check the mesh's scale"
        )
    if spacing < _FINE * size:
        raise MeshError(
            f"particles {spacing:.3g} m apart are far too fine for a mesh {size:.3g} m across; check the mesh's scale, and "
            "whether it has stray vertices or parts"
        )
    area = float(Surface.areas_of(triangles).sum())
    with np.errstate(over="ignore"):
        number = 2.0 / np.sqrt(3.0) * (np.sqrt(area) / np.float64(spacing)) ** 2
    if number > _BURIED * MOST:
        raise too_many(area, number, radius)
    if number > _LONG:
        logging.getLogger(__name__).warning(
            "about %.2g particles on %.3g m^2 take minutes; if so many are not meant, %s", number, area, _FEWER
        )


def check_thickness(thickness: float, radius: float, size: float) -> None:
    """Refuse sheets thicker [m] than a mesh is large [m], unless its particles, by their radius [m], are as well.

    Raises:
        MeshError: if they are.
    """
    if thickness > max(2.0 * radius, size):
        raise MeshError(f"sheets {thickness:.3g} m thick cannot be meant in a mesh {size:.3g} m across; check the units")


def too_many(area: float, number: float, radius: float) -> MeshError:
    """What to say of an area [m^2] that would need too many particles of a radius [m]."""
    return MeshError(f"a surface of {area:.3g} m^2 would need {number:.2g} particles of radius {radius:.3g} m; {_FEWER}")


def unevenness(evenness: Evenness) -> float:
    """By how much particles are beyond what is meant, all of it together; none for those as even as nearly all."""
    beyond = [getattr(evenness, name) / limit - 1.0 for name, limit in _MEANT.items()]
    beyond.append(1.0 - evenness.nearest / _APART)
    return sum(max(0.0, share) for share in beyond)


def broken_limits(evenness: Evenness, number: int, wanted: int, radius: float, size: float) -> list[str]:
    """Warnings about particles that are uneven, too few or too many, or as large as the mesh.

    Args:
        evenness: of the particles.
        number: of particles.
        wanted: number of particles.
        radius: of the particles [m].
        size: diagonal of the mesh [m].
    """
    found = []
    if radius > _LARGE * size:
        found.append(f"particles of radius {radius:.3g} m are about as large as the mesh, {size:.3g} m across; check its scale")
    if np.abs(number - wanted) > max(1.0, _OFF * wanted):
        found.append(f"there are {number} particles where {wanted} were wanted")
    single = number == 1  # has no neighbours
    most, least = ({"coverage": _MOST["coverage"]}, {}) if single else (_MOST, _LEAST)
    broken = [(name, "at most", limit) for name, limit in most.items() if getattr(evenness, name) > limit]
    broken += [(name, "at least", limit) for name, limit in least.items() if getattr(evenness, name) < limit]
    if broken:
        told = [f"{name.replace('_', ' ')} {getattr(evenness, name):.2f} ({how} {limit:g})" for name, how, limit in broken]
        found.append(f"the particles lie less evenly than they should, in spacings: {', '.join(told)}")
    return found
