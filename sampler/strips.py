"""PLY files whose faces are triangle strips, as the Stanford scans have them; trimesh does not read these."""

from pathlib import Path

import numpy as np
import trimesh

from sampler.errors import MeshError

PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
PLY_TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
PLY_TYPES |= {"float32": "f4", "float64": "f8"}


def read_strips(path: Path) -> trimesh.Trimesh | None:
    """Read a PLY file with an element ``tristrips``.

    Returns:
        Its triangles, or None where the file has no strips.

    Raises:
        MeshError: if its elements are not vertices of plain properties followed by strips of one list.
    """
    head, _, body = path.read_bytes().partition(b"end_header")
    body = body[body.index(b"\n") + 1 :] if b"\n" in body[:2] else body
    lines = [line.split() for line in head.decode("latin-1").splitlines()]
    elements = {}
    for line in lines:
        if line[:1] == ["element"]:
            elements[line[1]] = (int(line[2]), properties := [])
        elif line[:1] == ["property"]:
            properties.append(line[1:])
    if "tristrips" not in elements:
        return None
    if list(elements)[:2] != ["vertex", "tristrips"] or any(p[0] == "list" for p in elements["vertex"][1]):
        raise MeshError(f"mesh {path.name}: strips must follow the vertices in a PLY file; convert it to triangles")
    kind = next(line[1] for line in lines if line[:1] == ["format"])
    read = _read_ascii if kind == "ascii" else _read_binary
    vertices, strips = read(body, *elements["vertex"], *elements["tristrips"], "<" if "little" in kind else ">")
    return trimesh.Trimesh(vertices, strip_triangles(strips), process=False)


def strip_triangles(strip: np.ndarray) -> np.ndarray:
    """Triangles of a strip of vertex numbers in which -1 begins a new strip, shape (n, 3); every second one is turned."""
    index = np.arange(len(strip))
    begin = np.maximum.accumulate(np.where(strip == -1, index + 1, 0))
    corner = index[(index - begin >= 2) & (strip != -1)]
    odd = (corner - begin[corner]) % 2 == 1
    faces = np.stack([strip[corner - 2], strip[corner - 1], strip[corner]], axis=1)
    faces[odd] = faces[odd][:, [1, 0, 2]]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return faces[distinct]


def _read_ascii(body, number, properties, strips, strip_properties, order):
    words = body.split()
    width = len(properties)
    names = [p[1] for p in properties]
    table = np.array(words[: number * width], float).reshape(number, width)
    at, joined = number * width, []
    for _ in range(strips):
        length = int(words[at])
        joined += [*map(int, words[at + 1 : at + 1 + length]), -1]
        at += length + 1
    return table[:, [names.index(axis) for axis in "xyz"]], np.array(joined)


def _read_binary(body, number, properties, strips, strip_properties, order):
    row = np.dtype([(name, order + PLY_TYPES[kind]) for kind, name in properties])
    table = np.frombuffer(body, row, number)
    _, length_type, item_type, _ = strip_properties[0]
    length_type, item_type = np.dtype(order + PLY_TYPES[length_type]), np.dtype(order + PLY_TYPES[item_type])
    at, joined = number * row.itemsize, []
    for _ in range(strips):
        length = int(np.frombuffer(body, length_type, 1, at)[0])
        at += length_type.itemsize
        joined += [np.frombuffer(body, item_type, length, at).astype(np.int64), [-1]]
        at += length * item_type.itemsize
    return np.stack([table[axis].astype(float) for axis in "xyz"], axis=1), np.concatenate(joined)
