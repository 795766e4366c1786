"""A Rerun recording as a file that survives a full disk."""

import os
import select
import threading
from datetime import timedelta
from pathlib import Path

import rerun as rr

from sand_sim.border import Observation
from sand_sim.sinks.drawing import Drawing
from sand_sim.world import World

_GATHERED = timedelta(seconds=5.0)  # until frames are written; Rerun remembers 3 kB of each piece to the end, and each has 20
_RETRY = 1.0  # [s] between two tries to write
_MOST_WAITING = 64 * 2**20  # bytes that may wait for a disk
_PIECE = 2**20  # bytes
_PATIENCE = 20.0  # [s] for the last bytes


class RecordingFile:
    """Writes observations to a .rrd file.

    Rerun's own file sink ends for good at the first error of the disk, tells nobody, and keeps the process from ending. So it
    writes into a pipe here, and what comes out is brought to the disk when there is room. Where too much would have to wait, the
    recording goes on in a second file, which Rerun shows as one with the first.

    Args:
        path: of the file; its folder is made.
        world: that is drawn.
        particles: draw the particles of tools.
        identity: of the recording; Rerun shows files of the same identity as one.

    Attributes:
        path: of the file that is being written.
        finished: files that have been written before, as far as they go.
        lost: bytes that had to be dropped.
    """

    def __init__(self, path: Path, world: World, particles: bool, identity: str):
        self._first, self._world, self._particles, self._identity = path, world, particles, identity
        self.finished: list[Path] = []
        self.path, self.lost = path, 0
        self._begin()

    @property
    def trouble(self) -> str:
        """What keeps it from being written at present, empty if nothing does."""
        return self._pump.trouble

    def write(self, observation: Observation) -> None:
        """Add one observation."""
        if self._pump.torn and not self._pump.trouble:
            self._end()
            if self.path.exists():
                self.finished.append(self.path)
                self.path = self._first.with_stem(f"{self._first.stem}.{len(self.finished) + 1}")
            self._begin()
        self._drawing.write(observation)

    def close(self) -> None:
        """Write what is left."""
        self._end()

    def _begin(self) -> None:
        reading, writing = os.pipe()
        self._pump = _Pump(reading, self.path)
        gathering = rr.ChunkBatcherConfig(flush_tick=_GATHERED)
        self._stream = rr.RecordingStream("sand_sim", recording_id=self._identity, batcher_config=gathering)
        self._stream.set_sinks(rr.FileSink(f"/dev/fd/{writing}"))
        os.close(writing)
        self._drawing = Drawing(self._world, self._stream, self._particles)

    def _end(self) -> None:
        self._stream.disconnect()
        self._pump.join(_PATIENCE)
        self.lost += self._pump.lost


class _Pump(threading.Thread):
    """Brings what comes out of a pipe to a file, in a thread of its own.

    Attributes:
        trouble: what keeps the file from being written at present, empty if nothing does.
        torn: whether nothing more can follow in this file, because bytes were dropped or someone has deleted it.
        lost: bytes that were dropped for want of room.
    """

    def __init__(self, source: int, path: Path):
        super().__init__(name="sand_sim recording", daemon=True)
        self.trouble, self.torn, self._deleted, self.lost = "", False, False, 0
        self._source, self._path, self._file = source, path, None
        self._waiting = bytearray()
        self.start()

    def run(self) -> None:
        """Read until the other end is closed, and try a last time then."""
        while True:
            if self._waiting and not select.select([self._source], [], [], _RETRY)[0]:
                self._drain()
                continue
            piece = os.read(self._source, _PIECE)
            if self.torn or len(self._waiting) + len(piece) > _MOST_WAITING:
                self.torn = True
                self.lost += 0 if self._deleted else len(piece)
            else:
                self._waiting += piece
            self._drain()
            if not piece:
                break
        os.close(self._source)
        if self._file:
            self._file.close()

    def _drain(self) -> None:
        try:
            if self._file is None:
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._file = self._path.open("wb", buffering=0)
            elif os.fstat(self._file.fileno()).st_nlink == 0:
                self.torn = self._deleted = True
            while self._waiting:
                del self._waiting[: self._append(self._waiting)]
            self.trouble = ""
        except OSError as error:
            self.trouble = error.strerror or str(error)

    def _append(self, content: bytearray) -> int:
        return self._file.write(content[:_PIECE])
