"""Free rigid bodies in a scene file."""

from pathlib import Path

from sand_sim.scene.fields import Field
from sand_sim.scene.reading_poses import read_pose
from sand_sim.scene.types import SHEETS, Body, Pose

_SKIN = "mesh", "particle_radius", "scale", "thickness", "sheets"
_FIELDS = ("material", *_SKIN, "spheres", "pose", "velocity", "spin", "mass", "inertia")


def read_body(name: str, entry: Field, folder: Path) -> Body:
    """A body from its entry.

    Args:
        name: its key.
        entry: its fields.
        folder: where relative paths start.

    Raises:
        SceneError: if a field is wrong.
    """
    entry.keys(_FIELDS, required=("material",))
    if ("mesh" in entry) == ("spheres" in entry):
        raise entry.refuse("give exactly one of 'mesh' and 'spheres'")
    if "mesh" in entry and "particle_radius" not in entry:
        raise entry.refuse("the field 'particle_radius' is needed: a mesh becomes a skin of particles of that radius [m]")
    if "inertia" in entry and "mass" not in entry:
        raise entry.refuse("the field 'mass' is needed beside 'inertia'")
    inertia = entry.optional("inertia", lambda f: tuple(value.number(above=0.0, unit="kg m^2") for value in f.entries()), None)
    if inertia is not None and (len(inertia) != 3 or 2.0 * max(inertia) > sum(inertia) * (1.0 + 1e-12)):
        raise entry["inertia"].refuse("must be three principal moments, none above the sum of the other two")
    return Body(
        name,
        material=entry["material"].text(),
        mesh=entry.optional("mesh", Field.text, None),
        particle_radius=entry.optional("particle_radius", lambda f: f.number(above=0.0, unit="m"), 0.0),
        scale=entry.optional("scale", lambda f: f.number(above=0.0), 1.0),
        thickness=entry.optional("thickness", lambda f: f.number(above=0.0, unit="m"), None),
        sheets=entry.optional("sheets", lambda f: f.choice(SHEETS), Body.sheets),
        spheres=entry.optional("spheres", lambda f: _spheres(f, folder), None),
        pose=entry.optional("pose", read_pose, Pose()),
        velocity=entry.optional("velocity", Field.vector, (0.0, 0.0, 0.0)),
        spin=entry.optional("spin", Field.vector, (0.0, 0.0, 0.0)),
        mass=entry.optional("mass", lambda f: f.number(above=0.0, unit="kg"), None),
        inertia=inertia,
    )


def _spheres(entry: Field, folder: Path) -> Path | tuple[tuple[float, ...], ...]:
    if isinstance(entry.value, str):
        return entry.file(folder)
    rows = tuple(row.vector(4) for row in entry.entries())
    if not rows or any(row[3] <= 0.0 for row in rows):
        raise entry.refuse("must be a file, or at least one row [x, y, z, radius] with a positive radius [m]")
    return rows
