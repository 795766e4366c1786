"""A still picture of a run: wrench against time beside cut-away views of the bed and the tools. Needs matplotlib."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.scene.types import Scene
from sand_sim.scene.walls import walls_of
from sand_sim.sinks.colours import colour_by_speed, fastest_shown
from sand_sim.sinks.run_log import RunLog, View

_VIEWS = 3
_TILT = np.radians(14.0)  # of the view from the horizontal
_STEEL = np.array([0.52, 0.56, 0.64])
_QUARTER = rotation.from_rpy(0.0, 0.0, -0.5 * np.pi)  # brings y to where x is seen
_LIGHT = np.array([-0.35, -0.55, 0.76])


def draw_run(log: RunLog, tools: list[ToolModel], path: Path) -> None:
    """Draw a run into a PNG file.

    Args:
        log: the run; a view is drawn of the end of its phases ``cut``, ``carry`` and ``dump``, else of its last three phases, and
            of the end of the run where that is later.
        tools: with their meshes.
        path: of the file; its folder is made.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    columns, views = log.columns(), pick_views(log)
    figure = plt.figure(figsize=(13.0, 7.2), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.5, 1.0])
    _draw_curves(left, columns, log)
    fastest = fastest_shown(log.scene)
    right.suptitle(f"grains by speed, from sand (at rest) to dark red ({fastest:g} m/s)", fontsize=9, x=0.02, ha="left")
    axes, sideways = np.atleast_1d(right.subplots(len(views), 1)), go_sideways(columns, tools)
    for axis, (_, view) in zip(axes, views, strict=True):
        seen = turned(view) if sideways else view
        _draw_view(axis, seen, tools, fastest, bin_sections(log.scene, _cut(seen), sideways))
        axis.set_xlabel("y [m]" if sideways else "x [m]", fontsize=8)
    limits = np.array([[axis.get_xlim(), axis.get_ylim()] for axis in axes])
    low, high = limits[..., 0].min(axis=0), limits[..., 1].max(axis=0)
    for axis, (name, view) in zip(axes, views, strict=True):
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
        axis.set_title(f"{name}, t = {view.time:.3g} s", fontsize=9, loc="left")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def pick_views(log: RunLog) -> list[tuple[str, View]]:
    """Moments of a run that are drawn, and what they are called."""
    digging = [name for name in ("cut", "carry", "dump") if name in log.views]
    views, end = [(name, log.views[name]) for name in digging or log.views], View.of(log.last)
    if not digging and (not views or views[-1][1].time < end.time):
        views.append(("end", end))
    return views[-_VIEWS:]


def go_sideways(columns: dict[str, np.ndarray], tools: list[ToolModel]) -> bool:
    """Whether tools go along y, and turn that way, farther than along x, so that they are looked at along x."""
    along = np.zeros(2)
    for model in tools:
        place, turns = columns[f"{model.tool.name}.position"], columns[f"{model.tool.name}.orientation"]
        along += np.abs(np.diff(place[:, :2], axis=0)).sum(axis=0)
        for before, after in pairwise(turns):
            turn = rotation.to_vector(rotation.multiply(after, rotation.inverse(before)))
            along += model.extent * np.abs(turn[[1, 0]])  # about y points go along x
    return bool(along[1] > along[0])


def turned(view: View) -> View:
    """A view whose y lies where x is seen."""
    places = {name: rotation.rotate(_QUARTER, getattr(view, name)) for name in ("position", "tool_position")}
    return replace(view, **places, tool_orientation=rotation.multiply(_QUARTER, view.tool_orientation))


def bin_sections(scene: Scene, cut: float, sideways: bool = False) -> list[np.ndarray]:
    """Where the plane at a place along the line of sight cuts the sides of bins: the ends of lines, shape (2, 3) [m]."""
    lines = []
    for wall in [wall for boundary in scene.boundaries for wall in walls_of(boundary)]:
        if wall.kind == "panel":
            corners = np.sort(rotation.rotate(_QUARTER, wall.corners), axis=0) if sideways else wall.corners
            if corners[0, 1] < cut < corners[1, 1]:
                lines.append(np.column_stack([corners[:, 0], np.full(2, cut), corners[:, 2]]))
    return lines


def _cut(view: View) -> float:
    """Before which place along the line of sight nothing is drawn [m]."""
    return view.tool_position[0, 1] if len(view.tool_position) else -np.inf


