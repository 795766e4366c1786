"""A folder of checkpoints: the newest few of a run, written behind the back of the stepping thread."""

import contextlib
import fcntl
import os
import re
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sand_sim.checkpoint import (
    Checkpoint,
    CheckpointError,
    DamagedCheckpointError,
    OtherSceneError,
    load_checkpoint,
    sync_folder,
    write_checkpoint,
)
from sand_sim.world import World

PERIOD = 30.0  # [s]
_KEPT = 2


class CheckpointFolder:
    """Keeps the newest checkpoints of a run.

    The period is one of wall time: what a crash costs is work, and so a checkpoint costs the same share of a run however slow
    its scene is. A state that is offered while another one is being written replaces the one that waits.

    Args:
        folder: made if it is not there; no other process may use it meanwhile.
        name: of the scene; files are ``NAME.NUMBER.checkpoint``, the newest has the highest number.
        period: wall time between two checkpoints [s]; 0 for one each frame.
        report: called from any thread with a line for the user.
        warn: the same for what went wrong, once for each trouble; ``report`` if left out.

    Raises:
        CheckpointError: if the folder cannot be made or written to, or is in use.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        period: float = PERIOD,
        report: Callable[[str], None] = lambda line: None,
        warn: Callable[[str], None] | None = None,
    ):
        self.folder, self.period, self._name, self._report = Path(folder), period, name, report
        self._warn = report if warn is None else warn
        if not period >= 0.0:
            raise CheckpointError(f"period of checkpoints: must be 0 s or more, got {period:g}")
        self._pattern = re.compile(re.escape(name) + r"\.(\d+)\.checkpoint")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(self.folder, os.O_RDONLY)
            try:
                fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # the system lets go of it however the process ends
            except OSError:
                os.close(self._handle)
                raise
        except BlockingIOError:
            raise CheckpointError(f"checkpoint folder {folder}: is used by another process; give each run its own") from None
        except OSError as error:
            raise CheckpointError(f"checkpoint folder {folder}: {error.strerror or error}") from None
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="sand_sim checkpoint")
        self._lock = threading.Lock()
        self._waiting: Checkpoint | None = None
        self._failing = False
        self._last, self._last_steps = time.monotonic(), 0

    def files(self) -> list[Path]:
        """Checkpoints that are there, newest first."""
        found = [(int(match[1]), path) for path in self.folder.iterdir() if (match := self._pattern.fullmatch(path.name))]
        return [path for _, path in sorted(found, reverse=True)]

    def resume(self, world: World, take_over: Callable[[Checkpoint], None] = lambda checkpoint: None) -> Checkpoint | None:
        """Bring a world to the newest good checkpoint; damaged ones are reported and set aside.

        Args:
            world: made from the same scene.
            take_over: as of ``load_checkpoint``.

        Returns:
            The checkpoint, None if there is none.

        Raises:
            CheckpointError: if the newest good one was made in another scene.
        """
        tell = self._report
        for path in self.files():
            try:
                checkpoint = load_checkpoint(path, world, take_over)
            except OtherSceneError:
                raise
            except CheckpointError as error:
                tell = self._warn
                tell(f"{error}; the one before is tried")
                if isinstance(error, DamagedCheckpointError):
                    with contextlib.suppress(OSError):
                        path.replace(f"{path}.damaged")  # so that it does not count among those that are kept
                continue
            self._last_steps = checkpoint.header["steps"]
            self._report(f"resumed from {path} at t = {checkpoint.time:.6f} s")
            return checkpoint
        tell(f"no checkpoint of '{self._name}' in {self.folder} to resume from, starting from the beginning")
        return None

    def due(self, steps: int, soon: bool = False) -> bool:
        """Whether the world has taken steps since the last checkpoint, and the period has passed or the end comes ``soon``."""
        return steps != self._last_steps and (soon or time.monotonic() - self._last >= self.period)

    def offer(self, checkpoint: Checkpoint) -> None:
        """Have a checkpoint written by and by; returns at once."""
        self._last, self._last_steps = time.monotonic(), checkpoint.header["steps"]
        with self._lock:
            first, self._waiting = self._waiting is None, checkpoint
        if first:
            self._writer.submit(self._write)

    def close(self) -> None:
        """Wait for what is still to be written."""
        self._writer.shutdown()
        if self._handle is not None:
            os.close(self._handle)
        self._handle = None

    def _write(self) -> None:
        with self._lock:
            checkpoint, self._waiting = self._waiting, None
        try:
            files = self.files()
            number = int(self._pattern.fullmatch(files[0].name)[1]) + 1 if files else 1
            write_checkpoint(self.folder / f"{self._name}.{number:08d}.checkpoint", checkpoint)
            for path in files[_KEPT - 1 :]:
                path.unlink(missing_ok=True)
            sync_folder(self.folder)
        except (CheckpointError, OSError) as error:
            if not self._failing:
                self._warn(f"{error}; the simulation goes on, the next checkpoint is tried again")
            self._failing = True
        else:
            if self._failing:
                self._report(f"checkpoints are written again, up to t = {checkpoint.time:.3f} s")
            self._failing = False
