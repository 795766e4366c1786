"""Bodies that were sampled before, found again by the content of the mesh file, the options and the sampler's own code."""

import contextlib
import hashlib
import os
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from sampler.body import ParticleBody
from sampler.errors import MeshError
from sampler.files.reading import read_mesh
from sampler.sampling import sample_body
from sampler.storage import load_body, save_body

_ABANDONED = 3600.0  # [s] after which a half-written file belongs to a writer that was killed


def cache_folder() -> Path:
    """Where bodies are kept: ``SAMPLER_CACHE``, else ``sampler`` in ``XDG_CACHE_HOME`` or ``~/.cache``.

    Raises:
        RuntimeError: if neither is set and nobody knows the user's home.
    """
    given = os.environ.get("SAMPLER_CACHE")
    return Path(given) if given else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sampler"


def sample_file(path: str | Path, radius: float, scale: float = 1.0, *, cache: bool = True, **options) -> ParticleBody:
    """Read and sample a mesh file, or take what an earlier call with the same content and options has kept.

    Args:
        path: of the mesh.
        radius: of every particle [m].
        scale: metres per unit of the file.
        cache: whether to look for and keep the body.
        options: further ones of ``sample_body``.

    Raises:
        MeshError: as ``read_mesh`` and ``sample_body`` do.
    """
    path = Path(path)
    if path.suffix.lower() in (".gltf", ".glb"):  # its triangles may be kept in other files
        return sample_mesh(read_mesh(path, scale), radius, cache=cache, **options)
    content = None
    if cache:
        with contextlib.suppress(OSError):  # of which ``read_mesh`` tells
            content = path.suffix.lower().encode() + path.read_bytes()
    return _keep(content, lambda: read_mesh(path, scale), {"radius": radius, "scale": scale} | options)


def sample_mesh(mesh: trimesh.Trimesh, radius: float, *, cache: bool = True, **options) -> ParticleBody:
    """Sample a mesh, or take what an earlier call with the same triangles and options has kept.

    Args:
        mesh: in metres.
        radius: of every particle [m].
        cache: whether to look for and keep the body.
        options: further ones of ``sample_body``.

    Raises:
        MeshError: as ``sample_body`` does.
    """
    arrays = (np.asarray(mesh.vertices, "<f8"), np.asarray(mesh.faces, "<i8"))
    content = b"".join(repr(array.shape).encode() + array.tobytes() for array in arrays) if cache else None
    return _keep(content, lambda: mesh, {"radius": radius} | options)


def _keep(content: bytes | None, read: Callable[[], trimesh.Trimesh], options: dict) -> ParticleBody:
    """The body kept under the content, if there is one, else a new one, kept if there is a content."""
    place = None
    if content is not None:
        with contextlib.suppress(RuntimeError):  # as a folder that cannot be written
            place = cache_folder() / f"{_key(content, options)}.npz"
    if place:
        with contextlib.suppress(MeshError):  # missing or damaged: sampled anew
            return load_body(place)
    body = sample_body(read(), **{name: value for name, value in options.items() if name != "scale"})
    if place:
        with contextlib.suppress(MeshError):  # a folder that cannot be written only costs time
            save_body(place, body)
            _sweep(place.parent)
    return body


def _key(content: bytes, options: dict) -> str:
    digest = hashlib.sha256(_code())
    shown = {name: value for name, value in options.items() if name not in ("progress", "observe") and value is not None}
    digest.update(repr(sorted(shown.items())).encode())
    digest.update(content)
    return digest.hexdigest()


@cache
def _code() -> bytes:
    """The sampler's own source, as it is when first asked for."""
    return b"".join(source.read_bytes() for source in sorted(Path(__file__).parent.rglob("*.py")))


def _sweep(folder: Path) -> None:
    for left in folder.glob(".writing-*"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _ABANDONED:
                left.unlink()
