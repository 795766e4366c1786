"""Reading the boundaries of a scene file."""

from math import inf, pi, tan
from pathlib import Path

from sand_sim.scene.fields import Field
from sand_sim.scene.reading_poses import read_pose
from sand_sim.scene.types import ROUGH, SHEETS, SMOOTH, Boundary, Drive, Rough, Terrain, Vector

_SIDES = ("left", "right", "front", "back", "bottom", "top")
_LATTICES = ("triangular", "square")
_INSIDE, _OUTSIDE = "inside", "outside"
_COMMON = ("type", "material", "name")
_NEEDED = {
    "plane": ("point", "normal"),
    "box": ("low", "high"),
    "bin": ("low", "high"),
    "cylinder": ("point", "axis", "radius"),
    "cone": ("point", "axis", "hole_radius", "radius"),
    "hole_plate": ("point", "normal", "hole_radius", "radius"),
    "plunger": ("point", "normal"),
    "terrain": ("particle_radius",),
}
_OPTIONAL = {
    "plane": ("rough",),
    "box": ("open", "rough"),
    "bin": ("open",),
    "cylinder": ("height", "rough", "grains"),
    "cone": ("height", "angle", "rough", "grains"),
    "hole_plate": ("rough",),
    "plunger": ("radius", "velocity", "force", "mass", "max_speed", "travel", "rough"),
    "terrain": ("mesh", "heights", "spacing", "contact", "scale", "thickness", "sheets", "pose"),
}
FASTEST = 1e4  # [m/s] of plungers and tools: faster ones leave no time step
_HEIGHT_FILES = (".npz", ".csv", ".png")


def read_boundary(entry: Field, folder: Path) -> Boundary:
    """One boundary.

    Args:
        entry: mapping with the fields of its type.
        folder: where relative paths start.

    Raises:
        SceneError: naming the field and how to mend it.
    """
    anything = {key for fields in (*_NEEDED.values(), *_OPTIONAL.values()) for key in fields}
    typed = isinstance(entry.value, dict) and "type" in entry.value  # which decides what else is known
    kind = entry.keys(entry.value if typed else (*_COMMON, *sorted(anything)), ("type", "material"))["type"].choice(_NEEDED)
    entry.keys((*_COMMON, *_NEEDED[kind], *_OPTIONAL[kind]), _NEEDED[kind])
    common = {
        "kind": kind,
        "material": entry["material"].text(),
        "name": entry.optional("name", Field.text, kind),
        "rough": entry.optional("rough", _rough, None),
    }
    if kind == "terrain":
        return Boundary(**common, terrain=_terrain(entry, folder))
    if kind in ("box", "bin"):
        low, high = read_corners(Field({"low": entry.value["low"], "high": entry.value["high"]}, entry.path))
        usual = ("top",) if kind == "bin" else ()
        sides = tuple(side.choice(_SIDES) for side in entry["open"].entries()) if "open" in entry else usual
        return Boundary(**common, low=low, high=high, open_sides=sides)
    common["point"] = entry["point"].vector()
    common["direction"] = entry["axis" if "axis" in entry else "normal"].direction()
    common["radius"] = entry.optional("radius", _length, 0.0)
    if kind == "plunger":
        return Boundary(**common, drive=_drive(entry))
    if kind == "cylinder":
        common["height"] = entry.optional("height", _length, 0.0)
    if kind in ("cone", "hole_plate"):
        common["hole_radius"] = entry["hole_radius"].number(least=0.0, unit="m")
        if common["hole_radius"] >= common["radius"]:
            raise entry["hole_radius"].refuse(f"must be less than 'radius', {common['radius']:g} m")
    if kind == "cone":
        common["height"] = _cone_height(entry, common["radius"] - common["hole_radius"])
    if "grains" in entry:
        common["around"] = entry["grains"].choice((_INSIDE, _OUTSIDE)) == _OUTSIDE
        if common["around"] and not common["height"]:
            raise entry["grains"].refuse("'outside' needs a 'height' [m]; a cylinder without end has grains inside only")
    return Boundary(**common)


