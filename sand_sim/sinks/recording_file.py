"""A Rerun recording as a file that survives a full disk."""

import os
import time
from pathlib import Path

import rerun as rr

from sand_sim.border import Observation
from sand_sim.sinks.drawing import Drawing
from sand_sim.world import World

_EVERY = 1.0  # [s] between two writes
_MOST_WAITING = 64 * 2**20  # bytes that may wait for a disk


class RecordingFile:
    """Writes observations to a .rrd file.

    Rerun's own file sink ends for good at the first error of the disk, tells nobody, and keeps the process from ending. So Rerun
    gives bytes here, a piece of a recording at a time, and pieces may follow each other in a file.

    Args:
        path: of the file; its folder is made.
        world: that is drawn.
        particles: draw the particles of tools.
        identity: of the recording; Rerun shows files of the same identity as one.

    Attributes:
        trouble: what keeps it from being written at present, empty if nothing does.
        lost: bytes that had to be dropped.
    """

    def __init__(self, path: Path, world: World, particles: bool, identity: str):
        self.path, self.trouble, self.lost = path, "", 0
        self._stream = rr.RecordingStream("sand_sim", recording_id=identity)
        self._bytes = self._stream.binary_stream()
        self._drawing = Drawing(world, self._stream, particles)
        self._beginning = self._bytes.read(flush=True) or b""  # what stands still, without which nothing else can be seen
        self._waiting = [self._beginning]
        self._file = None
        self._written = 0.0
        self._drain()

    def write(self, observation: Observation) -> None:
        """Add one observation."""
        self._drawing.write(observation)
        if time.monotonic() - self._written > _EVERY:
            self._drain()

    def close(self) -> None:
        """Write what is left."""
        self._drain()
        if self._file:
            self._file.close()
        self._stream.disconnect()

    def _drain(self) -> None:
        self._written = time.monotonic()
        piece = self._bytes.read(flush=True) or b""
        if sum(map(len, self._waiting)) + len(piece) > _MOST_WAITING:
            self.lost += len(piece)
        elif piece:
            self._waiting.append(piece)
        try:
            if self._file is None or os.fstat(self._file.fileno()).st_nlink == 0:
                self._open()
            while self._waiting:
                self._append(self._waiting[0])
                del self._waiting[0]
            self.trouble = ""
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def _open(self) -> None:
        """Begin the file, anew if someone has deleted it."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self._file:
            self._file.close()
            self._waiting.insert(0, self._beginning)
        self._file = self.path.open("wb", buffering=0)

    def _append(self, piece: bytes) -> None:
        """Write a piece whole or not at all."""
        begin, left = self._file.tell(), memoryview(piece)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            self._file.truncate(begin)
            self._file.seek(begin)
            raise
