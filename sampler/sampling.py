"""From a mesh to a particle body: repair, skin, particles, mass."""

from collections.abc import Callable
from functools import partial

import numpy as np
import trimesh

from sampler.body import ParticleBody
from sampler.errors import MeshError
from sampler.inset import inset_particles
from sampler.lattice import lattice_spacing, particle_count
from sampler.mass import integrate, is_physical
from sampler.measuring import measure_evenness
from sampler.options import check_options
from sampler.repair import SHEET, RepairedMesh, repair_mesh
from sampler.sheets import beyond_rims, closed_triangles, thick_plates
from sampler.skin import Skin, coinciding_layers, free_triangles, touchable_parts, winding_before
from sampler.spreading import Observer, spread_particles
from sampler.surface import Surface

SPACING = 1.5  # default distance between neighbours in particle radii; below 2 so that particles overlap into a closed skin
MOST = 2_000_000  # particles, more are not meant
_BURIED = 10.0  # times as large as what can be touched, at most, is all of a surface that is worth cutting
_HUGE = 1000.0  # particles of so many diagonals are not meant

_CLOSED = 0.92  # wanted coverage, of the largest that still stops the smallest grain
_COVERED = 0.80  # coverage to expect, in spacings
_TRIES, _FINER = 4, 0.92
_WALL_SAMPLES = 4000
_OUTWARD = 1e-5  # of the diagonal: how far out of its piece a particle is asked what is before it
_ASIDE = (0.01, 0.03, 0.1, 0.3)  # ways out of the crease between two parts that are tried, in spacings

Progress = Callable[[float], None]


def sample_body(
    mesh: trimesh.Trimesh | RepairedMesh,
    radius: float,
    spacing: float | None = None,
    seed: int = 0,
    device: str = "cpu",
    progress: Progress = lambda share: None,
    *,
    count: int | None = None,
    grain: float | None = None,
    inset: bool = False,
    thickness: float | None = None,
    sheets: str = "auto",
    observe: Observer | None = None,
) -> ParticleBody:
    """Sample a mesh into a particle body.

    Args:
        mesh: in metres.
        radius: of every particle [m].
        spacing: wanted distance between neighbours [m]; 1.5 radii if None, less where ``grain`` asks for it.
        seed: of the random start.
        device: Warp device.
        progress: called with the share of the work done, 0 to 1.
        count: wanted number of particles, instead of a spacing.
        grain: radius of the smallest grain that must not pass [m].
        inset: put the centres one radius below the surface, so that the body keeps its outer size; they lie on it if False.
        thickness: of sheets [m]; up to two radii, and if None, one layer of particles lies in the sheet itself.
        sheets: which open components are sheets, see ``repair_mesh``.
        observe: called with the particles, shape (n, 3) [m], as they relax.

    Raises:
        MeshError: if an option makes no sense, the mesh cannot be repaired, the particles would be too many to be meant, or a
            grain could pass.
    """
    lengths = {"radius": radius, "spacing": spacing, "smallest grain": grain, "sheet thickness": thickness}
    check_options(lengths, count, seed, device)
    repaired = mesh if isinstance(mesh, RepairedMesh) else repair_mesh(mesh, sheets)
    thickness = 2.0 * radius if thickness is None else thickness
    _check_scale(repaired.triangles, radius, _spacing(radius, spacing, count, grain, repaired.triangles))
    closed, owner = closed_triangles(repaired, thickness)
    fine = _spacing(radius, spacing, count, grain, closed)
    around = solid = Surface(closed, device)
    warnings, plates = list(repaired.report.warnings), np.zeros((0, 3, 3))
    # Sheets get one layer of particles where they are thin; the skin of the solids ends only where it is buried in other solids.
    sheet = repaired.faces[repaired.kind == SHEET] if thickness <= 2.0 * radius else np.zeros((0, 3), int)
    if len(sheet) and np.any(owner != SHEET):
        solid = Surface(closed[owner != SHEET], device)
        plates = free_triangles(repaired.vertices[sheet], solid, fine)[0]
    free, parent, layers = free_triangles(solid.triangles, solid, fine)
    volume, centre, inertia = _mass(solid, free, parent, layers, thick_plates(plates, thickness), warnings)
    if solid is not around:
        free = np.concatenate([free, plates])
    elif len(sheet):
        free, solid = repaired.vertices[sheet], None
    if not len(free):
        raise MeshError("mesh: no part of its surface has an outside; check its orientation")
    fine = _spacing(radius, spacing, count, grain, free)
    parts = touchable_parts(free, solid, fine)
    skin = Skin(parts, device, coinciding_layers(parts, solid) if solid else None)
    area = float(skin.areas.sum())
    for attempt in range(_TRIES):
        number = count if count is not None else particle_count(area, fine)
        if number > MOST:
            raise _too_many(area, number, radius)
        h = lattice_spacing(area, number)
        settle = partial(_clear_creases, skin=skin, solid=solid, spacing=h) if solid else lambda *placed: placed
        beyond = beyond_rims(repaired.vertices, sheet, skin, h)
        points, normals = spread_particles(skin, number, seed, progress, observe, settle, beyond)
        evenness = measure_evenness(skin, points, normals)
        h = lattice_spacing(area, len(points))
        if grain is None or evenness.coverage * h < radius + grain:
            break
        if count is not None or attempt == _TRIES - 1:
            raise MeshError(
                f"a grain of radius {grain:.3g} m could pass: some places lie {evenness.coverage * h:.3g} m from the nearest "
                f"particle of radius {radius:.3g} m; take more or larger particles"
            )
        fine *= _FINER
    if inset:
        points, kept = inset_particles(points, normals, around, radius, h)
        normals = normals[kept]
    return ParticleBody(
        points=points,
        normals=normals,
        radius=radius,
        spacing=h,
        area=area,
        volume=volume,
        centre=centre,
        inertia=inertia,
        triangles=closed,
        thinnest_wall=thinnest_wall(around),
        evenness=evenness,
        steps=dict(repaired.report.steps),
        warnings=tuple(warnings),
    )


