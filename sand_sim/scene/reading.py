"""From a scene file (YAML) to a checked ``Scene``."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from sand_sim.contact.cohesion import bridge_share
from sand_sim.contact.law import ASKS
from sand_sim.contact.model import SLOTS, ContactModel
from sand_sim.integrator import INTEGRATORS, VERLET
from sand_sim.precision import PRECISIONS
from sand_sim.scene.checking import check_scene
from sand_sim.scene.fields import Field
from sand_sim.scene.reading_bodies import read_body
from sand_sim.scene.reading_boundaries import FASTEST, read_boundary, read_corners
from sand_sim.scene.reading_fills import read_fill
from sand_sim.scene.reading_poses import read_pose
from sand_sim.scene.reading_trajectory import read_trajectory
from sand_sim.scene.types import (
    ROUGH,
    SHEETS,
    SMOOTH,
    Liquid,
    Material,
    PairRule,
    Pose,
    Scene,
    SceneError,
    Settle,
    Solver,
    Tool,
)

_TOOL_FIELDS = ("mesh", "urdf", "link", "material", "particle_radius", "particle_spacing", "contact", "scale", "thickness")
_TOOL_FIELDS += ("sheets", "pose", "max_speed", "trajectory")


class _Loader(yaml.SafeLoader):
    """Refuses a key that is there twice, of which the last would win in silence."""

    def compose_mapping_node(self, anchor):
        node, seen = super().compose_mapping_node(anchor), set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.MarkedYAMLError(problem=f"'{key.value}' is there twice", problem_mark=key.start_mark)
                seen.add(key.value)
        return node


def load_scene(path: str | Path, change: Callable[[Any], Any] = lambda parsed: parsed) -> Scene:
    """Read and check a scene file.

    Args:
        path: YAML file; relative paths in it start at its folder.
        change: applied to its content before it is checked.

    Raises:
        SceneError: if the file cannot be read or a field is wrong; the message names the field and how to mend it.
    """
    path = Path(path)
    parsed = parse_scene(path)
    try:
        return read_scene(change(parsed), path.resolve().parent, path.stem)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def parse_scene(path: Path) -> Any:
    """The content of a scene file, as YAML gives it.

    Raises:
        SceneError: if it cannot be read.
    """
    try:
        return yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, ValueError, AttributeError, RecursionError) as error:  # of dates, long numbers, deep nests, too
        told = " ".join(str(error).split()).replace('in "<unicode string>", ', "in ")  # the file is named before it
        raise SceneError(f"{path}: is not valid YAML: {told}") from None


def read_scene(parsed: dict, folder: Path, name: str = "scene") -> Scene:
    """Turn the content of a scene file into a checked ``Scene``.

    Args:
        parsed: mapping as YAML gives it.
        folder: where relative paths start.
        name: of the scene, and so of the files of its runs, where ``parsed`` has none.

    Raises:
        SceneError: if a field is wrong.
    """
    top = Field(parsed).keys(
        (
            "name",
            "gravity",
            "domain",
            "materials",
            "pairs",
            "fills",
            "boundaries",
            "tools",
            "bodies",
            "contact",
            "liquid",
            "solver",
            "settle",
            "duration",
            "frame_rate",
        ),
        required=("materials", "pairs"),
    )
    tools = tuple(_tool(name, entry) for name, entry in top["tools"].items()) if "tools" in top else ()
    last = max((waypoint.time for tool in tools for waypoint in tool.trajectory), default=0.0)
    scene = Scene(
        name=top.optional("name", _file_name, name),
        gravity=top.optional("gravity", Field.vector, (0.0, 0.0, -9.81)),
        domain=top.optional("domain", read_corners, None),
        materials=tuple(_material(name, entry) for name, entry in top["materials"].items()),
        pairs=tuple(_pair(entry) for entry in top["pairs"].entries()),
        fills=tuple(read_fill(entry, folder) for entry in top["fills"].entries()) if "fills" in top else (),
        boundaries=tuple(read_boundary(entry, folder) for entry in top["boundaries"].entries()) if "boundaries" in top else (),
        tools=tools,
        bodies=tuple(read_body(name, entry, folder) for name, entry in top["bodies"].items()) if "bodies" in top else (),
        contact=top.optional("contact", _contact, ContactModel()),
        liquid=top.optional("liquid", _liquid, None),
        solver=top.optional("solver", _solver, Solver()),
        settle=top.optional("settle", _settle, Settle()),
        duration=top.optional("duration", lambda f: f.number(above=0.0, unit="s"), last or 1.0),
        frame_rate=top.optional("frame_rate", lambda f: f.number(above=0.0, most=1e6, unit="1/s"), 50.0),
        folder=folder,
    )
    check_scene(scene)
    return scene


def _file_name(entry: Field) -> str:
    name = entry.text()
    if "/" in name or name.startswith(".") or not name.isprintable():
        raise entry.refuse(f"becomes the name of files: without '/' and not beginning with '.', got {name!r}")
    return name


def _material(name: str, entry: Field) -> Material:
    entry.keys(("density", "young", "poisson"), required=("density", "young", "poisson"))
    return Material(
        name,
        density=entry["density"].number(above=0.0, unit="kg/m^3"),
        young=entry["young"].number(above=0.0, unit="Pa"),
        poisson=entry["poisson"].number(least=0.0, most=0.5),
    )


def _pair(entry: Field) -> PairRule:
    entry.keys(("between", *ASKS), required=("between",))
    names = entry["between"].entries()
    if len(names) != 2:
        raise entry["between"].refuse("must name two materials")
    return PairRule(
        between=(names[0].text(), names[1].text()),
        numbers={
            name: entry[name].number(ask.above, ask.least, ask.most, ask.unit) for name, ask in ASKS.items() if name in entry
        },
    )


def _tool(name: str, entry: Field) -> Tool:
    entry.keys(_TOOL_FIELDS, required=("material", "particle_radius"))
    if ("mesh" in entry) == ("link" in entry):
        raise entry.refuse(
            "give exactly one of 'mesh' and 'link'; a 'link' is one of the URDF file 'urdf', or of the node's robot"
        )
    if "mesh" in entry and "urdf" in entry:
        raise entry["urdf"].refuse("needs a 'link' instead of a 'mesh'")
    if "link" in entry and "scale" in entry:
        raise entry["scale"].refuse("a URDF is in metres and scales its meshes itself; leave it out")
    if not (name.isidentifier() and name.isascii()):
        raise entry.refuse("a tool's name becomes part of its topics: letters of ASCII, digits and underscores only")
    pose = entry.optional("pose", read_pose, None)
    track = read_trajectory(entry["trajectory"], pose or Pose()) if "trajectory" in entry else []
    return Tool(
        name,
        mesh=entry.optional("mesh", Field.text, ""),
        urdf=entry.optional("urdf", Field.text, ""),
        link=entry.optional("link", Field.text, ""),
        material=entry["material"].text(),
        particle_radius=entry["particle_radius"].number(above=0.0, unit="m"),
        particle_spacing=entry.optional("particle_spacing", lambda f: f.number(above=0.0, unit="m"), None),
        contact=entry.optional("contact", lambda f: f.choice((ROUGH, SMOOTH)), Tool.contact),
        scale=entry.optional("scale", lambda f: f.number(above=0.0), 1.0),
        thickness=entry.optional("thickness", lambda f: f.number(above=0.0, unit="m"), None),
        sheets=entry.optional("sheets", lambda f: f.choice(SHEETS), Tool.sheets),
        pose=pose or (track[0].pose if track else Pose()),
        max_speed=entry.optional("max_speed", lambda f: f.number(above=0.0, most=FASTEST, unit="m/s"), 2.0),
        trajectory=tuple(track),
    )


def _contact(entry: Field) -> ContactModel:
    entry.keys(SLOTS)
    return ContactModel(**{slot: entry[slot].choice(laws) for slot, laws in SLOTS.items() if slot in entry})


def _liquid(entry: Field) -> Liquid:
    entry.keys(("saturation", "bridge_volume", "surface_tension", "contact_angle"))
    if ("saturation" in entry) == ("bridge_volume" in entry):
        raise entry.refuse("give exactly one of 'saturation' of the pores and 'bridge_volume' over the cube of a radius")
    most = 0.3  # the pendular regime, where liquid sits in single bridges
    whole = 4.0 / 3.0 * math.pi * bridge_share(1.0)  # bridge over the cube of a radius in sand that is full
    saturation = (
        entry["saturation"].number(above=0.0, most=most)
        if "saturation" in entry
        else entry["bridge_volume"].number(above=0.0, most=most * whole) / whole
    )
    return Liquid(
        saturation=saturation,
        surface_tension=entry.optional("surface_tension", lambda f: f.number(above=0.0, unit="N/m"), 0.072),
        contact_angle=entry.optional("contact_angle", lambda f: f.number(least=0.0, most=0.9, unit="rad"), 0.0),
    )


def _auto(entry: Field, key: str, read: Callable) -> Any:
    """What is read of an entry, None if it is not there or left to the program."""
    return None if entry.value.get(key) == "auto" else entry.optional(key, read, None)


def _solver(entry: Field) -> Solver:
    entry.keys(("time_step", "force_time_step", "skin", "integrator", "precision", "device", "threads"))

    forced = entry.optional("force_time_step", Field.yes_or_no, False)
    if forced and entry.value.get("time_step") in (None, "auto"):
        raise entry["force_time_step"].refuse("needs a 'time_step' of its own")
    return Solver(
        time_step=_auto(entry, "time_step", lambda f: f.number(above=0.0, unit="s")),
        skin=_auto(entry, "skin", lambda f: f.number(above=0.0, unit="m")),
        integrator=entry.optional("integrator", lambda f: f.choice(INTEGRATORS), VERLET),
        precision=entry.optional("precision", lambda f: f.choice(PRECISIONS), "single"),
        device=entry.optional("device", Field.text, "auto"),
        threads=_auto(entry, "threads", lambda f: f.whole(1, 4096)),
        force_time_step=forced,
    )


def _settle(entry: Field) -> Settle:
    entry.keys(("time", "speed", "fall"))
    return Settle(
        fall=_auto(entry, "fall", lambda f: math.inf if f.value == "free" else f.number(above=0.0, unit="m/s")),
        time=entry.optional("time", lambda f: f.number(least=0.0, unit="s"), 0.0),
        speed=entry.optional("speed", lambda f: f.number(above=0.0, unit="m/s"), 0.01),
    )
