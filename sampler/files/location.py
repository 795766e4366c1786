"""Where a mesh lies: plain paths, ``file://`` and ``package://`` addresses as robot descriptions use them."""

import os
import re
import sys
from importlib.util import find_spec
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path
from urllib.parse import unquote, urlparse

from sampler.errors import MeshError


def locate_mesh(address: str, folder: Path | None = None, kind: str = "mesh") -> Path:
    """Turn the address of a mesh, or of another file of a robot, into a path.

    Args:
        address: a path, ``file:///path`` or ``package://NAME/path``.
        folder: where relative paths start; the working folder if None.
        kind: what the file is called in messages.

    Returns:
        The path of an existing file.

    Raises:
        MeshError: if there is no such package or file, or as ``split_address``.
    """
    try:
        package, name = split_address(address)
        if package is None:
            path = (folder or Path.cwd()) / expanduser(name)  # an absolute path replaces the folder
        else:
            path = package_share(package) / name
        there = path.is_file()
    except OSError as error:
        raise MeshError(f"{kind} '{address}': {error.strerror}") from None
    except MeshError as error:
        raise MeshError(f"{kind} '{address}': {error}") from None
    if not there:
        raise MeshError(f"{kind} '{address}': there is no file {path}")
    return path


def split_address(address: str) -> tuple[str | None, str]:
    """The ROS package that an address names, None for none, and the path, within the package if there is one.

    Raises:
        MeshError: if it is none, is of another machine, or its scheme is unknown.
    """
    try:
        parts = urlparse(address)
    except ValueError as error:  # of brackets, which are for numbers of machines
        raise MeshError(f"is no address: {error}") from None
    if parts.scheme == "package":
        return parts.netloc, unquote(parts.path).lstrip("/")
    if parts.scheme == "file":
        if parts.netloc not in ("", "localhost"):
            raise MeshError("lies on another machine; an address of a file begins with file:///")
        return None, unquote(parts.path)
    if len(parts.scheme) > 1:  # one letter is a drive
        raise MeshError(f"unknown scheme '{parts.scheme}://'; use package://, file:// or a path")
    return None, address


def package_prefixes() -> list[Path]:
    """Folders whose ``share`` holds ROS packages: those of the environment, then that of this Python."""
    given = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return [*given, Path(sys.prefix)]


def package_share(package: str) -> Path:
    """Share folder of a ROS package: by the ament index where ROS is installed, else by its Python package's source tree.

    Nothing of the package is imported, because its name may come from a stranger.

    Raises:
        MeshError: if there is no such package.
    """
    if not package:
        raise MeshError("names no package; write package://NAME/path, with two slashes")
    if re.fullmatch(r"\w[\w-]*", package, re.ASCII):
        for prefix in package_prefixes():
            share = prefix / "share" / package
            if (share / "package.xml").is_file() or (share.is_dir() and prefix != Path(sys.prefix)):
                return share
        try:
            spec = find_spec(package)
        except ValueError:  # a module without one
            spec = None
        root = Path(spec.origin).parent if spec and spec.origin and spec.submodule_search_locations else None
        if root and (root / "share").is_dir():
            return root / "share"
        if root and (root.parent / "package.xml").is_file():
            return root.parent
    raise MeshError(f"no ROS package '{package}' in AMENT_PREFIX_PATH; source its workspace or give a path")