def _check_scale(triangles: np.ndarray, radius: float, spacing: float) -> None:
    """Refuse numbers that cannot be meant before anything is cut for them, which takes long or overflows."""
    size = float(np.linalg.norm(np.ptp(triangles, axis=(0, 1))))
    if max(radius, spacing) > _HUGE * size:
        raise MeshError(
            f"particles of radius {radius:.3g} m, {spacing:.3g} m apart, are far larger than the mesh, {size:.3g} m across; "
            "check the mesh's scale"
        )
    area = float(Surface.areas_of(triangles).sum())
    with np.errstate(over="ignore"):
        number = 2.0 / np.sqrt(3.0) * (np.sqrt(area) / np.float64(spacing)) ** 2
    if number > _BURIED * MOST:
        raise _too_many(area, number, radius)


def _too_many(area: float, number: float, radius: float) -> MeshError:
    return MeshError(
        f"a surface of {area:.3g} m^2 would need {number:.2g} particles of radius {radius:.3g} m; "
        "check the mesh's scale, or take larger particles"
    )


def _clear_creases(
    points: np.ndarray, normals: np.ndarray, skin: Skin, solid: Surface, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Take particles that look into the solid, in creases between parts and ends of slits, the way to the middle of their piece.

    Pieces were asked there whether they are free.
    """
    _, face = skin.closest(points, up=normals)
    way = skin.triangles[face].mean(axis=1) - points
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), np.finfo(float).tiny)
    outward = points - _OUTWARD * solid.unit * way  # so that none counts as free that lies in the other wall itself
    buried = np.flatnonzero(np.abs(winding_before(outward, normals, solid)) > 0.5)
    points = points.copy()
    begin = points[buried]
    for share in _ASIDE:
        if not len(buried):
            break
        there, face = skin.closest(begin + share * spacing * way[buried], up=normals[buried])
        same = np.einsum("ij,ij->i", skin.normals[face], normals[buried]) > 0.9  # not over to the other part
        free = same & (np.abs(winding_before(there, normals[buried], solid)) < 0.5)
        points[buried[free]] = there[free]
        buried, begin = buried[~free], begin[~free]
    return points, normals


def thinnest_wall(surface: Surface) -> float:
    """Shortest way [m] through the solid between two skins that face away from one another; infinite if there are none."""
    points, normals = Skin(surface.triangles).sample(_WALL_SAMPLES, np.random.default_rng(0))
    step = 1e-5 * surface.unit
    face, way = surface.cast(points - step * normals, -normals)
    opposed = (face >= 0) & (np.einsum("ij,ij->i", surface.normals[face], normals) < -0.9)
    return float(way[opposed].min() + step) if opposed.any() else float("inf")


def _spacing(radius, spacing, count, grain, triangles) -> float:
    if count is not None:
        if spacing is not None:
            raise MeshError("give either the spacing or the count of the particles, not both")
        return lattice_spacing(float(Surface.areas_of(triangles).sum()), count)
    fine = SPACING * radius if spacing is None else spacing
    return fine if grain is None else min(fine, _CLOSED * (radius + grain) / _COVERED)


def _mass(solid, free, parent, layers, plates, warnings) -> tuple[float, np.ndarray, np.ndarray]:
    """From all triangles of the solid where none is buried, else from its free parts; and from plates beside it."""
    whole = np.bincount(parent, minlength=len(solid.triangles)) == (solid.areas > 0.0)
    pieces, share = solid.triangles, np.ones(len(solid.triangles))
    if not np.all(whole):
        pieces, share = free, 1.0 / layers
        warnings.append("parts of the surface are buried in others; volume and inertia are those of the union")
    every = np.concatenate([pieces, plates])
    volume, centre, inertia = integrate(every, np.append(share, np.ones(len(plates)))) if len(every) else (0.0, every, every)
    corners = np.concatenate([solid.triangles, plates]).reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if is_physical(volume, centre, inertia, low, high):
        return volume, centre, inertia
    warnings.append("the surface encloses no sound volume; mass and inertia must be given by hand")
    return float("nan"), solid.triangles.mean(axis=(0, 1)), np.full((3, 3), np.nan)
