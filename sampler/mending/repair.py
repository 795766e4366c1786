"""Mending a mesh step by step, and saying what was done.

What leaves here is one list of consistently outward triangles: closed solids, and sheets (surfaces modelled without thickness).
"""

from dataclasses import dataclass, field

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.reading import check_mesh
from sampler.geometry.surface import Surface
from sampler.geometry.topology import edges_of, link_items, merge_points
from sampler.mending.caps import Caps, close_holes
from sampler.mending.orientation import agree_faces, face_outward, inward_pieces, outside_on_both_sides
from sampler.mending.raising import raise_caps
from sampler.mending.welding import sew_edges

SOLID, CAP, SHEET = 0, 1, 2
SHEETS = "auto", "never", "always"

_SHEET = 0.10  # a component is a sheet if closing it takes more area than this share of its own
_TORN, _PLANE = 0.6, 0.95  # holes count so much of that if their caps, as vectors, have less of their area: openings are plane
_RAGGED, _BROKEN = 0.15, 0.2  # and so much of it if their rim zigzags and they are no more than this share of the whole area:
_ROUND, _SHARP = 2.3 * np.pi, 0.3 * np.pi  # a rim turns so far in all, where one that was meant turns once round; at a corner
_ENCLOSED = 0.9  # share of the area that must have an inside for loose pieces to count as one solid
_ASKED = 4000  # faces are enough to tell that share
_FEW = 8  # faces of a component in which a hole of three corners is nothing special
_SCATTERED = 50  # open pieces from which a mesh is likely to be a cracked solid
_CRUMB = 0.01  # share of the area below which one of many open pieces is part of a cracked surface
_FLAKE = 1e-6  # below which an open piece has no thickness: no particle would lie on it
_LOOSE = 0.5  # share of the area in single triangles from which a mesh is a soup


