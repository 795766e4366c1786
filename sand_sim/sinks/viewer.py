"""The Rerun viewer on this machine: opened, fed, and found again after it has gone."""

import contextlib
import socket
import subprocess
import sys
import time

import rerun as rr

from sand_sim.border import Observation
from sand_sim.sinks.drawing import Drawing
from sand_sim.world import World

PORT = 9876
_HOST = "127.0.0.1"
_PATIENCE = 15.0  # [s] for the viewer to listen
_PROBATION = 2.0  # [s] in which a viewer without a screen gives up
_EVERY = 1.0  # [s] between two looks whether it is still there
_SHORTEST_FLUSH = 0.05  # [s]
_LONGEST_FLUSH = 20.0  # [s]


class Viewer:
    """Sends observations to a viewer, whichever listens.

    Args:
        world: that is drawn.
        particles: draw the particles of tools.
        identity: of the recording.

    Attributes:
        trouble: why it is not fed at present, empty if it is.
        path, finished: no files are written.
    """

    path, finished = None, ()

    def __init__(self, world: World, particles: bool, identity: str):
        self.trouble = ""
        self._world, self._particles, self._identity = world, particles, identity
        self._stream: rr.RecordingStream | None = None
        self._looked = 0.0
        self._look()

    def write(self, observation: Observation) -> None:
        """Show one observation."""
        if time.monotonic() - self._looked > _EVERY:
            self._look()
        if self._stream:
            self._drawing.write(observation)

    def close(self) -> None:
        """Send what is pending, as far as a viewer that may be gone allows."""
        if self._stream:
            with contextlib.suppress(RuntimeError):
                self._stream.flush(timeout_sec=_LONGEST_FLUSH)
            self._stream.disconnect()

    def _look(self) -> None:
        """See whether the viewer is there, or there again: Rerun does not connect a second time by itself."""
        self._looked = time.monotonic()
        if self._stream:
            try:
                self._stream.flush(timeout_sec=_SHORTEST_FLUSH)
            except RuntimeError as error:
                if "timed out" not in str(error):  # else it is only busy
                    self._stream.disconnect()
                    self._stream = None
        elif _listens():
            self._stream = rr.RecordingStream("sand_sim", recording_id=self._identity)
            self._stream.set_sinks(rr.GrpcSink(f"rerun+http://{_HOST}:{PORT}/proxy"))
            self._drawing = Drawing(self._world, self._stream, self._particles)
        self.trouble = "" if self._stream else f"nobody listens on {_HOST}:{PORT}"


def open_viewer() -> bool:
    """Open a viewer, unless one is open already, and wait until it can be sent to; it stays open when we end.

    Returns:
        Whether there is one; not so, for example, without a screen.
    """
    if _listens():
        return True
    # Rerun's own spawn helper listens on all interfaces.
    command = [sys.executable, "-m", "rerun", "--bind", _HOST, "--port", str(PORT)]
    viewer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end and viewer.poll() is None:
        if _listens():
            time.sleep(_PROBATION)
            break
        time.sleep(0.1)
    return viewer.poll() is None


def _listens() -> bool:
    try:
        socket.create_connection((_HOST, PORT), timeout=0.2).close()
    except OSError:
        return False
    return True
