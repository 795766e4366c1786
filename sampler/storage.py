"""Particle bodies as ``.npz`` files, written whole or not at all."""

import os
import tempfile
from dataclasses import astuple, fields
from os.path import exists, isfile
from pathlib import Path

import numpy as np

from sampler.body import Evenness, ParticleBody
from sampler.errors import MeshError

_TEXTS = ("warnings", "mass_warnings")


def save_body(path: str | Path, body: ParticleBody) -> None:
    """Write a body; a reader or a crash in between finds the old file or none, never half of one.

    Raises:
        MeshError: if the file cannot be written.
    """
    path = Path(path)
    if exists(path) and not isfile(path):  # a device, which a file would be put in place of
        raise MeshError(f"body {path}: cannot be written: it is no file")
    arrays = {f.name: getattr(body, f.name) for f in fields(body) if f.name not in ("evenness", "steps", *_TEXTS)}
    arrays["evenness"] = np.array(astuple(body.evenness))
    arrays["step_names"] = np.array(list(body.steps), dtype=np.str_)
    arrays["step_counts"] = np.array(list(body.steps.values()), int)
    arrays |= {name: np.array(getattr(body, name), dtype=np.str_) for name in _TEXTS}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".writing-", suffix=".npz", delete=False) as file:
            try:
                np.savez(file, **arrays)
                file.close()
                umask = os.umask(0)
                os.umask(umask)
                os.chmod(file.name, 0o666 & ~umask)  # as any other file, not for the owner only
                os.replace(file.name, path)
            except BaseException:
                Path(file.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        raise MeshError(f"body {path}: cannot be written: {error.strerror or error}") from None


def load_body(path: str | Path) -> ParticleBody:
    """Read a body.

    Raises:
        MeshError: if the file is missing, damaged, or no body.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        steps = dict(zip(arrays.pop("step_names").tolist(), arrays.pop("step_counts").tolist(), strict=True))
        evenness = Evenness(*arrays.pop("evenness").tolist())
        texts = {name: tuple(arrays.pop(name).tolist()) for name in _TEXTS}
        values = {name: array if array.ndim else float(array) for name, array in arrays.items()}
        return ParticleBody(**values, evenness=evenness, steps=steps, **texts)
    except Exception as error:  # NumPy raises whatever its parsers of damaged headers raise
        raise MeshError(f"body {path}: cannot be read: {error}") from None
