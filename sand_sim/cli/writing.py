"""Where results go: seen to before the work, not when all has been done."""

import os
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path

from sand_sim.scene.types import SceneError


def place(text: str) -> Path:
    """A path, also one with ``~``, which shells leave as it is in ``--out=~/out``."""
    return Path(expanduser(text))


def make_folder(folder: Path, option: str = "--out") -> None:
    """Make a folder for results.

    Raises:
        SceneError: naming the option, if it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SceneError(f"{option} {folder}: is no folder that can be made: {error.strerror}; name another") from None


def check_file(file: Path | None, option: str) -> None:
    """See that a file can be written, if one is asked for; its folder is made.

    Raises:
        SceneError: naming the option, if it cannot.
    """
    if file is None:
        return
    make_folder(file.parent, option)
    if file.is_dir() or not os.access(file if file.exists() else file.parent, os.W_OK):
        raise SceneError(f"{option} {file}: cannot be written; name another file")
