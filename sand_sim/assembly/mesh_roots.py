"""Which mesh files may be read on a stranger's word: those in given folders, and those of ROS packages."""

import re
from collections.abc import Iterable, Iterator, Sequence
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path
from urllib.parse import unquote

from sampler import MeshError, package_prefixes, package_share, split_address
from sand_sim.config_folder import config_folder
from sand_sim.scene.types import SceneError
from sand_sim.showing import shown

_LONGEST = 4096  # letters
_SHOWN = 120  # letters


def mesh_roots(names: Iterable[str], *usual: Path) -> tuple[list[Path], bool]:
    """The folders that meshes may come from, and whether they may come from ROS packages, too.

    Args:
        names: folders; an empty name stands for the usual ones, the package's own meshes and all ROS packages.
        usual: folders.

    Raises:
        SceneError: if there is no such folder.
    """
    names = list(names)
    roots = [Path(expanduser(name)) for name in names if name]
    for root in roots:
        if not root.is_dir():
            raise SceneError(f"mesh_roots: there is no folder '{root}'")
    packages = "" in names
    return [*roots, *usual, config_folder() / "meshes"] if packages else roots, packages


def allowed_mesh(uri: str, roots: Sequence[Path], packages: bool) -> Path:
    """The file behind the address of a mesh, if it may be read.

    Args:
        uri: ``package://NAME/path``, ``file:///path``, or a path, which starts at the first root that has it if it is relative.
        roots: folders whose files may be read; links and ``..`` are followed before it is asked where a file lies.
        packages: whether files of ROS packages may be read, too, also where links lead into the package's own source tree, as
            ``colcon build --symlink-install`` makes them.

    Returns:
        The path of an existing file, without links.

    Raises:
        SceneError: if there is no such file, or it may not be read; that of a forbidden file does not tell whether it exists.
    """
    name = f"mesh '{shown(uri, _SHOWN)}'"
    try:
        found = list(_found(uri, roots, packages))
        existing = [real for real, allowed in found if allowed and real.is_file()]
    except OSError as error:
        raise SceneError(f"{name}: cannot be read: {error.strerror}") from None
    except (MeshError, RuntimeError, ValueError) as error:  # a circle of links is a RuntimeError
        raise SceneError(f"{name}: {error}") from None
    if existing:
        return existing[0]
    if not (found and all(allowed for _, allowed in found)):
        shares = ["the share folders of ROS packages"] if packages else []
        allowed = ", ".join(dict.fromkeys([*map(str, roots), *shares])) or "none"
        hint = "put it there, use package://, or name" if packages else "name"
        raise SceneError(
            f"{name}: lies outside the folders that meshes may come from ({allowed}); {hint} its folder in the parameter "
            "mesh_roots"
        )
    raise SceneError(f"{name}: there is no file {' or '.join(str(real) for real, _ in found)}")


def _found(uri: str, roots: Sequence[Path], packages: bool) -> Iterator[tuple[Path, bool]]:
    """Where a file may lie, without links, and whether it may be read there."""
    places, package = _places(uri, roots)
    for place in places:
        real = place.resolve()
        own = packages and _of_package(real, package or _package_around(place))
        yield real, own or any(real.is_relative_to(root.resolve()) for root in roots)


def _places(uri: str, roots: Sequence[Path]) -> tuple[list[Path], str]:
    """Where a file may lie, and the package that its address names, if any."""
    if not uri or len(uri) > _LONGEST or not unquote(uri).isprintable():
        raise ValueError("is empty, too long, or holds letters that cannot be printed")
    package, path = split_address(uri)
    if package is None:
        return list(dict.fromkeys(root / path for root in roots)), ""  # an absolute path replaces the root
    return [package_share(package) / path], package


def _package_around(place: Path) -> str:
    """The ROS package in whose share folder a path is, as it is written; empty if in none."""
    for prefix in package_prefixes():
        share = prefix / "share"
        if share in place.parents and (share / (name := place.relative_to(share).parts[0]) / "package.xml").is_file():
            return name
    return ""


def _of_package(real: Path, package: str) -> bool:
    """Whether a file lies in the share folder or in the source tree of a package."""
    if not package:
        return False
    if real.is_relative_to(package_share(package).resolve()):
        return True
    for folder in real.parents:
        manifest = folder / "package.xml"
        if manifest.is_file():
            return re.search(rf"<name>\s*{re.escape(package)}\s*</name>", manifest.read_text("utf-8", "replace")) is not None
    return False
