"""Damage that mesh readers pass over in silence: pointers, files cut off, faces without enough corners."""

import re
import struct
from pathlib import Path

from sampler.errors import MeshError
from sampler.obj import plain_obj

_POINTER = b"version https://git-lfs"
_STL_HEADER, _STL_TRIANGLE = 84, 50  # bytes


def check_file(path: Path) -> None:
    """Refuse a file that is no mesh or only part of one.

    Raises:
        MeshError: with the reason.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"mesh {path.name}: cannot be read: {error.strerror}") from None
    if data.startswith(_POINTER):
        raise MeshError(f"mesh {path.name}: is a Git LFS pointer, not a mesh; run 'git lfs pull' where it comes from")
    if not data.strip(b"\0 \r\n\t"):
        raise MeshError(f"mesh {path.name}: is empty")
    if not path.suffix:
        raise MeshError(f"mesh {path.name}: has no ending that tells its format, as .stl or .obj; rename it")
    check = {".stl": _check_stl, ".obj": _check_obj, ".glb": _check_glb}
    check.get(path.suffix.lower(), lambda name, data: None)(path.name, data)


def is_text_stl(data: bytes) -> bool:
    """Whether an STL file is text; binary files may begin with ``solid`` too, but hold the triangles they promise."""
    promised, held = _stl_triangles(data)
    begins = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid"
    return begins and promised > held and re.search(rb"facet|endsolid", data, re.IGNORECASE) is not None


def _stl_triangles(data: bytes) -> tuple[int, int]:
    """How many triangles a binary STL file promises, and how many it holds."""
    return int.from_bytes(data[80:_STL_HEADER], "little"), (len(data) - _STL_HEADER) // _STL_TRIANGLE


def _check_stl(name: str, data: bytes) -> None:
    if is_text_stl(data):
        text = data.lower()
        if text.rfind(b"endsolid") <= text.rfind(b"endfacet"):
            raise MeshError(f"mesh {name}: is cut off: it does not end with 'endsolid'; copy or export it again")
        if text.count(b"vertex") % 3 or text.count(b"endfacet") * 3 != text.count(b"vertex"):
            raise MeshError(f"mesh {name}: is damaged: its facets do not have three vertices each; export it again")
        return
    if not re.search(rb"[\0-\x08\x0e-\x1f]", data[:500]):
        raise MeshError(f"mesh {name}: is no STL file but other text: '{data.split()[0][:20].decode(errors='replace')} ...'")
    if len(data) < _STL_HEADER:
        raise MeshError(f"mesh {name}: is cut off: {len(data)} bytes are too few for an STL file")
    promised, held = _stl_triangles(data)
    if promised > held:
        raise MeshError(f"mesh {name}: is cut off: it promises {promised} triangles and holds {held}; copy or export it again")
    if promised < held and (len(data) - _STL_HEADER) % _STL_TRIANGLE == 0:
        raise MeshError(f"mesh {name}: is damaged: it promises {promised} triangles and holds {held}; export it again")
    if promised == 0:
        raise MeshError(f"mesh {name}: has no triangles")


def _check_obj(name: str, data: bytes) -> None:
    """Readers drop faces they do not understand; a body with faces dropped would be wrong in silence."""
    if b"\0" in data:
        raise MeshError(f"mesh {name}: is no OBJ file but binary; give it the ending of its format, as .stl")
    data = plain_obj(data)
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


def _check_glb(name: str, data: bytes) -> None:
    if len(data) < 12 or struct.unpack_from("<I", data, 8)[0] > len(data):
        raise MeshError(f"mesh {name}: is cut off: its header promises more bytes than it holds; copy or export it again")
