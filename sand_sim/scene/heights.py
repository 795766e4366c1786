"""Reading grids of heights."""

from pathlib import Path

import numpy as np

from sand_sim.scene.npz import read_npz
from sand_sim.scene.types import SceneError


def read_heights(path: Path) -> np.ndarray:
    """Read a grid of heights.

    Args:
        path: ``.npz`` with an array ``heights``, ``.csv`` with one row of the grid a line, or a grey ``.png``.

    Returns:
        Heights, shape (rows, columns), in the unit of the file; a png gives 0 (black) to 1 (white). Columns go along x, rows
        along y from its lowest value up; a png is a map with its upper edge far along y.

    Raises:
        SceneError: if there is no usable grid in the file.
    """
    reader = {".npz": _read_npz, ".csv": _read_csv, ".png": _read_png}[path.suffix.lower()]
    try:
        heights = reader(path)
    except OSError as error:
        raise SceneError(f"{path.name} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise SceneError(f"{path.name} is not a readable {path.suffix[1:]} file: {error}") from None
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise SceneError(f"{path.name} must hold at least 2 rows of 2 heights, got shape {heights.shape}")
    if not np.all(np.isfinite(heights)):
        raise SceneError(f"{path.name} has heights that are not finite; fill the gaps")
    return heights


def _read_npz(path: Path) -> np.ndarray:
    columns = read_npz(path)
    if "heights" not in columns:
        raise SceneError(f"{path.name} has no array 'heights'; it has {', '.join(columns) or 'nothing'}")
    return np.asarray(columns["heights"], float)


def _read_csv(path: Path) -> np.ndarray:
    return np.loadtxt(path, delimiter=",", ndmin=2)


def _read_png(path: Path) -> np.ndarray:
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise SceneError(f"{path.name} needs Pillow to be read: pip install pillow, or give heights as npz or csv") from None
    with Image.open(path) as picture:
        if not picture.mode.startswith(("1", "L", "I")) or picture.mode == "LA":
            raise SceneError(f"{path.name} must be a grey picture without transparency, its mode is {picture.mode}")
        white = {"1": 1.0, "L": 255.0}.get(picture.mode, 65535.0)
        return np.asarray(picture, float)[::-1] / white
