"""glTF 2.0 files, text and binary: triangles, strips and fans, placed by nodes and joints; trimesh does not read all of that."""

import base64
import json
import re
import struct
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh

from sampler.errors import MeshError
from sampler.files.ply import strip_triangles
from sampler.files.polygons import check_corners

_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_DRACO, _COPIES = "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing"
_KNOWN = re.compile(
    rf"{_DRACO}|.*(material|technique|texture|light|quantization|animation|physics|audio|xmp)"
)  # the others may move triangles


def read_gltf(path: Path, data: bytes) -> trimesh.Trimesh:
    """Read the triangles of a file's scene, in metres; skinned ones as they are posed in the file.

    Args:
        path: of the file; its buffers may lie beside it.
        data: what it holds.

    Raises:
        MeshError: if it is cut off, corrupt, or has what cannot be read, with the reason.
    """
    try:
        return _File(path, data).mesh()
    except MeshError:
        raise
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, struct.error) as error:
        raise MeshError(f"mesh {path.name}: is corrupt: {type(error).__name__} {error} in its glTF; export it again") from None


class _File:
    def __init__(self, path: Path, data: bytes):
        self._path, self._own = path, b""
        self._buffer = cache(self._read_buffer)
        text = data
        if data[:4] == b"glTF":
            if len(data) < 12 or struct.unpack_from("<I", data, 8)[0] > len(data):
                raise self._refusal("is cut off: its header promises more bytes than it holds; copy or export it again")
            chunks, at = {}, 12
            while at + 8 <= len(data):
                length, kind = struct.unpack_from("<I4s", data, at)
                chunks.setdefault(kind, data[at + 8 : at + 8 + length])
                at += 8 + length
            text, self._own = chunks[b"JSON"] if data[4] == 2 else b"{}", chunks.get(b"BIN\0", b"")
        self._tree = json.loads(text)
        if not str(self._tree.get("asset", {}).get("version", "")).startswith("2"):
            raise self._refusal("is no glTF 2.0 file; export it as one")
        for needed in self._tree.get("extensionsRequired", []):
            if not _KNOWN.match(needed):
                raise self._refusal(f"needs the extension {needed}, which cannot be read; export it without")
        if any(_COPIES in node.get("extensions", {}) for node in self._tree.get("nodes", [])):
            raise self._refusal(f"has copies by {_COPIES}, which cannot be read; export it without")

    def _refusal(self, reason: str) -> MeshError:
        return MeshError(f"mesh {self._path.name}: {reason}")

    def mesh(self) -> trimesh.Trimesh:
        """All triangles of the scene, in metres."""
        nodes, places = self._tree.get("nodes", []), self._places()
        vertices, faces, number, others = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0, 0
        for k, place in places.items():
            shape = self._tree["meshes"][nodes[k]["mesh"]] if "mesh" in nodes[k] else {"primitives": []}
            for part in shape["primitives"]:
                if part.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
                    others += 1
                    continue
                points, corners = self._triangles(part, nodes[k].get("weights") or shape.get("weights") or [])
                move = self._skinned(part, self._tree["skins"][nodes[k]["skin"]], places) if "skin" in nodes[k] else place
                mirrored = move.ndim == 2 and np.linalg.det(move[:3, :3]) < 0.0
                vertices.append((move[..., :3, :3] @ points[:, :, None])[..., 0] + move[..., :3, 3])
                faces.append((corners[:, ::-1] if mirrored else corners) + number)
                number += len(points)
        if others and not number:
            raise self._refusal("holds points or lines only, no triangles")
        return trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)

    def _places(self) -> dict[int, np.ndarray]:
        """Of each node of the scene where it is, a matrix."""
        if not self._tree.get("scenes"):
            raise self._refusal("names no scene, so that none of its geometry has a place; export it again")
        roots, places = self._tree["scenes"][self._tree.get("scene", 0)].get("nodes", []), {}
        todo = [(root, np.eye(4)) for root in reversed(roots)]
        while todo:
            k, above = todo.pop()
            if k not in places:
                node = self._tree["nodes"][k]
                places[k] = above @ _local(node)
                todo += [(child, places[k]) for child in reversed(node.get("children", []))]
        return places

    def _triangles(self, part: dict, weights: list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Vertices, shape (n, 3), and their numbers, shape (m, 3)."""
        attributes = part["attributes"]
        compressed = part.get("extensions", {}).get(_DRACO)
        if compressed and "bufferView" not in self._tree["accessors"][attributes["POSITION"]]:
            points, order = self._decompressed(compressed)
        else:
            points = self._array(attributes["POSITION"]).astype(float)
            order = self._array(part["indices"])[:, 0].astype(np.int64) if "indices" in part else np.arange(len(points))
        for share, target in zip(weights, part.get("targets", []), strict=False):
            if share and "POSITION" in target:
                points = points + share * self._array(target["POSITION"])
        check_corners(self._path.name, order, len(points))
        mode = part.get("mode", _TRIANGLES)
        if mode == _STRIP:
            return points, strip_triangles(order)
        if mode == _FAN:
            return points, np.stack([np.full(max(len(order) - 2, 0), order[0]), order[1:-1], order[2:]], axis=1)
        return points, order.reshape(-1, 3)

    def _decompressed(self, compressed: dict) -> tuple[np.ndarray, np.ndarray]:
        try:
            import DracoPy
        except ModuleNotFoundError:
            raise self._refusal("is compressed; export it without Draco, or install DracoPy") from None
        view = self._tree["bufferViews"][compressed["bufferView"]]
        found = DracoPy.decode(bytes(self._bytes(compressed["bufferView"], 0, view["byteLength"])))
        return np.asarray(found.points, float), np.asarray(found.faces, np.int64).ravel()

    def _skinned(self, part: dict, skin: dict, places: dict[int, np.ndarray]) -> np.ndarray:
        """Where the joints move each vertex, shape (n, 4, 4); the place of the node itself is then of no account."""
        joints = np.stack([places[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            joints = joints @ self._array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        attributes, move = part["attributes"], 0.0
        for label in [label for label in attributes if label.startswith("JOINTS_")]:
            share = self._array(attributes[label.replace("JOINTS", "WEIGHTS")]).astype(float)
            move = move + np.einsum("nk,nkij->nij", share, joints[self._array(attributes[label])])
        return move / move[:, 3:, 3:]

    def _array(self, number: int) -> np.ndarray:
        """The values of an accessor, shape (n, width)."""
        accessor = self._tree["accessors"][number]
        kind, width = np.dtype(_KINDS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        values = self._rows(accessor, accessor["count"], kind, width) if "bufferView" in accessor else None
        values = np.zeros((accessor["count"], width), kind) if values is None else values
        if sparse := accessor.get("sparse"):
            at = self._rows(sparse["indices"], sparse["count"], np.dtype(_KINDS[sparse["indices"]["componentType"]]), 1)
            values = values.copy()
            values[at[:, 0]] = self._rows(sparse["values"], sparse["count"], kind, width)
        return np.maximum(values / float(np.iinfo(kind).max), -1.0) if accessor.get("normalized") else values

    def _rows(self, where: dict, count: int, kind: np.dtype, width: int) -> np.ndarray:
        step = self._tree["bufferViews"][where["bufferView"]].get("byteStride", width * kind.itemsize)
        length = (count - 1) * step + width * kind.itemsize
        data = self._bytes(where["bufferView"], where.get("byteOffset", 0), length)
        return np.ndarray((count, width), kind, data, strides=(step, kind.itemsize))

    def _bytes(self, number: int, offset: int, length: int) -> memoryview:
        view = self._tree["bufferViews"][number]
        data, begin = self._buffer(view["buffer"]), view.get("byteOffset", 0) + offset
        if begin + length > len(data):
            raise self._refusal("is cut off: it promises more bytes than it or its buffers hold; copy or export it again")
        return memoryview(data)[begin : begin + length]

    def _read_buffer(self, number: int) -> bytes:
        address = self._tree["buffers"][number].get("uri")
        if address is None:
            return self._own
        if address.startswith("data:"):
            return base64.b64decode(address.partition(",")[2])
        try:
            return (self._path.parent / unquote(address)).read_bytes()
        except OSError:
            raise self._refusal(f"keeps its triangles in {address}, which is not beside it; copy that file, too") from None


def _local(node: dict) -> np.ndarray:
    """Where a node is in the one above it."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    place = trimesh.transformations.quaternion_matrix(np.roll(np.array(node.get("rotation", [0.0, 0.0, 0.0, 1.0]), float), 1))
    place[:3, :3] *= np.array(node.get("scale", [1.0, 1.0, 1.0]), float)
    place[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return place