@dataclass
class RepairReport:
    """What was found and mended.

    Attributes:
        steps: what was done and how often, in order.
        warnings: what the user should know, one sentence each.
    """

    steps: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class RepairedMesh:
    """Triangles after repair.

    Attributes:
        vertices: shape (n, 3) [m].
        faces: outward, shape (m, 3).
        kind: of each face, ``SOLID``, ``CAP`` (closes a hole, not in the file) or ``SHEET``, shape (m,).
        closed: all solids are, none is a cracked surface.
        report: what was done.
    """

    vertices: np.ndarray
    faces: np.ndarray
    kind: np.ndarray
    closed: bool
    report: RepairReport

    @property
    def triangles(self) -> np.ndarray:
        """Corners, shape (m, 3, 3) [m]."""
        return self.vertices[self.faces]

    @property
    def diagonal(self) -> float:
        """Of the bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.triangles.reshape(-1, 3), axis=0)))


def repair_mesh(mesh: trimesh.Trimesh, sheets: str = "auto") -> RepairedMesh:
    """Merge, clean, sew, reorient and close a mesh.

    Args:
        mesh: in metres.
        sheets: ``auto`` takes an open component for a sheet where closing it would take more than a tenth of its area,
            a sixth where its rims lie in no plane and so are torn, or two thirds where they zigzag and it is less than a
            fifth of the whole; ``never`` closes all, ``always`` none.

    Raises:
        MeshError: if there are no sound triangles, or they are loose and enclose nothing.
    """
    if sheets not in SHEETS:
        raise MeshError(f"sheets must be auto, never or always, got '{sheets}'")
    check_mesh(mesh)
    report = RepairReport()
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    same = merge_points(vertices)
    report.steps["vertices merged"] = int((same != np.arange(len(same))).sum())
    faces = _drop(same[faces], report)
    sewn = sew_edges(vertices, faces)
    report.steps["edges sewn"] = int((sewn != np.arange(len(sewn))).sum())
    if report.steps["edges sewn"]:
        vertices = _meet(vertices, sewn)
        faces = _drop(sewn[faces], report)
    faces, component, piece, report.steps["faces turned"], clashes = agree_faces(vertices, faces)
    caps = close_holes(vertices, faces, component, bridged=True)
    area = np.bincount(component, Surface.areas_of(vertices[faces]))
    sheet = _sheets(sheets, component, area, caps, vertices)
    enclosing = sheets == "auto" and sheet.sum() > 1 and _enclosing(vertices[faces], sheet[component], sheet.sum() > _SCATTERED)
    if not enclosing and sheets != "never":
        _refuse_soup(component, area, sheet)
    keep = ~sheet[caps.owner]
    loose = sheet.copy()
    crumbs = sheet & (area < _CRUMB * area.sum())
    closed = not (enclosing or (crumbs.sum() > _SCATTERED and sheets == "auto"))
    if not closed:
        taken = sheet if enclosing else crumbs
        sheet = sheet & ~taken
        report.warnings.append(f"{taken.sum()} open pieces are taken for parts of one cracked surface")
    sheet &= area > _FLAKE * area.sum()
    kind = np.where(sheet[component], SHEET, SOLID)
    report.steps["holes closed"] = len(np.unique(caps.loop[keep]))
    report.steps["sheets"] = int(sheet.sum())
    vertices, capping, owner = raise_caps(vertices, faces, caps, keep, _SHEET / _TORN * area)
    faces = np.concatenate([faces, capping])
    component = np.concatenate([component, owner])
    kind = np.concatenate([kind, np.full(len(capping), CAP)])
    faces, report.steps["components turned"] = face_outward(vertices, faces, component, loose[component])
    asked = np.flatnonzero((kind == SOLID) & ~loose[component])
    if len(asked) and int(piece.max()) >= len(area):
        faces, kind = _mend_pieces(vertices, faces, kind, piece, asked, report)
    large = keep & (np.bincount(caps.loop)[caps.loop] > 1)
    share = float(Surface.areas_of(vertices[caps.faces[large]]).sum() / area.sum())
    _warn(report, share, clashes)
    return RepairedMesh(vertices, faces, kind, closed, report)


def _meet(vertices: np.ndarray, joined: np.ndarray) -> np.ndarray:
    """Vertices, moved to the middle of those they are joined with."""
    middle = np.stack([np.bincount(joined, x, len(vertices)) for x in vertices.T], axis=1)
    return middle[joined] / np.bincount(joined)[joined, None]


def _drop(faces: np.ndarray, report: RepairReport) -> np.ndarray:
    """Drop triangles with a corner twice, and all but one of those with the same corners.

    Both are dropped where two solids touch there, and both kept where two that overlap have the face in common.
    """
    degenerate = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    faces = faces[~degenerate]
    if not len(faces):
        raise MeshError("mesh: all its triangles are degenerate")
    order = np.argsort(faces, axis=1)
    even = np.isin(order @ [9, 3, 1], [5, 15, 19])  # 012, 120, 201
    corners = np.take_along_axis(faces, order, axis=1)
    number = int(faces.max()) + 1
    if number < 2_000_000:  # the product fits 64 bits
        key = (corners[:, 0] * number + corners[:, 1]) * number + corners[:, 2]
    else:
        key = merge_points(corners.astype(float))
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    keep = np.zeros(len(faces), bool)
    keep[first] = True
    opposed = np.zeros(len(first), bool)
    opposed[group[even]] = True
    back = np.zeros(len(first), bool)
    back[group[~even]] = True
    opposed &= back
    keep[first[_shared(faces[first], opposed)]] = False
    again = np.setdiff1d(np.arange(len(faces)), first)
    again = again[np.unique(group[again], return_index=True)[1]]  # a second one of those that were there more than once
    twins = np.zeros(len(first), bool)
    twins[group[again]] = True
    keep[again[_shared(faces[first], twins & ~opposed)[group[again]]]] = True
    for name, count in (("degenerate faces dropped", degenerate.sum()), ("duplicate faces dropped", (~keep).sum())):
        report.steps[name] = report.steps.get(name, 0) + int(count)
    return faces[keep]


def _shared(faces: np.ndarray, several: np.ndarray) -> np.ndarray:
    """Of faces that were there several times, those that belong to two solids: all around their rim two others meet."""
    if not several.any() or several.all():
        return np.zeros(len(faces), bool)
    edges = edges_of(faces)
    edge = edges.edge
    own = np.bincount(edge, several[edges.face])
    others = edges.degree - own
    inner = np.flatnonzero(own == 2)
    halves = np.flatnonzero(several[edges.face])
    pairs = halves[np.isin(edge[halves], inner)]
    region, _, _ = link_items(len(faces), edges.face[pairs[0::2]], edges.face[pairs[1::2]])
    wrong = halves[(own[edge[halves]] != 2) & ((own[edge[halves]] != 1) | (others[edge[halves]] != 2))]
    rim = halves[(own[edge[halves]] == 1) & (others[edge[halves]] == 2)]
    shared = np.zeros(len(faces), bool)
    shared[region[edges.face[rim]]] = True
    shared[region[edges.face[wrong]]] = False
    return several & shared[region]


def _mend_pieces(vertices, faces, kind, piece, asked, report) -> tuple[np.ndarray, np.ndarray]:
    """Turn pieces between many-sided edges that still face inward; what then has the outside on both sides is a sheet."""
    around = Surface(vertices[faces[kind != SHEET]])
    turn = asked[inward_pieces(vertices[faces[asked]], piece[asked], around)]
    if len(turn):
        faces[turn] = faces[turn, ::-1]
        report.steps["faces turned"] += len(turn)
        around = Surface(vertices[faces[kind != SHEET]])
    free = outside_on_both_sides(vertices[faces[asked]], around)
    kind[asked[free]] = SHEET
    report.steps["faces of double walls"] = int(free.sum())
    return faces, kind


def _sheets(choice: str, component: np.ndarray, area: np.ndarray, caps: Caps, vertices: np.ndarray) -> np.ndarray:
    """Components that are sheets. A hole of three corners in more than a few faces is a face that was lost."""
    if choice == "never":
        return np.zeros(len(area), bool)
    if choice == "always":
        return np.bincount(caps.owner, minlength=len(area)) > 0
    corner, loop = vertices[caps.faces], caps.loop
    across = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    cap_area, number = np.linalg.norm(across, axis=1), np.bincount(loop)
    straight = np.linalg.norm([np.bincount(loop, x) for x in across.T], axis=0)
    counts = np.where(straight < _PLANE * np.bincount(loop, cap_area), _TORN, 1.0)
    small = np.bincount(loop, cap_area) < _BROKEN * area.sum()
    counts[small & (caps.turn > _ROUND) & (caps.turn > _SHARP * (number + 2))] = _RAGGED
    counts = counts[loop]
    counts[(number == 1)[loop] & (np.bincount(component)[caps.owner] > _FEW)] = 0.0
    return np.bincount(caps.owner, counts * cap_area, minlength=len(area)) > _SHEET * area


def _enclosing(triangles: np.ndarray, open_: np.ndarray, lenient: bool) -> bool:
    """Whether open pieces, with everything else, have an inside behind and an outside before nearly all of their area."""
    surface = Surface(triangles)
    asked = np.flatnonzero(open_ & (surface.areas > 0.0))
    asked = asked[:: 1 + len(asked) // _ASKED]
    centre, step = surface.triangles[asked].mean(axis=1), 1e-4 * surface.unit * surface.normals[asked]
    before, behind = surface.winding(centre + step), surface.winding(centre - step)
    doubt = 0.25 if lenient else 0.1
    sound = (before < doubt) & (behind > 1.0 - doubt)
    inverted = (before < doubt - 1.0) & (behind > -doubt)
    area = surface.areas[asked]
    return max(area[sound].sum(), area[inverted].sum()) > _ENCLOSED * area.sum()


def _refuse_soup(component: np.ndarray, area: np.ndarray, sheet: np.ndarray) -> None:
    single = sheet & (np.bincount(component) == 1)
    if area[single].sum() > _LOOSE * area.sum():
        raise MeshError(
            f"mesh: {single.sum()} of its {len(component)} triangles are loose and enclose nothing; it has no inside. "
            "Export it as a connected surface"
        )


def _warn(report: RepairReport, share: float, clashes: int) -> None:
    if share:
        report.warnings.append(
            f"holes were closed, {100.0 * share:.2g} % of the surface; sign, volume and inertia are uncertain there"
        )
    if clashes:
        report.warnings.append(f"{clashes} edges join faces that cannot be oriented consistently (one-sided or self-touching)")
    if report.steps["sheets"]:
        report.warnings.append(f"{report.steps['sheets']} components are open surfaces; they are taken for sheets")
