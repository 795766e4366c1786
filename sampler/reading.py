"""Reading a mesh file and refusing what cannot become a body."""

from pathlib import Path

import numpy as np
import trimesh

from sampler.errors import MeshError

_POINTER = b"version https://git-lfs"


def read_mesh(path: str | Path, scale: float = 1.0) -> trimesh.Trimesh:
    """Read a triangle mesh, in metres.

    Args:
        path: STL, OBJ, PLY, DAE or whatever else trimesh reads.
        scale: metres per unit of the file.

    Raises:
        MeshError: if the file is unreadable, empty, has no triangles, no extent, or vertices that are not finite.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            start = file.read(len(_POINTER))
    except OSError as error:
        raise MeshError(f"mesh {path.name}: cannot be read: {error.strerror}") from None
    if start == _POINTER:
        raise MeshError(f"mesh {path.name}: is a Git LFS pointer, not a mesh; run 'git lfs pull' where it comes from")
    if not np.isfinite(scale) or scale <= 0.0:
        raise MeshError(f"mesh {path.name}: scale must be positive, got {scale}")
    try:
        mesh = trimesh.load_mesh(path, process=True)
    except Exception as error:  # trimesh raises whatever its many parsers raise
        raise MeshError(f"mesh {path.name}: cannot be read as {path.suffix or 'a mesh'}: {error}") from None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise MeshError(f"mesh {path.name}: has no triangles")
    vertices = np.asarray(mesh.vertices, float)
    if not np.all(np.isfinite(vertices)):
        raise MeshError(f"mesh {path.name}: has vertices that are not finite; export it again")
    mesh.apply_scale(scale)
    if mesh.area <= 0.0:
        raise MeshError(f"mesh {path.name}: its triangles have no area")
    return mesh
