"""3MF files: all that is to be built, in metres; trimesh reads them where lxml and networkx are installed, and only there."""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.polygons import check_corners

_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}  # [m]
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"  # to an object in another part of the archive
_DEEPEST = 100  # objects within objects


def read_3mf(name: str, data: bytes) -> trimesh.Trimesh:
    """Read the objects that a 3MF file wants built, where it wants them, in metres.

    Args:
        name: of the file.
        data: what it holds.

    Raises:
        MeshError: if it is none, is cut off, or names what it does not hold.
    """
    try:
        return _Archive(name, data).mesh()
    except MeshError:
        raise
    except (zipfile.BadZipFile, EOFError, ElementTree.ParseError) as error:
        raise MeshError(f"mesh {name}: is cut off or no 3MF file: {error}; copy or export it again") from None
    except (KeyError, TypeError, ValueError) as error:
        raise MeshError(f"mesh {name}: is corrupt: {type(error).__name__} {error} in its 3MF; export it again") from None


class _Archive:
    def __init__(self, name: str, data: bytes):
        self._name = name
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            held = {f"/{part}": part for part in archive.namelist() if part.lower().endswith(".model")}
            self._models = {path: ElementTree.fromstring(archive.read(part)) for path, part in held.items()}
        self._root = next((path for path in self._models if path.lower() == "/3d/3dmodel.model"), next(iter(self._models), ""))
        self._objects = {
            (path, one.get("id")): one for path, model in self._models.items() for one in model.iterfind("{*}resources/{*}object")
        }
        self._shapes = {}

    def mesh(self) -> trimesh.Trimesh:
        """All that is to be built, in metres."""
        if not self._root:
            raise MeshError(f"mesh {self._name}: is no 3MF file: there is no model in it")
        model = self._models[self._root]
        vertices, faces, number = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
        for item in model.iterfind("{*}build/{*}item"):
            for points, corners in self._placed(self._root, item, np.eye(4), 0):
                vertices.append(points)
                faces.append(corners + number)
                number += len(points)
        return trimesh.Trimesh(
            np.concatenate(vertices) * _UNITS[model.get("unit", "millimeter")], np.concatenate(faces), process=False
        )

    def _placed(self, path: str, reference: ElementTree.Element, above: np.ndarray, depth: int):
        """Yield vertices, shape (n, 3), and faces, shape (m, 3), of the object that an item or a component refers to."""
        path = reference.get(_PATH, path)
        found = self._objects.get((path, reference.get("objectid")))
        if found is None or depth > _DEEPEST:
            raise MeshError(f"mesh {self._name}: is corrupt: it does not hold its object '{reference.get('objectid')}'")
        place = np.eye(4)
        if "transform" in reference.attrib:  # for rows
            place[:, :3] = np.array(reference.get("transform").split(), float).reshape(4, 3)
        place = place @ above
        mesh = found.find("{*}mesh")
        if mesh is not None:
            points, corners = self._shape(path, found.get("id"), mesh)
            mirrored = np.linalg.det(place[:3, :3]) < 0.0
            yield points @ place[:3, :3] + place[3, :3], corners[:, ::-1] if mirrored else corners
        for component in found.iterfind("{*}components/{*}component"):
            yield from self._placed(path, component, place, depth + 1)

    def _shape(self, path: str, number: str, mesh: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
        if (path, number) not in self._shapes:
            points, corners = (
                _numbers(mesh.find("{*}vertices"), "x", "y", "z"),
                _numbers(mesh.find("{*}triangles"), "v1", "v2", "v3"),
            )
            corners = corners.astype(np.int64)
            check_corners(self._name, corners, len(points))
            self._shapes[path, number] = points, corners
        return self._shapes[path, number]


def _numbers(rows: ElementTree.Element | None, *names: str) -> np.ndarray:
    """Three attributes of each element, shape (n, 3)."""
    words = [row.attrib[name] for row in ([] if rows is None else rows) for name in names]
    return np.array(" ".join(words).split(), float).reshape(-1, 3)
