"""From a mesh to a particle body: repair, skin, particles, mass."""

from collections.abc import Callable
from functools import partial

import numpy as np
import trimesh

from sampler.body import Evenness, ParticleBody
from sampler.errors import MeshError
from sampler.geometry.surface import Surface
from sampler.geometry.vectors import extremes
from sampler.launching import load_kernels
from sampler.limits import MOST, broken_limits, check_scale, check_thickness, too_many, unevenness
from sampler.mass import count_inside, integrate, is_physical, joined, openness
from sampler.measuring import measure_evenness
from sampler.mending.repair import SHEET, RepairedMesh, repair_mesh
from sampler.options import check_options
from sampler.particles.inset import Inside, inset_triangles
from sampler.particles.lattice import lattice_spacing, particle_count
from sampler.particles.rims import beyond_edges, beyond_layers
from sampler.particles.skin import Skin, coinciding_layers, free_triangles, touchable_parts, winding_before
from sampler.particles.spreading import Observer, spread_particles
from sampler.particles.strips import with_rows
from sampler.sheets import closed_triangles, plates_outside, thick_plates

SPACING = 1.5  # default distance between neighbours in particle radii; below 2 so that particles overlap into a closed skin
_CLOSED = 0.92  # wanted coverage, of the largest that still stops the smallest grain
_COVERED = 0.80  # coverage to expect, in spacings
_TRIES, _FINER = 4, 0.92
_CROWDED = 1e-3  # nearer to one another than this, in radii, are particles whose inset surface is next to nothing
_STARTS = (200, 8), (2000, 4)  # fewer particles that come out uneven are thrown so often at most, and the best are taken
_LOOSE = 1.1  # times what is to be expected of distance and coverage, from which strips are sought that have too few particles
_NOTABLE = 0.01  # share of the volume that is not worth a warning
_OPEN = 0.01  # openness of a surface from which its volume is counted, not integrated
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
        progress: called with the share of the work done, 0 to 1; at 0 from the start until particles relax.
        count: wanted number of particles, instead of a spacing.
        grain: radius of the smallest grain that must not pass [m].
        inset: put the centres one radius below the surface, so that the body keeps its outer size, and in the middle of
            thinner walls; on the surface if False, and in sheets in any case.
        thickness: of sheets [m]; up to two radii, and if None, one layer of particles lies in the sheet itself.
        sheets: which open components are sheets, see ``repair_mesh``.
        observe: called with the particles, shape (n, 3) [m], as they relax.

    Raises:
        MeshError: if an option makes no sense, the mesh cannot be repaired, the particles would be too many to be meant, or a
            grain could pass.
    """
    lengths = {"radius": radius, "spacing": spacing, "smallest grain": grain, "sheet thickness": thickness}
    check_options(lengths, count, seed, device)
    progress(0.0)  # compiling, mending, and cutting parts that cross may take a while
    load_kernels(device, partial(progress, 0.0))
    repaired = mesh if isinstance(mesh, RepairedMesh) else repair_mesh(mesh, sheets)
    thickness, told = 2.0 * radius if thickness is None else thickness, list(repaired.report.warnings)
    if np.any(repaired.kind == SHEET):
        check_thickness(thickness, radius, repaired.diagonal)
        told.append(f"sheets count as {thickness:.3g} m thick, half of it on either side, so openings in them are narrower")
    check_scale(repaired.triangles, radius, _spacing(radius, spacing, count, grain, repaired.triangles))
    closed, owner = closed_triangles(repaired, thickness)
    fine = _spacing(radius, spacing, count, grain, closed)
    around = solid = Surface(closed, device)
    plates = np.zeros((0, 3, 3))
    # Sheets get one layer of particles where they are thin; the skin of the solids ends only where it is buried in other solids.
    sheet = repaired.faces[repaired.kind == SHEET] if thickness <= 2.0 * radius else np.zeros((0, 3), int)
    if len(sheet) and np.any(owner != SHEET):
        solid = Surface(closed[owner != SHEET], device)
        plates = free_triangles(repaired.vertices[sheet], solid, fine)[0]
    free, parent, layers = free_triangles(solid.triangles, solid, fine)
    volume, centre, inertia, doubts = _mass(solid, around, free, parent, layers, plates, thickness, repaired.closed)
    if solid is not around:
        free = np.concatenate([free, plates])
    elif len(sheet):
        free, solid = repaired.vertices[sheet], None
    if not len(free):
        raise MeshError("mesh: no part of its surface has an outside; check its orientation")
    fine = _spacing(radius, spacing, count, grain, free)
    outer = skin = _skin(free, solid, fine, device)
    settle = partial(_clear_creases, skin=skin, solid=solid) if solid else None
    inside, thin = None, np.zeros((0, 3, 3))
    if inset and solid:
        inside = Inside(_skin(free[: len(free) - len(plates)], solid, fine, device), solid)
        plates = touchable_parts(plates, solid, fine) if len(plates) else plates
        skin, thin = _inset_skin(inside, plates, radius, fine, count)
        settle = None

    def spread(skin: Skin, number: int, h: float, start: int) -> tuple[np.ndarray, np.ndarray]:
        beyond = np.concatenate([beyond_edges(repaired.vertices, sheet, outer, h), beyond_layers(thin, skin, h)])
        move = partial(settle, spacing=h) if settle else lambda *placed: placed
        points, normals = spread_particles(skin, number, (seed, start) if start else seed, progress, observe, move, beyond)
        return (inside.settle(points, radius, 0.2 * h) if inside else points), normals

    points, normals, evenness, wanted, area = _spread_tight(spread, skin, radius, fine, count, grain)
    low, high = extremes(repaired.triangles)
    size = float(np.linalg.norm(high - low))  # of sheets, too
    doubtful = broken_limits(evenness, len(points), wanted, radius, size)
    if spacing is not None and fine < spacing:
        doubtful.append(f"particles lie {fine:.3g} m apart, not {spacing:.3g} m, or grains of radius {grain:.3g} m could pass")
    return ParticleBody(
        points=points,
        normals=normals,
        radius=radius,
        spacing=lattice_spacing(area, len(points)),
        area=area,
        volume=volume,
        centre=centre,
        inertia=inertia,
        triangles=closed,
        thinnest_wall=thinnest_wall(around),
        evenness=evenness,
        steps=dict(repaired.report.steps),
        warnings=(*told, *doubtful),
        mass_warnings=tuple(doubts),
    )


def _spread_tight(
    spread: Callable[[Skin, int, float, int], tuple[np.ndarray, np.ndarray]],
    skin: Skin,
    radius: float,
    spacing: float,
    count: int | None,
    grain: float | None,
) -> tuple[np.ndarray, np.ndarray, Evenness, int, float]:
    """Spread particles, ever more of them until no grain can pass, unless their number is given.

    Args:
        spread: gives centres and normals for a skin, a number of particles, their spacing [m] and the number of a random start.
        skin: where they lie.
        radius: of the particles [m].
        spacing: to begin with [m].
        count: their number, if that is given.
        grain: radius of the smallest grain that must not pass [m], if there is one.

    Returns:
        Centres, shape (n, 3) [m], and normals, shape (n, 3); how they lie; how many were wanted; the area that they share [m^2].
    """
    for attempt in range(_TRIES):
        found = points, _, evenness, _, area = _spread_once(spread, skin, radius, spacing, count)
        if not attempt and max(evenness.farthest, evenness.coverage / _COVERED) > _LOOSE:
            rows = with_rows(skin, spacing if count is None else lattice_spacing(area, count))
            if rows is not skin:
                skin = rows
                found = points, _, evenness, _, area = _spread_once(spread, skin, radius, spacing, count)
        coverage = evenness.coverage * lattice_spacing(area, len(points))
        if grain is None or coverage < radius + grain:
            return found
        if count is not None or attempt == _TRIES - 1:
            raise MeshError(
                f"a grain of radius {grain:.3g} m could pass: some places lie {coverage:.3g} m from the nearest "
                f"particle of radius {radius:.3g} m; take more or larger particles"
            )
        spacing *= _FINER


def _spread_once(spread, skin, radius, spacing, count) -> tuple[np.ndarray, np.ndarray, Evenness, int, float]:
    area = float(skin.areas.sum())
    number = count if count is not None else particle_count(area, spacing)
    if number > MOST:
        raise too_many(area, number, radius)
    best, least = None, np.inf
    for start in range(next((starts for few, starts in _STARTS if 1 < number < few), 1)):
        points, normals = spread(skin, number, lattice_spacing(area, number), start)
        evenness = measure_evenness(skin, points, normals)
        uneven = unevenness(evenness)
        if uneven < least or best is None:
            best, least = (points, normals, evenness, number, area), uneven
        if not least:
            break
    return best


def _skin(free: np.ndarray, solid: Surface | None, spacing: float, device: str) -> Skin:
    parts = touchable_parts(free, solid, spacing)
    if not len(parts):
        raise MeshError("mesh: its surface is far narrower than long everywhere, so it has no normals; check for stray vertices")
    return Skin(parts, device, coinciding_layers(parts, solid) if solid else None)


def _inset_skin(inside: Inside, plates: np.ndarray, radius: float, spacing: float, count: int | None) -> tuple[Skin, np.ndarray]:
    """The surface one radius below the skin, and plates as they are; as fine as the count asks for there, if one is given.

    And those triangles of it, shape (n, 3, 3) [m], that are the only layer in walls.
    """
    for _ in range(_TRIES):
        triangles, layers, thin = inset_triangles(inside, radius, spacing)
        if len(triangles) + len(plates) == 0:
            raise MeshError(f"mesh: particles of radius {radius:.3g} m find no room in it; take smaller ones, or no inset")
        skin = Skin(np.concatenate([triangles, plates]), inside.skin.device, np.append(layers, np.ones(len(plates))))
        finer = spacing if count is None else lattice_spacing(float(skin.areas.sum()), count)
        if finer < _CROWDED * radius:
            raise MeshError(
                f"mesh: particles of radius {radius:.3g} m find hardly any room in it; take smaller ones, or no inset"
            )
        if finer > 0.8 * spacing:
            break
        spacing = finer
    return skin, triangles[thin]


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
    """Shortest way [m] through the solid between two skins that face away from one another; infinite if there are none.

    From random places, and from the middle of every triangle: of a small fin random ones may all miss.
    """
    sound, step, thinnest = surface.areas > 0.0, 1e-5 * surface.unit, float("inf")
    middles = surface.triangles[sound].mean(axis=1), surface.normals[sound]
    for points, normals in (Skin(surface.triangles).sample(_WALL_SAMPLES, np.random.default_rng(0)), middles):
        face, way = surface.cast(points - step * normals, -normals, 1.001 * thinnest)  # what is thicker need not be found
        opposed = (face >= 0) & (np.einsum("ij,ij->i", surface.normals[face], normals) < -0.9)
        thinnest = min(thinnest, float(way[opposed].min() + step) if opposed.any() else thinnest)
    return thinnest


def _spacing(radius, spacing, count, grain, triangles) -> float:
    if count is not None:
        if spacing is not None:
            raise MeshError("give either the spacing or the count of the particles, not both")
        return lattice_spacing(float(Surface.areas_of(triangles).sum()), count)
    fine = SPACING * radius if spacing is None else spacing
    return fine if grain is None else min(fine, _CLOSED * (radius + grain) / _COVERED)


def _mass(solid, around, free, parent, layers, plates, thickness, closed) -> tuple[float, np.ndarray, np.ndarray, list[str]]:
    """From all triangles of the solid where all are free, apart and outward, else from its free parts; and from plates so thick.

    Returns:
        Volume [m^3], centre, shape (3,) [m], inertia for a density of one, shape (3, 3) [m^5]; warnings.
    """
    whole = np.bincount(parent, minlength=len(solid.triangles)) == (solid.areas > 0.0)
    turned = np.einsum("ij,ij->i", Surface.normals_of(free), solid.normals[parent]) < 0.0
    pieces, share, warnings = solid.triangles, np.ones(len(solid.triangles)), []
    if not np.all(whole) or np.any(layers > 1) or turned.any():
        pieces, share = free, 1.0 / layers
        why = "buried in others, or inside out where it crosses itself" if turned.any() else "buried in others"
        warnings.append(f"parts of the surface are {why}; volume and inertia are those of the union")
    parts = [integrate(pieces, share)] if len(pieces) else []
    if len(pieces) and not (closed and openness(pieces, share) < _OPEN):
        warnings.append("the surface does not close, so volume and inertia are counted from places inside of it")
        parts[0] = count_inside(solid)
    corners = solid.triangles.reshape(-1, 3)
    if len(plates):
        prisms, outside = thick_plates(plates, thickness), plates_outside(plates, thickness, solid)
        corners = np.concatenate([corners, prisms.reshape(-1, 3)])
        parts.append(outside or integrate(prisms))
    volume, centre, inertia = joined(parts)
    if len(plates) and outside and outside[0] > _NOTABLE * volume:
        warnings.append("sheets reach into solids, so what they add to volume and inertia is counted from places beside them")
    low, high = extremes(corners)
    if is_physical(volume, centre, inertia, low, high):
        return volume, centre, inertia, warnings
    if len(plates):  # those that lie on one another count twice
        volume, centre, inertia = count_inside(around)
        if is_physical(volume, centre, inertia, low, high):
            warnings.append("sheets overlap, so volume and inertia are counted from places inside of them")
            return volume, centre, inertia, warnings
    warnings.append("the surface encloses no sound volume; mass and inertia must be given by hand")
    return float("nan"), solid.triangles.mean(axis=(0, 1)), np.full((3, 3), np.nan), warnings
