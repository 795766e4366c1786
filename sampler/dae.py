"""DAE files as pycollada reads them: nothing but geometry, and nothing of that which it would pass over in silence."""

import re
from xml.etree import ElementTree

import numpy as np

from sampler.errors import MeshError

_LIBRARIES = rb"library_(?:effects|materials|images|animations|controllers|lights|cameras)"
_NEEDLESS = re.compile(
    rb"<!--.*?-->|<(bind_material|" + _LIBRARIES + rb"|instance_(?:light|camera)|lines|linestrips)\b[^>]*?(?:/>|>.*?</\1>)",
    re.DOTALL,
)
_OTHER_INPUT = re.compile(rb"(<input\b[^>]*?\bsemantic\s*=\s*[\"'])(?!POSITION\b|VERTEX\b)\w+")


def plain_dae(name: str, data: bytes) -> bytes:
    """A DAE file without materials, lights and the like, whose faults would cost the triangles that have to do with them.

    Raises:
        MeshError: if it holds what pycollada leaves out or takes for something else, with the reason.
    """
    # Normals and colours keep their place among the indices; nobody looks at tangents.
    data = _NEEDLESS.sub(lambda found: b"\n" * found.group().count(b"\n"), data)  # errors tell the number of the line
    data = _OTHER_INPUT.sub(rb"\1TANGENT", data)
    root = ElementTree.fromstring(data)
    if not root.tag.endswith("COLLADA"):
        raise MeshError(f"mesh {name}: is no DAE file but begins with <{root.tag}>")
    if root.find("{*}scene/{*}instance_visual_scene") is None:
        raise MeshError(f"mesh {name}: names no scene, so that none of its geometry has a place; export it again")
    for left_out in ("instance_controller", "skew"):
        if root.find(f".//{{*}}{left_out}") is not None:
            raise MeshError(f"mesh {name}: has <{left_out}>, which cannot be read; bake it into the vertices and export again")
    _check_unit(name, root)
    _check_positions(name, root)
    _check_indices(name, root)
    return data


def _check_unit(name: str, root: ElementTree.Element) -> None:
    """A unit that pycollada does not understand becomes the metre."""
    for unit in root.iterfind("{*}asset/{*}unit"):
        if not re.fullmatch(r"\s*\+?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*", metres := unit.get("meter", "1")):
            raise MeshError(f"mesh {name}: its unit is '{metres}' metres, which is no number; mend it in the file's <unit>")


def _check_positions(name: str, root: ElementTree.Element) -> None:
    """NaN would become 0, triangles at infinity would be dropped."""
    sources = {source.get("id"): source for source in root.iterfind(".//{*}source")}
    for key in {vertices.get("source", "")[1:] for vertices in root.iterfind(".//{*}input[@semantic='POSITION']")}:
        array = sources[key].find("{*}float_array") if key in sources else None
        if array is None:
            raise MeshError(f"mesh {name}: is damaged: it names the coordinates '{key}' and does not hold them; export it again")
        words = (array.text or "").split()
        promised, held = array.get("count", "").strip(), str(len(words))
        if promised not in ("", held):
            raise MeshError(f"mesh {name}: is damaged: it promises {promised} coordinates and holds {held}; export it again")
        try:
            finite = np.all(np.isfinite(np.array(words, np.float32)))
        except ValueError as error:
            raise MeshError(f"mesh {name}: is damaged: {error} in its coordinates; export it again") from None
        if not finite:
            raise MeshError(f"mesh {name}: has vertices that are not finite; export it again")


def _check_indices(name: str, root: ElementTree.Element) -> None:
    """Indices that are too large are refused by pycollada; those below zero would count from the end."""
    for primitive in root.iterfind(".//{*}input[@semantic='VERTEX']/.."):
        offset = int(primitive.find("{*}input[@semantic='VERTEX']").get("offset", 0))
        stride = 1 + max(int(other.get("offset", 0)) for other in primitive.iterfind("{*}input"))
        for text in [indices.text or "" for indices in primitive.iterfind("{*}p")]:
            if "-" in text and "-" in "".join(text.split()[offset::stride]):
                raise MeshError(f"mesh {name}: is damaged: a triangle has a vertex numbered below zero; export it again")