def read_corners(entry: Field) -> tuple[Vector, Vector]:
    """Lower and upper corner of a box [m]."""
    entry.keys(("low", "high"), required=("low", "high"))
    low, high = entry["low"].vector(), entry["high"].vector()
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise entry.refuse(f"'low' {list(low)} must lie below 'high' {list(high)} on every axis [m]")
    return low, high


def _length(entry: Field) -> float:
    return entry.number(above=0.0, unit="m")


def _cone_height(entry: Field, widening: float) -> float:
    if ("height" in entry) == ("angle" in entry):
        raise entry.refuse("give exactly one of 'height' [m] and 'angle' [rad], which is that between the axis and the wall")
    if "height" in entry:
        return _length(entry["height"])
    angle = entry["angle"].number(above=0.0, unit="rad")
    if angle >= 0.5 * pi - 1e-3:
        raise entry["angle"].refuse(f"must be less than pi/2 [rad], got {angle:g}; a flat one is a 'hole_plate'")
    return widening / tan(angle)


def _rough(entry: Field) -> Rough:
    entry.keys(("radius", "spacing", "lattice"), required=("radius",))
    radius = _length(entry["radius"])
    return Rough(
        radius,
        spacing=entry.optional("spacing", _length, 2.0 * radius),
        lattice=entry.optional("lattice", lambda f: f.choice(_LATTICES), "triangular"),
    )


def _drive(entry: Field) -> Drive:
    if ("velocity" in entry) == ("force" in entry):
        raise entry.refuse("give exactly one of 'velocity' [m/s] and 'force' [N], both along the normal")
    travel = entry.optional("travel", _length, inf)
    if "velocity" in entry:
        for name in ("mass", "max_speed"):
            if name in entry:
                raise entry[name].refuse("goes with 'force'; a plunger with a 'velocity' keeps it whatever the grains do")
        return Drive(velocity=entry["velocity"].number(least=-FASTEST, most=FASTEST, unit="m/s"), travel=travel)
    if "max_speed" not in entry:
        raise entry.refuse("the field 'max_speed' [m/s] is missing; it limits how fast 'force' may move the plunger")
    return Drive(
        force=entry["force"].number(unit="N"),
        mass=entry.optional("mass", lambda f: f.number(above=0.0, unit="kg"), None),
        max_speed=entry["max_speed"].number(above=0.0, most=FASTEST, unit="m/s"),
        travel=travel,
    )


def _terrain(entry: Field, folder: Path) -> Terrain:
    if ("mesh" in entry) == ("heights" in entry):
        raise entry.refuse("give exactly one of 'mesh' and 'heights', the file that the ground comes from")
    common = {
        "particle_radius": _length(entry["particle_radius"]),
        "contact": entry.optional("contact", lambda f: f.choice((ROUGH, SMOOTH)), Terrain.contact),
        "scale": entry.optional("scale", lambda f: f.number(above=0.0), 1.0),
        "pose": entry.optional("pose", read_pose, Terrain.pose),
    }
    if "mesh" in entry:
        if "spacing" in entry:
            raise entry["spacing"].refuse("goes with 'heights', it is that of their grid")
        common["thickness"] = entry.optional("thickness", _length, None)
        common["sheets"] = entry.optional("sheets", lambda f: f.choice(SHEETS), Terrain.sheets)
        return Terrain(mesh=entry["mesh"].text(), **common)
    for field in ("thickness", "sheets"):
        if field in entry:
            raise entry[field].refuse("goes with 'mesh'; ground made of heights is solid below")
    if "spacing" not in entry:
        raise entry.refuse("the field 'spacing' [m], of the grid of heights, is missing")
    path = entry["heights"].file(folder)
    if path.suffix.lower() not in _HEIGHT_FILES:
        raise entry["heights"].refuse(f"must be a file of type {', '.join(_HEIGHT_FILES)}, got '{path.name}'")
    return Terrain(heights=path, spacing=_length(entry["spacing"]), **common)
