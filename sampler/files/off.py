"""OFF files, text, of polygons of any size; trimesh reads those of which all faces have as many corners."""

import re

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.polygons import mesh_of

_KEYWORD = rb"(?:ST)?C?N?OFF"  # the coordinates come first whatever else vertices have


def read_off(name: str, data: bytes) -> trimesh.Trimesh:
    """Read an OFF file.

    Args:
        name: of the file.
        data: what it holds.

    Raises:
        MeshError: if it is none, or cut off.
    """
    rows = [row for line in data.splitlines() if (row := line.split(b"#")[0].split())]
    first = rows[0]
    if re.fullmatch(_KEYWORD, first[0]):
        rows = rows[1:] if len(first) == 1 else [first[1:], *rows[1:]]
    counts = [int(word) for word in (rows[0] if rows else [])[:3] if word.isdigit()]
    if len(counts) < 2:
        raise MeshError(f"mesh {name}: is no OFF file but begins with '{b' '.join(first)[:20].decode(errors='replace')}'")
    points, faces = rows[1 : 1 + counts[0]], rows[1 + counts[0] : 1 + counts[0] + counts[1]]
    sizes = np.array([int(row[0]) for row in faces], np.int64)
    if len(points) + len(faces) < sum(counts[:2]) or any(len(row) <= size for row, size in zip(faces, sizes, strict=True)):
        raise MeshError(f"mesh {name}: is cut off: its header promises more than it holds; copy or export it again")
    corners = np.array([word for row, size in zip(faces, sizes, strict=True) for word in row[1 : 1 + size]], bytes)
    return mesh_of(name, np.array([row[:3] for row in points], bytes).astype(float), corners.astype(np.int64), sizes)
