"""Damage that mesh readers pass over in silence: pointers, files cut off, faces without enough corners."""

import re
import struct
from pathlib import Path

from sampler.errors import MeshError
from sampler.obj import plain_obj

_POINTER = b"version https://git-lfs"


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
    check = {".obj": _check_obj, ".glb": _check_glb}
    check.get(path.suffix.lower(), lambda name, data: None)(path.name, data)


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
