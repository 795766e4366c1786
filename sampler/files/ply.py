"""PLY files, text and binary: polygons of any size, and triangle strips as the Stanford scans have them."""

from functools import cache

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.polygons import mesh_of

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
_TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES |= {"float32": "f4", "float64": "f8"}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")  # names in use
_SHOWN = 60  # letters of a line

Row = tuple[tuple[str, str, str | None], ...]  # of each property name, type and, for lists, type of their length


def read_ply(name: str, data: bytes) -> trimesh.Trimesh:
    """Read the vertices, faces and triangle strips of a PLY file.

    Args:
        name: of the file.
        data: what it holds.

    Raises:
        MeshError: if the file is cut off or corrupt, or has no faces.
    """
    head, found, body = data.partition(b"end_header")
    if not found:
        raise MeshError(f"mesh {name}: its PLY header has no end; the file is cut off or no PLY file")
    text, elements = _read_header(name, head)
    body = body[2 if body.startswith(b"\r\n") else 1 :]
    body = np.array(body.split(), float).tobytes() if text else body  # words become numbers of one size
    tables, at = {}, 0
    for element, number, row in elements:
        tables[element], at = _read_rows(name, body, at, number, row)
    vertices = tables.get("vertex", {})
    if not set("xyz") <= set(vertices):
        raise MeshError(f"mesh {name}: has no vertices")
    corners, sizes = _lists(tables.get("face", {}))
    strip, lengths = _lists(tables.get("tristrips", {}))
    triangles = strip_triangles(np.insert(strip, np.cumsum(lengths), -1))
    if not len(sizes) + len(triangles):
        raise MeshError(f"mesh {name}: holds points or lines only, no triangles")
    corners, sizes = np.append(corners, triangles), np.append(sizes, np.full(len(triangles), 3))
    return mesh_of(name, np.stack([vertices[axis].astype(float) for axis in "xyz"], axis=1), corners, sizes)


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


def _read_header(name: str, head: bytes) -> tuple[bool, list[tuple[str, int, Row]]]:
    """Whether the body is text, and the name, number of rows and properties of each element."""
    text, order, elements = False, "<", []
    for line in head.decode("latin-1").splitlines():
        match line.split():
            case ["format", kind, *_] if kind in _ORDERS:
                text, order = kind == "ascii", _ORDERS[kind]
            case ["element", element, number, *_] if number.isdecimal():
                elements.append((element, int(number), []))
            case ["property", "list", length, kind, label] if elements and {length, kind} <= set(_TYPES):
                elements[-1][2].append((label, order + _TYPES[kind], order + _TYPES[length]))
            case ["property", kind, label] if elements and kind in _TYPES:
                elements[-1][2].append((label, order + _TYPES[kind], None))
            case ["format" | "element" | "property", *_]:
                raise MeshError(f"mesh {name}: is corrupt: its header says '{line.strip()[:_SHOWN]}'; export it again")
    rows = [tuple((label, "f8", length and "f8") for label, _, length in row) if text else tuple(row) for *_, row in elements]
    return text, [(element, number, row) for (element, number, _), row in zip(elements, rows, strict=True)]


def _read_rows(name: str, body: bytes, at: int, number: int, row: Row) -> tuple[dict, int]:
    """Values of each property from a place on, joined, with the lengths of lists; and the place behind them."""
    parts, lengths, left, ahead = [], [], number, 1
    while left:
        length, kind = _next_row(body, at, row)
        table = np.frombuffer(body, kind, min(ahead, left, (len(body) - at) // max(kind.itemsize, 1)), at) if kind else ()
        if not len(table):
            raise MeshError(f"mesh {name}: is cut off: its header promises more than it holds; copy or export it again")
        alike = np.all([table[f"n{k}"] == size for k, size in enumerate(length)], axis=0) & np.ones(len(table), bool)
        same = len(table) if alike.all() else int(alike.argmin())
        parts.append(table[:same])
        lengths.append(np.tile(length, (same, 1)))
        at, left, ahead = at + same * kind.itemsize, left - same, 2 * same
    values = {label: np.concatenate([part[f"v{k}"].ravel() for part in parts]) for k, (label, *_) in enumerate(row) if parts}
    labels = [label for label, _, length in row if length]
    return values | {f"sizes of {label}": np.concatenate(lengths)[:, k] for k, label in enumerate(labels) if parts}, at


def _next_row(body: bytes, at: int, row: Row) -> tuple[tuple[int, ...], np.dtype | None]:
    """Lengths of the lists of the row at a place, and its type; None where it is cut off."""
    lengths = []
    for _, kind, length in row:
        size = 1
        if length:
            if at + np.dtype(length).itemsize > len(body):
                return (), None
            size = int(np.frombuffer(body, length, 1, at)[0])
            if not 0 <= size <= len(body):
                return (), None
            lengths.append(size)
            at += np.dtype(length).itemsize
        at += size * np.dtype(kind).itemsize
    return tuple(lengths), _row_type(row, tuple(lengths))


@cache
def _row_type(row: Row, lengths: tuple[int, ...]) -> np.dtype:
    fields, number = [], 0
    for k, (_, kind, length) in enumerate(row):
        if length:
            fields.append((f"n{number}", length))
            number += 1
        fields.append((f"v{k}", kind, (lengths[number - 1],)) if length else (f"v{k}", kind))
    return np.dtype(fields)


def _lists(table: dict) -> tuple[np.ndarray, np.ndarray]:
    """Vertex numbers of all faces or strips, and how many each of them has."""
    label = next((label for label in _CORNERS if f"sizes of {label}" in table), None)
    if label is None:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return table[label].astype(np.int64), table[f"sizes of {label}"].astype(np.int64)
