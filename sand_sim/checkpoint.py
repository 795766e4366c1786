"""The state of a running world as a file, from which it goes on to the bit.

The file holds a line with the version of the format, the length of a JSON header, the header, arrays as NumPy writes them (never
pickled), and the SHA-256 of all that. A reader sees the checksum first and believes nothing else before.
"""

import contextlib
import hashlib
import io
import json
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sand_sim.assembly.scene_identity import find_difference
from sand_sim.world import World

_MAGIC = b"sand_sim checkpoint "
_VERSION = b"2\n"
_LENGTH = 8  # bytes of a length, little-endian
_CHECKSUM = hashlib.sha256().digest_size
_GROUPS = ("state", "history")


class CheckpointError(ValueError):
    """A checkpoint that cannot be written, or that a run cannot go on from; the message names the file and the reason."""


class DamagedCheckpointError(CheckpointError):
    """A file that is broken."""


class OtherSceneError(CheckpointError):
    """A sound file that was made in another scene."""


@dataclass(frozen=True)
class Checkpoint:
    """A moment of a run.

    Attributes:
        header: ``time`` [s], ``steps``, ``time_step`` [s], ``precision``, ``grains``, and ``scene`` as
            ``scene_identity.describe_scene`` gives it.
        state: from ``World.save``.
        commands: what a ``Simulation`` still has to do, as plain values; empty if the world was stepped by hand.
        history: what a run log wants to go on with, arrays by name.
    """

    header: dict
    state: dict[str, np.ndarray]
    commands: dict = field(default_factory=dict)
    history: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.header["time"]


def take_checkpoint(world: World, commands: dict | None = None, history: dict[str, np.ndarray] | None = None) -> Checkpoint:
    """Copy all that is needed to go on from here; ``commands`` and ``history`` are as in ``Checkpoint``."""
    header = _conditions(world) | {"time": world.time, "steps": world.steps, "grains": world.assembly.table.grains}
    return Checkpoint(header, world.save(), commands or {}, history or {})


def load_checkpoint(path: Path, world: World, take_over: Callable[[Checkpoint], None] = lambda checkpoint: None) -> Checkpoint:
    """Bring a world to where a checkpoint was taken.

    Args:
        path: of the file.
        world: made from the same scene.
        take_over: called with the checkpoint when the world is there; raises ``ValueError`` if the rest of it is of no use.

    Raises:
        CheckpointError: if the file cannot be read, was made in another scene or holds no state of this one; the world is
            unchanged then.
    """
    checkpoint = read_checkpoint(path)
    then, now = checkpoint.header, _conditions(world)
    if then.get("precision") != now["precision"]:
        raise OtherSceneError(f"{path}: was made in {then.get('precision')} precision, this world has {now['precision']}")
    if then.get("scene") != now["scene"]:
        raise OtherSceneError(f"{path}: was made in another scene: {find_difference(then.get('scene'), now['scene'])}")
    if then.get("time_step") != now["time_step"]:
        raise OtherSceneError(
            f"{path}: was made with time steps of {then.get('time_step')} s, this world's are {now['time_step']} s"
        )
    before = world.save()
    try:
        world.check_state(checkpoint.state)
    except ValueError as error:
        raise DamagedCheckpointError(f"{path}: holds no state of this scene: {error}") from None
    try:
        world.restore(checkpoint.state)
        take_over(checkpoint)
    except ValueError as error:
        world.restore(before)
        raise DamagedCheckpointError(f"{path}: {error}") from None
    return checkpoint


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a file that is there whole or not at all, and stays if the power fails after this returns.

    Raises:
        CheckpointError: if it cannot be written; a file that was there before is unchanged then.
    """
    groups = {group: getattr(checkpoint, group) for group in _GROUPS}
    header = checkpoint.header | {"commands": checkpoint.commands} | {group: list(arrays) for group, arrays in groups.items()}
    writing = path.with_name(f".{path.name}.writing")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with writing.open("wb") as file:
                checksum = hashlib.sha256()
                for part in _parts(json.dumps(header).encode(), groups):
                    checksum.update(part)
                    file.write(part)
                file.write(checksum.digest())
                file.flush()
                os.fsync(file.fileno())
            writing.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                writing.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)
    except OSError as error:
        where = f": {error.filename}" if error.filename and Path(error.filename) not in (path, writing) else ""
        raise CheckpointError(f"{path}: cannot be written: {error.strerror or error}{where}") from None


def read_checkpoint(path: Path) -> Checkpoint:
    """Read and verify a file.

    Raises:
        CheckpointError: if it is missing, damaged or of another version.
    """
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:  # a pipe must not block
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise CheckpointError(f"{path}: is not a file")
            content = memoryview(file.read())
    except OSError as error:
        raise CheckpointError(f"{path}: cannot be read: {error.strerror or error}") from None
    start = len(_MAGIC + _VERSION)
    if bytes(content[: len(_MAGIC)]) != _MAGIC:
        raise DamagedCheckpointError(f"{path}: is no checkpoint, or one whose beginning is damaged")
    version = bytes(content[len(_MAGIC) : start])
    if version != _VERSION:
        raise CheckpointError(
            f"{path}: is of format {version.decode(errors='replace').strip()}, this sand_sim reads {_VERSION.decode().strip()}"
        )
    if len(content) < start + _LENGTH + _CHECKSUM or hashlib.sha256(content[:-_CHECKSUM]).digest() != content[-_CHECKSUM:]:
        raise DamagedCheckpointError(f"{path}: is damaged or cut short, its checksum does not fit")
    try:
        end = start + _LENGTH + int.from_bytes(content[start : start + _LENGTH], "little")
        header = json.loads(bytes(content[start + _LENGTH : end]))
        groups = {}
        for group in _GROUPS:
            groups[group] = {}
            for name in header.pop(group):
                groups[group][name], end = _read_array(content, end)
        header["time"], header["steps"], commands = float(header["time"]), int(header["steps"]), dict(header.pop("commands"))
        return Checkpoint(header, groups["state"], commands, groups["history"])
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise DamagedCheckpointError(f"{path}: cannot be understood: {error!r}") from None


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _conditions(world: World) -> dict:
    """What must be the same in two worlds for one to go on from the other's checkpoint."""
    return {"scene": world.identity, "time_step": world.time_step, "precision": world.scene.solver.precision}


def _parts(header: bytes, groups: dict[str, dict[str, np.ndarray]]):
    """All of a file but its checksum, piece by piece."""
    yield _MAGIC + _VERSION + len(header).to_bytes(_LENGTH, "little") + header
    for arrays in groups.values():
        for array in arrays.values():
            whole = np.asarray(array, order="C")
            start = io.BytesIO()
            np.lib.format.write_array_header_1_0(start, np.lib.format.header_data_from_array_1_0(whole))
            yield start.getvalue()
            yield whole.reshape(-1).view(np.uint8).data


def _read_array(content: memoryview, place: int) -> tuple[np.ndarray, int]:
    """The array that begins at a place, and where it ends."""
    start = io.BytesIO(content[place : place + 4096])
    if np.lib.format.read_magic(start) != (1, 0):
        raise ValueError("an array of an unknown kind")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(start)
    if dtype.hasobject or fortran or any(size < 0 for size in shape):
        raise ValueError("an array of objects, in another order or of no size")
    number, begin = int(np.prod(shape, dtype=object)), place + start.tell()
    array = np.frombuffer(content, dtype, number, begin).copy() if number else np.zeros(0, dtype)
    return array.reshape(shape), begin + number * dtype.itemsize