def _draw_curves(figure, columns: dict[str, np.ndarray], log: RunLog) -> None:
    time, names = columns["time"], [tool.name for tool in log.scene.tools]
    rows = figure.subplots(3 if names else 1, 1, sharex=True, squeeze=False)[:, 0]
    for name in names:
        for k, axis in enumerate("xyz"):
            rows[0].plot(time, columns[f"{name}.force"][:, k], lw=1.2, label=f"{name} {axis}")
            rows[1].plot(time, columns[f"{name}.torque"][:, k], lw=1.2, label=f"{name} {axis}")
    if names:
        rows[0].set_ylabel("force of the sand on the tool,\nworld frame [N]")
        rows[1].set_ylabel("torque about the tool frame's\norigin, tool frame [N m]")
        rows[0].legend(fontsize=8, ncols=3)
        for name in names:
            rows[2].plot(time, columns[f"{name}.carried"], lw=1.4, label=name)
        rows[2].set_ylabel("mass in the tool's\nbounding box [kg]")
        rows[2].legend(fontsize=8, ncols=3)
    else:
        rows[0].plot(time, columns["kinetic"], lw=1.2)
        rows[0].set_ylabel("kinetic energy [J]")
    rows[-1].set_xlabel("simulated time [s]")
    for row in rows:
        row.grid(alpha=0.3)
        row.margins(x=0.01)
        row.locator_params(axis="x", nbins=6)


def _project(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Seen from -y, tilted down: picture coordinates, shape (n, 2), and depth away from the eye, shape (n,)."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([x, z * np.cos(_TILT) + y * np.sin(_TILT)], -1), y * np.cos(_TILT) - z * np.sin(_TILT)


def _draw_view(axis, view: View, tools: list[ToolModel], fastest: float, walls: list[np.ndarray]) -> None:
    """Grains and tool faces behind the plane through the first tool, far ones first, and before them where it cuts walls."""
    from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection

    cut, sections = _cut(view), [_project(line)[0] for line in walls]
    shown = np.flatnonzero(view.position[:, 1] > cut - view.radius)
    spots, depth = _project(view.position[shown])
    colours = colour_by_speed(view.speed[shown], fastest) / 255.0
    nearest, farthest = (depth.min(), depth.max()) if len(depth) else (0.0, 0.0)
    shade = 0.62 + 0.38 * np.clip(1.0 - (depth - nearest) / ((farthest - nearest) or 1.0), 0.0, 1.0)
    items = [(d, "grain", k) for k, d in enumerate(depth)]
    faces, face_colours = _tool_faces(view, tools, cut)
    items += [(d, "face", k) for k, (d, _) in enumerate(faces)]
    items.sort(key=lambda item: -item[0])
    start = 0
    for end in range(1, len(items) + 1):
        if end < len(items) and items[end][1] == items[start][1]:
            continue
        run = [item[2] for item in items[start:end]]
        if items[start][1] == "grain":
            size = 2.0 * view.radius[shown][run]
            centre = spots[run]
            common = {"units": "xy", "offset_transform": axis.transData}
            body = EllipseCollection(size, size, 0, offsets=centre, facecolors=colours[run] * shade[run, None], **common)
            body.set_edgecolor("#5a4326")
            body.set_linewidth(0.25)
            axis.add_collection(body)
            light = np.clip(colours[run] * shade[run, None] * 1.25, 0.0, 1.0)
            glint = centre + 0.14 * size[:, None] * np.array([-1.0, 1.0])
            axis.add_collection(EllipseCollection(0.42 * size, 0.42 * size, 0, offsets=glint, facecolors=light, **common))
        else:
            colour, outlines = face_colours[run], [faces[k][1] for k in run]
            axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors=colour, linewidths=0.4))
        start = end
    axis.add_collection(LineCollection(sections, colors="#6b7280", linewidths=1.5))
    if items:
        radius = view.radius[shown, None]
        corners = np.concatenate([spots - radius, spots + radius, *(polygon for _, polygon in faces), *sections])
        low, high = corners.min(axis=0), corners.max(axis=0)
        pad = 0.03 * float(np.max(high - low))
        axis.set_xlim(low[0] - pad, high[0] + pad)
        axis.set_ylim(low[1] - pad, high[1] + pad)
    axis.set_aspect("equal")
    axis.tick_params(labelsize=7)
    axis.set_yticks([])
    for side in ("top", "left", "right"):
        axis.spines[side].set_visible(False)


def _tool_faces(view: View, tools: list[ToolModel], cut: float):
    """Depth and outline of every tool face behind the cut, and their colours, shape (n, 3)."""
    faces, colours = [], []
    for position, turn, model in zip(view.tool_position, view.tool_orientation, tools, strict=True):
        mesh = model.mesh.subdivide_to_size(0.25 * float(np.max(model.mesh.extents)))
        corners = position + rotation.rotate(turn, np.asarray(mesh.vertices))[np.asarray(mesh.faces)]
        normals = rotation.rotate(turn, np.asarray(mesh.face_normals))
        behind = corners[:, :, 1].mean(axis=1) > cut
        outlines, depths = _project(corners[behind])
        bright = 0.55 + 0.45 * np.abs(normals[behind] @ (_LIGHT / np.linalg.norm(_LIGHT)))
        faces += [(float(d.mean()), outline) for d, outline in zip(depths, outlines, strict=True)]
        colours.append(_STEEL * bright[:, None])
    return faces, np.concatenate(colours) if colours else np.zeros((0, 3))
