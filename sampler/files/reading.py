"""Reading a mesh file and refusing what cannot become a body."""

import io
import logging
import zipfile
from pathlib import Path

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.dae import plain_dae
from sampler.files.gltf import read_gltf
from sampler.files.obj import bare_obj
from sampler.files.off import read_off
from sampler.files.ply import read_ply
from sampler.files.polygons import check_corners
from sampler.files.stl import read_stl
from sampler.files.threemf import read_3mf
from sampler.options import is_positive

# What trimesh says of damage, with a traceback, of normals that nobody looks at too; what matters is told in one line here.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

_POINTER = b"version https://git-lfs"
_OWN = {"stl": read_stl, "ply": read_ply, "off": read_off, "3mf": read_3mf}
_LETTERS = bytes(range(128)) + 128 * b"?"
_LARGEST = 1e100  # [m], of which squares and cubes are numbers yet
_WITH_UNIT = ("dae", "zae", "zip")  # files whose unit trimesh tells, or of which one may be in them


def read_mesh(path: str | Path, scale: float = 1.0) -> trimesh.Trimesh:
    """Read a triangle mesh, in metres, as it stands in the file: nothing is merged or mended yet.

    Units of DAE and 3MF files and node transforms are applied; the up axis of a DAE file is not, as in RViz.

    Args:
        path: STL, OBJ, PLY (also of triangle strips), OFF, DAE, glTF, 3MF or whatever else trimesh reads.
        scale: metres per unit of the file; per metre where the file states its unit.

    Raises:
        MeshError: if the file is unreadable, cut off, corrupt, empty, has no triangles, no extent, or vertices that are not
            finite.
    """
    path = Path(path)
    if not is_positive(scale):
        raise MeshError(f"mesh {path.name}: scale must be positive, got {scale!r}")
    data = _read(path)
    try:
        mesh = _load(path, data)
    except MeshError:
        raise
    except ModuleNotFoundError as error:
        raise MeshError(f"mesh {path.name}: is damaged, or needs what is not installed: {error}") from None
    except NotImplementedError:
        raise MeshError(
            f"mesh {path.name}: cannot be read: {path.suffix} files are not known; export it as STL, OBJ, PLY, DAE, glTF or 3MF"
        ) from None
    except Exception as error:  # trimesh raises whatever its many parsers raise
        raise MeshError(f"mesh {path.name}: cannot be read as {path.suffix or 'a mesh'}: {error}") from None
    mesh.vertices = mesh.vertices * scale
    return check_mesh(mesh, path.name)


def check_mesh(mesh: trimesh.Trimesh, name: str = "mesh") -> trimesh.Trimesh:
    """Refuse triangles that cannot be worked with.

    Raises:
        MeshError: if it is no mesh, has no triangles, or they refer to missing vertices, are not finite, too far or have no area.
    """
    if not isinstance(mesh, trimesh.Trimesh):
        raise MeshError(f"mesh {name}: must be a trimesh.Trimesh, got {type(mesh).__name__}; sampler.read_mesh reads files")
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    if not len(faces):
        raise MeshError(f"mesh {name}: has no triangles")
    if vertices.shape[1:] != (3,):
        raise MeshError(f"mesh {name}: has a vertex with fewer than three coordinates; export it again")
    check_corners(name, faces, len(vertices))
    if not np.all(np.isfinite(vertices[faces])):
        raise MeshError(f"mesh {name}: has vertices that are not finite; export it again")
    if np.abs(vertices[faces]).max() > _LARGEST:
        raise MeshError(f"mesh {name}: has vertices farther than {_LARGEST:g} m away; export it again")
    if mesh.area <= 1e-14 * float(np.ptp(vertices[faces].reshape(-1, 3), axis=0).max()) ** 2:
        raise MeshError(f"mesh {name}: its triangles have no area")
    return mesh


def _read(path: Path) -> bytes:
    """What a file holds, if that can be a mesh at all."""
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
    return data


def _load(path: Path, data: bytes) -> trimesh.Trimesh:
    """Everything that trimesh finds in a file, in one mesh, in metres where the file says what its unit is."""
    kind = path.suffix[1:].lower()
    if own := _OWN.get(kind):
        return own(path.name, data)
    if kind in ("gltf", "glb"):
        return read_gltf(path, data)
    scene = _load_scene(path, kind, data)
    shapes = list(scene.geometry.values())
    if shapes and not any(isinstance(shape, trimesh.Trimesh) for shape in shapes):
        raise MeshError(f"mesh {path.name}: holds points or lines only, no triangles")
    for shape in shapes:
        if isinstance(shape, trimesh.Trimesh):
            shape.visual = trimesh.visual.ColorVisuals()  # materials cannot be joined where Pillow is not installed
    mesh = scene.to_mesh() if shapes else None
    if mesh is None or not len(mesh.faces):
        raise MeshError(f"mesh {path.name}: has no triangles")
    unit = shapes[0].metadata.get("units")
    if kind in _WITH_UNIT and unit:
        mesh.apply_scale(trimesh.units.unit_conversion(unit, "meters"))
    return mesh


def _load_scene(path: Path, kind: str, data: bytes) -> trimesh.Scene:
    """What trimesh finds in a file, which is made plain for it where it would leave something out."""
    if kind == "zae":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            kind, data = "dae", archive.read(next(part for part in archive.namelist() if part.lower().endswith(".dae")))
    if kind == "dae":
        data = plain_dae(path.name, data)
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, ignore_broken=False)
    if kind == "obj":  # names may be in any encoding
        return trimesh.load_scene(io.BytesIO(bare_obj(path.name, data).translate(_LETTERS)), file_type=kind, process=False)
    return trimesh.load_scene(path, process=False)
