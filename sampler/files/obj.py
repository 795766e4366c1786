"""OBJ files as trimesh reads them: an element a line, its keyword first, vertices counted from the beginning, convex polygons."""

import re

import numpy as np

from sampler.errors import MeshError
from sampler.files.polygons import are_hollow
from sampler.geometry.loops import span_loops

_MARK = b"\xef\xbb\xbf"  # of UTF-8, which some editors put first
_BESIDE = re.compile(rb"(?<=\d)/\S*")
_POLYGON = re.compile(rb"\nf((?: +\d\S*){4,}) *\r?(?=\n)")
_VERTEX = re.compile(rb"\nv +(\S+) +(\S+) +(\S+)")
_ODD = re.compile(rb"\n(?: +[vf]|f[^\n-]*-)")  # indented, counted backwards


def bare_obj(name: str, data: bytes) -> bytes:
    """Write an OBJ file plainly and without textures and normals.

    Nobody looks at them, and trimesh takes one for a vertex where not all corners of a face have as many.

    Args:
        name: of the file.
        data: what it holds.

    Raises:
        MeshError: if it is binary, cut off within a vertex, or has a face that makes no sense.
    """
    if b"\0" in data:
        raise MeshError(f"mesh {name}: is no OBJ file but binary; give it the ending of its format, as .stl")
    data = _plain(data)
    _check(name, data)
    return _BESIDE.sub(b"", data)


def _plain(data: bytes) -> bytes:
    """Write the vertices and faces of an OBJ file anew where trimesh would not read them, or read others than are meant.

    Indices below zero count back from their line; trimesh counts them back from the end of the file.

    Returns:
        The data with a line break before and after it, so that every line follows one and ends with one.
    """
    data = b"\n" + data.removeprefix(_MARK) + b"\n"
    continued = b"\\\n" in data or b"\\\r" in data
    broken = b"\r" in data and data.count(b"\r") != data.count(b"\r\n")
    remarks = any(data[data.rfind(b"\n", 0, found.start()) + 1] in b"vf" for found in re.finditer(rb"#[^\n]*", data))
    if not (continued or broken or remarks or b"\t" in data or _ODD.search(data)):
        return _without_hollow_polygons(data)
    data = re.sub(rb"#[^\r\n]*", b"", data)
    lines, vertices = [b""], 0
    for line in re.sub(rb"\\(?:\r\n?|\n)", b" ", data).splitlines():
        keyword, *words = line.split() or [b""]
        if keyword == b"v":
            vertices += 1
        elif keyword == b"f":
            words = [_counted_forwards(word.split(b"/")[0], vertices) for word in words]
        else:
            continue
        lines.append(b" ".join([keyword, *words]))
    return _without_hollow_polygons(b"\n".join([*lines, b""]))


def _check(name: str, data: bytes) -> None:
    """Readers drop faces they do not understand; a body with faces dropped would be wrong in silence."""
    vertices = data.count(b"\nv ")
    for match in re.finditer(rb"\nf(?![^ \r\n])([^\r\n]*)", data):
        corners = match.group(1).split()
        try:
            indices = [int(corner.split(b"/")[0]) for corner in corners]
        except ValueError:
            indices = [0] * len(corners)
        if len(indices) < 3 or min(indices) < 1 or max(indices) > vertices:
            shown = match.group(0).decode(errors="replace").strip()
            reason = "has too few corners" if len(indices) < 3 else f"refers to a vertex that is not among the {vertices}"
            raise MeshError(f"mesh {name}: is corrupt: the face '{shown}' {reason}; export it again")
    last = data.rstrip().rsplit(b"\n", 1)[-1].split()
    if last and last[0] == b"v" and len(last) < 4:
        raise MeshError(f"mesh {name}: is cut off in the middle of its last vertex; copy or export it again")


def _without_hollow_polygons(data: bytes) -> bytes:
    """Cut polygons that are not convex into triangles of least area; trimesh cuts them like a fan, over their edge and back."""
    found = list(_POLYGON.finditer(data))
    if not found:
        return data
    words = [line.split() for line in re.sub(rb"/\S*", b"", b"\n".join(polygon.group(1) for polygon in found)).splitlines()]
    try:
        vertices = np.array(_VERTEX.findall(data)).reshape(-1, 3).astype(float)
        corners = np.array([word for polygon in words for word in polygon], bytes).astype(int) - 1
    except ValueError:  # refused later
        return data
    if np.any((corners < 0) | (corners >= len(vertices))):
        return data
    sizes = np.array([len(polygon) for polygon in words], int)
    begin = np.cumsum(sizes) - sizes
    hollow = are_hollow(vertices[corners], sizes)
    parts, done, hollow = [], 0, np.flatnonzero(hollow)
    cut = span_loops(vertices, [corners[begin[k] : begin[k] + sizes[k]] for k in hollow])
    for k, triangles in zip(hollow, cut, strict=True):
        parts += [data[done : found[k].start()], *(b"\nf %d %d %d" % tuple(triangle) for triangle in triangles + 1)]
        done = found[k].end()
    return b"".join([*parts, data[done:]])


def _counted_forwards(index: bytes, vertices: int) -> bytes:
    """The index of a vertex counted from the first one, as it is where it is no number or counts back too far."""
    back = index[1:]
    return b"%d" % (vertices + 1 - int(back)) if index[:1] == b"-" and back.isdigit() and 0 < int(back) <= vertices else index
