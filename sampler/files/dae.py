"""DAE files as pycollada reads them: nothing but geometry, and nothing of that which it would pass over in silence."""

import re
from xml.etree import ElementTree

import numpy as np

from sampler.errors import MeshError
from sampler.files.polygons import are_hollow, cut_polygons

_LIBRARIES = rb"library_(?:effects|materials|images|animations|controllers|lights|cameras)"
_NEEDLESS = re.compile(
    rb"<!--.*?-->|<(bind_material|" + _LIBRARIES + rb"|instance_(?:light|camera)|lines|linestrips)\b[^>]*?(?:/>|>.*?</\1>)",
    re.DOTALL,
)
_SPACELESS = re.compile(rb"<COLLADA(?![^>]*\bxmlns\s*=)")
_SPACE = b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"'
_OTHER_INPUT = re.compile(rb"(<input\b[^>]*?\bsemantic\s*=\s*[\"'])(?!POSITION\b|VERTEX\b)\w+")


def plain_dae(name: str, data: bytes) -> bytes:
    """A DAE file without materials, lights and the like, whose faults would cost the triangles that have to do with them.

    Raises:
        MeshError: if it holds what pycollada leaves out or takes for something else, with the reason.
    """
    # Normals and colours keep their place among the indices; nobody looks at tangents.
    data = _NEEDLESS.sub(lambda found: b"\n" * found.group().count(b"\n"), data)  # errors tell the number of the line
    data = _OTHER_INPUT.sub(rb"\1TANGENT", data)
    data = _SPACELESS.sub(_SPACE, data, count=1)  # pycollada finds nothing in a file that does not say so
    root = ElementTree.fromstring(data)
    if not root.tag.endswith("COLLADA"):
        raise MeshError(f"mesh {name}: is no DAE file but begins with <{root.tag}>")
    if root.find("{*}scene/{*}instance_visual_scene") is None:
        raise MeshError(f"mesh {name}: names no scene, so that none of its geometry has a place; export it again")
    for left_out in ("instance_controller", "skew", "ph"):
        if root.find(f".//{{*}}{left_out}") is not None:
            raise MeshError(f"mesh {name}: has <{left_out}>, which cannot be read; bake it into plain triangles and export again")
    _check_unit(name, root)
    _check_positions(name, root)
    _check_indices(name, root)
    return ElementTree.tostring(root) if _cut_hollow_polygons(root) else data


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
        accessor = sources[key].find("{*}technique_common/{*}accessor")
        if accessor is not None and (accessor.get("stride", "3"), accessor.get("offset", "0")) != ("3", "0"):
            raise MeshError(f"mesh {name}: has something between its coordinates, which cannot be read; export it again")
        try:
            finite = np.all(np.isfinite(np.array(words, np.float32)))
        except ValueError as error:
            raise MeshError(f"mesh {name}: is damaged: {error} in its coordinates; export it again") from None
        if not finite:
            raise MeshError(f"mesh {name}: has vertices that are not finite; export it again")


def _check_indices(name: str, root: ElementTree.Element) -> None:
    """Indices that are too large are refused by pycollada; those below zero would count from the end, lost ones not be missed."""
    for primitive in root.iterfind(".//{*}input[@semantic='VERTEX']/.."):
        offset = int(primitive.find("{*}input[@semantic='VERTEX']").get("offset", 0))
        stride = 1 + max(int(other.get("offset", 0)) for other in primitive.iterfind("{*}input"))
        texts = [indices.text or "" for indices in primitive.iterfind("{*}p")]
        for text in texts:
            if "-" in text and "-" in "".join(text.split()[offset::stride]):
                raise MeshError(f"mesh {name}: is damaged: a triangle has a vertex numbered below zero; export it again")
        if primitive.tag.endswith("}triangles") and "count" in primitive.attrib:
            promised, held = int(primitive.get("count")), sum(len(text.split()) for text in texts) / (3 * stride)
            if promised != held:
                raise MeshError(f"mesh {name}: is damaged: it promises {promised} triangles and holds {held:g}; export it again")
        if primitive.tag.endswith("}polylist"):
            sizes = [int(size) for counts in primitive.iterfind("{*}vcount") for size in (counts.text or "").split()]
            corners, held = sum(sizes), sum(len(text.split()) for text in texts) / stride
            if corners != held:
                reason = f"its polygons have {corners} corners, it holds {held:g}"
                raise MeshError(f"mesh {name}: is damaged: {reason}; export it again")


def _cut_hollow_polygons(root: ElementTree.Element) -> bool:
    """Put triangles in place of polygons where any is not convex; pycollada cuts them like a fan, over their edge and back.

    Returns:
        Whether there were any.
    """
    space = root.tag.removesuffix("COLLADA")
    keyed = {element.get("id"): element for element in root.iterfind(".//*[@id]")}
    found = False
    for primitive in [*root.iterfind(".//{*}polylist"), *root.iterfind(".//{*}polygons")]:
        inputs, counts, indices = (primitive.findall(f"{{*}}{tag}") for tag in ("input", "vcount", "p"))
        stride = 1 + max((int(one.get("offset", 0)) for one in inputs), default=0)
        words = [(one.text or "").split() for one in indices]
        sizes = (
            [int(size) for one in counts for size in (one.text or "").split()] if counts else [len(p) // stride for p in words]
        )
        rows = [word for one in words for word in one]
        vertex = next((one for one in inputs if one.get("semantic") == "VERTEX"), None)
        if max(sizes, default=0) < 4 or sum(sizes) * stride != len(rows) or vertex is None:  # pycollada tells what is wrong
            continue
        rows, sizes = np.array(rows, np.int64).reshape(-1, stride), np.array(sizes, np.int64)
        source = keyed[vertex.get("source")[1:]].find("{*}input[@semantic='POSITION']").get("source")
        points = np.array(keyed[source[1:]].find("{*}float_array").text.split(), float).reshape(-1, 3)
        corners = rows[:, int(vertex.get("offset", 0))]
        if corners.max() < len(points) and are_hollow(points[corners], sizes).any():
            triangles = cut_polygons(points[corners], sizes)
            for one in [*counts, *indices]:
                primitive.remove(one)
            primitive.tag, primitive.attrib["count"] = f"{space}triangles", str(len(triangles))
            ElementTree.SubElement(primitive, f"{space}p").text = " ".join(map(str, rows[triangles].ravel()))
            found = True
    return found
