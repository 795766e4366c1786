"""Where a mesh lies: plain paths, ``file://`` and ``package://`` addresses as robot descriptions use them."""

import os
from importlib import resources
from pathlib import Path
from urllib.parse import unquote, urlparse

from sampler.errors import MeshError


def locate_mesh(address: str, folder: Path | None = None) -> Path:
    """Turn the address of a mesh into a path.

    Args:
        address: a path, ``file:///path`` or ``package://NAME/path``.
        folder: where relative paths start; the working folder if None.

    Returns:
        The path of an existing file.

    Raises:
        MeshError: if there is no such package or file, or the scheme is unknown.
    """
    parts = urlparse(address)
    if parts.scheme == "package":
        path = _package_share(parts.netloc, address) / unquote(parts.path).lstrip("/")
    elif parts.scheme == "file":
        path = Path(unquote(parts.path))
    elif parts.scheme == "" or len(parts.scheme) == 1:
        path = Path(address).expanduser()
        path = path if path.is_absolute() else (folder or Path.cwd()) / path
    else:
        raise MeshError(f"mesh '{address}': unknown scheme '{parts.scheme}://'; use package://, file:// or a path")
    if not path.is_file():
        raise MeshError(f"mesh '{address}': there is no file {path}")
    return path


def _package_share(package: str, address: str) -> Path:
    """Share folder of a ROS package: by the ament index where ROS is installed, else by its Python package's source tree."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        share = Path(prefix) / "share" / package
        if prefix and share.is_dir():
            return share
    try:
        root = Path(str(resources.files(package)))
    except (ModuleNotFoundError, TypeError, ValueError):
        raise MeshError(
            f"mesh '{address}': no ROS package '{package}' in AMENT_PREFIX_PATH; source its workspace or give a path"
        ) from None
    installed = root / "share"
    return installed if installed.is_dir() else root.parent
