"""STL files, text and binary."""

import re

import numpy as np
import trimesh

from sampler.errors import MeshError

_HEADER, _ROW = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_CORNER = ("vertex", "", "", "")
_FACET = np.array([*("facet", "normal", "", "", "", "outer", "loop"), *3 * _CORNER, *("endloop", "endfacet")], bytes)


def read_stl(name: str, data: bytes) -> trimesh.Trimesh:
    """Read an STL file, binary ones also with other bytes left over at their end.

    Args:
        name: of the file.
        data: what it holds.

    Raises:
        MeshError: if it is none, cut off, damaged or has no triangles.
    """
    corners = _text_corners(name, data) if _is_text(data) else _binary_corners(name, data)
    if not len(corners):
        raise MeshError(f"mesh {name}: has no triangles")
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)


def _is_text(data: bytes) -> bool:
    """Whether a file is text; binary ones may begin with ``solid`` too, but hold the triangles they promise."""
    promised, held = _triangles(data)
    begins = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid"
    return begins and promised > held and re.search(rb"facet|endsolid", data, re.IGNORECASE) is not None


def _triangles(data: bytes) -> tuple[int, int]:
    """How many triangles a binary file promises, and how many it holds."""
    return int.from_bytes(data[_HEADER - 4 : _HEADER], "little"), (len(data) - _HEADER) // _ROW.itemsize


def _text_corners(name: str, data: bytes) -> np.ndarray:
    text = data.lower().replace(b"\r", b"\n")
    if text.rfind(b"endsolid") <= text.rfind(b"endfacet"):
        raise MeshError(f"mesh {name}: is cut off: it does not end with 'endsolid'; copy or export it again")
    words = re.sub(rb"(?m)^\W*(end)?solid\b.*", b"", text).split()  # names may be anything
    rows = np.array(words, bytes)[: len(words) // len(_FACET) * len(_FACET)].reshape(-1, len(_FACET))
    if len(words) % len(_FACET) or np.any(np.where(_FACET == b"", _FACET, rows) != _FACET):
        raise MeshError(f"mesh {name}: is damaged: its facets do not have three vertices each; export it again")
    return np.stack([rows[:, first : first + 3] for first in np.flatnonzero(_FACET == b"vertex") + 1], axis=1).astype(float)


def _binary_corners(name: str, data: bytes) -> np.ndarray:
    if not re.search(rb"[\0-\x08\x0e-\x1f]", data[:500]):
        raise MeshError(f"mesh {name}: is no STL file but other text: '{data.split()[0][:20].decode(errors='replace')} ...'")
    if len(data) < _HEADER:
        raise MeshError(f"mesh {name}: is cut off: {len(data)} bytes are too few for an STL file")
    promised, held = _triangles(data)
    if promised > held:
        raise MeshError(f"mesh {name}: is cut off: it promises {promised} triangles and holds {held}; copy or export it again")
    if promised < held and (len(data) - _HEADER) % _ROW.itemsize == 0:
        raise MeshError(f"mesh {name}: is damaged: it promises {promised} triangles and holds {held}; export it again")
    return np.frombuffer(data, _ROW, promised, _HEADER)["corners"].astype(float)
