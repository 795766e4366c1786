"""How Rerun lays out what is drawn of a world: which views and curves, in which colours, and from where the bed is seen."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from sand_sim.border import Observation
from sand_sim.scene.types import Scene
from sand_sim.sinks.colours import fastest_shown

_EYE = np.array([0.45, -1.0, 0.55])  # from where the eye looks at the middle of the sand: from the right, ahead and above
_AWAY = 1.5  # of the diagonal of what is to be seen
_STANDING = ("cylinder", "cone")  # boundaries that begin at a point of theirs, which a plane has anywhere
_RED, _GREEN, _BLUE, _GREY, _ORANGE = [220, 70, 60], [80, 170, 80], [70, 120, 230], [150, 150, 150], [235, 150, 50]
_AXES = {"x": _RED, "y": _GREEN, "z": _BLUE}  # as Rerun and RViz colour axes
_ENERGIES = {"kinetic": _ORANGE, "elastic": _BLUE, "dissipated": _GREY}


def make_blueprint(scene: Scene, plungers: list[str], first: Observation, timeline: str) -> rrb.Blueprint:
    """The bed and the tools large on the left, the curves stacked on the right.

    Args:
        scene: tools and how fast they are.
        plungers: names of walls whose force is drawn.
        first: what is seen at the start, which the eye looks at.
        timeline: that is shown.
    """
    fastest = fastest_shown(scene)
    bed = rrb.Spatial3DView(
        origin="world",
        name=f"bed and tools, grains from sand (at rest) to dark red ({fastest:g} m/s)",
        eye_controls=_eye(scene, first),
    )
    curves = []
    for name in (tool.name for tool in scene.tools):
        force = rrb.TimeSeriesView(origin=f"force/{name}", name=f"{name}: force of the sand, world frame [N]")
        torque = rrb.TimeSeriesView(origin=f"torque/{name}", name=f"{name}: torque, tool frame [N m]")
        curves.append(rrb.Tabs(force, torque))
    curves += [rrb.TimeSeriesView(origin="carried", name="carried mass [kg]")] if scene.tools else []
    if plungers:
        contents = [f"+ /force/{name}" for name in plungers]
        curves.append(rrb.TimeSeriesView(origin="force", contents=contents, name="force on plungers [N]"))
    curves += [
        rrb.TimeSeriesView(origin="health/energy", name="energy [J]"),
        rrb.TimeSeriesView(origin="health/overlap", name="largest overlap so far / radius"),
    ]
    views = rrb.Horizontal(bed, rrb.Vertical(*curves), column_shares=[3, 2])
    return rrb.Blueprint(views, rrb.TimePanel(timeline=timeline, state="collapsed"), collapse_panels=True)


def series_styles(scene: Scene, plungers: list[str]) -> dict[str, rr.SeriesLines]:
    """Names and colours of the curves, by entity: Rerun's own colours are too alike to tell curves of one view apart."""
    styles = {f"health/energy/{name}": rr.SeriesLines(names=name, colors=colour) for name, colour in _ENERGIES.items()}
    for tool in scene.tools:
        for kind in ("force", "torque"):
            styles |= {f"{kind}/{tool.name}/{name}": rr.SeriesLines(names=name, colors=colour) for name, colour in _AXES.items()}
        styles[f"carried/{tool.name}"] = rr.SeriesLines(names=tool.name)
    return styles | {f"force/{name}": rr.SeriesLines(names=name) for name in plungers}


def _eye(scene: Scene, first: Observation) -> rrb.EyeControls3D | None:
    """An eye that has the grains in view, where tools are sent and where sand may come to lie, however high walls are."""
    grains, radius = first.spheres.position, first.spheres.radius[:, None]
    stops = [stop.pose.position for tool in scene.tools for stop in tool.trajectory] + [tool.position for tool in first.tools]
    feet = [boundary.point for boundary in scene.boundaries if boundary.kind in _STANDING]
    feet += [
        (*end[:2], boundary.low[2])
        for boundary in scene.boundaries
        if boundary.low is not None
        for end in (boundary.low, boundary.high)
    ]
    places = np.concatenate([grains - radius, grains + radius, np.reshape([*stops, *feet], (-1, 3))])
    if not len(places):
        return None
    low, high = places.min(axis=0), places.max(axis=0)
    middle, away = 0.5 * (low + high), _AWAY * np.linalg.norm(high - low)
    return rrb.EyeControls3D(position=middle + away * _EYE / np.linalg.norm(_EYE), look_target=middle, eye_up=[0.0, 0.0, 1.0])
