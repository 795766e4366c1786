"""Reading npz files."""

import zipfile
import zlib
from pathlib import Path

import numpy as np


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """All arrays of a file by name.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is damaged, or no npz file.
    """
    try:
        with np.load(path) as file:
            return dict(file)
    except (EOFError, TypeError, zipfile.BadZipFile, zlib.error) as error:  # TypeError: a single array
        raise ValueError(str(error)) from None
