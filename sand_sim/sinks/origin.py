"""What a run was made from and with, so that its files can be told from those of a variant, and it can be run again."""

import platform
from importlib.metadata import PackageNotFoundError, version

from sand_sim.world import World

_PACKAGES = ("sand_sim", "warp-lang", "numpy")


def find_origin(world: World) -> dict:
    """The scene's physics in plain values, files by their digests, beside device and versions."""
    return {
        "scene": world.identity,
        "device": world.assembly.solver.device.label,
        "machine": platform.machine(),
        "versions": {name: _version_of(name) for name in _PACKAGES} | {"python": platform.python_version()},
    }


def _version_of(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:  # a source tree that is not installed has none
        return None
