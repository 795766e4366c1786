"""Shapes of grains and bodies: rigid lists of spheres with the mass properties of their union."""

import csv
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from sand_sim.scene.npz import read_npz
from sand_sim.scene.types import SceneError

SPHERE, TETRAHEDRON = "sphere", "tetrahedron"
_EDGE = 1.2  # of the tetrahedron over the radius of its spheres: concave enough to interlock, with no hole for a fifth sphere
_LINES = 1200  # on each edge of the cross section that is integrated over


@dataclass(frozen=True)
class Shape:
    """Spheres in their principal frame: origin in the centre of mass, axes along the principal axes.

    Attributes:
        centres: shape (k, 3) [m].
        radii: shape (k,) [m].
        volume: of the union [m^3].
        gyration: principal moments of inertia over the mass, shape (3,) [m^2].
        axes: principal axes in the frame in which the spheres were given, as columns, shape (3, 3).
        middle: centre of mass in that frame, shape (3,) [m].
    """

    centres: np.ndarray
    radii: np.ndarray
    volume: float
    gyration: np.ndarray
    axes: np.ndarray
    middle: np.ndarray

    @cached_property
    def equal_radius(self) -> float:
        """Radius of the sphere of the same volume [m]."""
        return float((3.0 * self.volume / (4.0 * np.pi)) ** (1.0 / 3.0))

    @cached_property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that holds all [m]."""
        return float(np.max(np.linalg.norm(self.centres, axis=1) + self.radii))

    def with_axes(self, axes: np.ndarray) -> "Shape":
        """The same spheres along other axes of the frame in which they were given."""
        return replace(self, centres=self.centres @ self.axes.T @ axes, axes=axes)


def shape_of_spheres(centres: np.ndarray, radii: np.ndarray) -> Shape:
    """The shape of a union of spheres of even density; where they overlap, the volume counts once.

    Args:
        centres: shape (k, 3) [m], in any frame.
        radii: shape (k,) [m].
    """
    centres, radii = np.asarray(centres, float), np.asarray(radii, float)
    volume, middle, inertia = union_properties(centres, radii)
    return principal_shape(centres, radii, volume, middle, inertia / volume)


def union_properties(centres: np.ndarray, radii: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume [m^3], centre (3,) [m] and inertia tensor about it at density one (3, 3) [m^5] of a union of spheres.

    Exact along x, midpoint rule over lines in y and z; the error of the volume is about 1e-6 of it.
    """
    low, high = (centres - radii[:, None]).min(axis=0), (centres + radii[:, None]).max(axis=0)
    steps = (high - low)[1:] / _LINES
    ys, zs = (low[k + 1] + steps[k] * (np.arange(_LINES) + 0.5) for k in range(2))
    moments = np.zeros(10)  # of 1, x, y, z, xx, yy, zz, xy, yz, zx
    for y in ys:
        half = radii[:, None] ** 2 - (y - centres[:, 1, None]) ** 2 - (zs - centres[:, 2, None]) ** 2
        half = np.where(half > 0.0, np.sqrt(np.maximum(half, 0.0)), np.nan)
        begin, end = centres[:, 0, None] - half, centres[:, 0, None] + half
        order = np.argsort(begin, axis=0)  # lines that miss a sphere come last
        begin, end = np.take_along_axis(begin, order, 0), np.take_along_axis(end, order, 0)
        reached = np.fmax.accumulate(np.vstack([np.full(len(zs), -np.inf), end[:-1]]), axis=0)
        begin = np.maximum(begin, reached)
        inside = end > begin
        begin, end = np.where(inside, begin, 0.0), np.where(inside, end, 0.0)
        m0, m1, m2 = ((end**k - begin**k).sum(axis=0) / k for k in (1, 2, 3))
        moments += [
            m0.sum(),
            m1.sum(),
            y * m0.sum(),
            m0 @ zs,
            m2.sum(),
            y * y * m0.sum(),
            m0 @ zs**2,
            y * m1.sum(),
            y * (m0 @ zs),
            m1 @ zs,
        ]
    moments *= steps[0] * steps[1]
    volume, middle = float(moments[0]), moments[1:4] / moments[0]
    xx, yy, zz, xy, yz, zx = moments[4:]
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) - volume * np.outer(middle, middle)
    return volume, middle, np.trace(second) * np.eye(3) - second


def principal_shape(centres: np.ndarray, radii: np.ndarray, volume: float, middle: np.ndarray, gyration: np.ndarray) -> Shape:
    """Spheres brought into the principal frame.

    Args:
        centres: in any frame, shape (k, 3) [m].
        radii: shape (k,) [m].
        volume: of the solid they stand for [m^3].
        middle: its centre of mass in that frame, shape (3,) [m].
        gyration: its inertia tensor over its mass in that frame, shape (3, 3) [m^2].
    """
    moments, axes = np.linalg.eigh(gyration)
    if np.ptp(moments) < 1e-4 * moments.mean():  # isotropic but for the quadrature
        moments, axes = np.full(3, moments.mean()), np.eye(3)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return Shape((centres - middle) @ axes, radii, volume, moments, axes, middle)


@cache
def tetrahedron() -> Shape:
    """Four equal spheres at the corners of a regular tetrahedron, radius one."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * _EDGE / np.sqrt(8.0)
    return shape_of_spheres(corners, np.ones(4))


def read_shape(path: Path) -> Shape:
    """A clump from a csv file with the columns x, y, z, radius [m], or an npz file with position and radius.

    Raises:
        SceneError: if the file cannot be read or holds no spheres.
    """
    try:
        if path.suffix == ".npz":
            columns = read_npz(path)
            centres, radii = np.asarray(columns["position"], float), np.asarray(columns["radius"], float)
        else:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = [{k.strip(): float(v) for k, v in row.items()} for row in csv.DictReader(file)]
            centres = np.array([[row[axis] for axis in "xyz"] for row in rows]).reshape(-1, 3)
            radii = np.array([row["radius"] for row in rows])
    except OSError as error:
        raise SceneError(
            f"shape: '{path.name}' is neither {SPHERE} nor {TETRAHEDRON}, and cannot be read as a file of spheres: "
            f"{error.strerror or error}"
        ) from None
    except (KeyError, ValueError, TypeError, AttributeError, csv.Error) as error:
        raise SceneError(f"shape: file '{path.name}' needs the columns x, y, z, radius in numbers: {error}") from None
    if not len(radii) or centres.shape != (len(radii), 3):
        raise SceneError(f"shape: file '{path.name}' holds no spheres; give one row x, y, z, radius for each")
    if not (np.all(np.isfinite(centres)) and np.all(radii > 0.0) and np.all(np.isfinite(radii))):
        raise SceneError(f"shape: file '{path.name}' has a radius that is not positive, or a value that is not finite")
    return _known_shape(centres.tobytes(), radii.tobytes())  # of the content, because a file may change


@cache
def _known_shape(centres: bytes, radii: bytes) -> Shape:
    return shape_of_spheres(np.frombuffer(centres).reshape(-1, 3), np.frombuffer(radii))


def shape_named(name: str | Path, where: str) -> Shape | None:
    """A shape as a scene names it: None for ``sphere``.

    Args:
        name: ``sphere``, ``tetrahedron`` or the path of a clump file.
        where: field that an error names.

    Raises:
        SceneError: if the file cannot be used.
    """
    if name == SPHERE:
        return None
    if name == TETRAHEDRON:
        return tetrahedron()
    try:
        return read_shape(Path(name))
    except SceneError as error:
        raise SceneError(f"{where} {error}") from None
