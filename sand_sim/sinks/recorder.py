"""Everything a run leaves behind: recording, history, summary and figure."""

import contextlib
import sys
from collections.abc import Callable
from pathlib import Path

from sand_sim.border import Observation
from sand_sim.sinks.origin import find_origin
from sand_sim.sinks.run_log import RunLog
from sand_sim.world import World

_ROWS = 50_000  # of a history that is written in the end
_ROWS_UNSEEN = 1_000  # of one that is not


class RecordingError(ValueError):
    """A recording that cannot be made."""


def require_rerun() -> None:
    """See that recordings can be made, before the long work that they shall show.

    Raises:
        RecordingError: if Rerun cannot be imported.
    """
    try:
        import rerun  # noqa: F401
    except ImportError as error:
        raise RecordingError(
            f"recording: Rerun cannot be imported ({error}); pip install 'sand_sim[recording]', or leave recording and view empty"
        ) from None


class Recorder:
    """Writes observations to all sinks that are asked for.

    A sink that fails neither stops nor slows the run: it is reported once, tried again and again, and reported when it is back.

    Args:
        world: that is observed.
        recording: Rerun file, None for none.
        output: folder for ``NAME.json``, ``NAME.npz`` and, where matplotlib is installed, ``NAME.png``; None for none.
        view: open the Rerun viewer.
        particles: draw the particles of tools in Rerun.
        report: called with a line for the user when a sink fails and when it is back, and of other files that cannot be written.
        log: history to go on with, a new one if left out.

    Raises:
        RecordingError: if a recording or the viewer is asked for and Rerun cannot be imported.

    Attributes:
        log: history of the run.
        failed: files that were asked for and could not be written, or not whole; complete once closed.
    """

    def __init__(
        self,
        world: World,
        recording: Path | None = None,
        output: Path | None = None,
        view: bool = False,
        particles: bool = False,
        report: Callable[[str], None] = lambda line: print(f"sand_sim: {line}", file=sys.stderr),
        log: RunLog | None = None,
    ):
        self.log = log or RunLog(world.scene, most_rows=_ROWS if output else _ROWS_UNSEEN)
        self.failed: list[Path] = []
        self._world, self._output, self._report = world, output, report
        self._sinks = _open_sinks(world, recording, view, particles, self.log.identity, report) if recording or view else {}
        self._troubled: set[str] = set()
        self._look_after_sinks()
        try:
            if output and not (recording and recording.parent == output):  # which tells it itself
                output.mkdir(parents=True, exist_ok=True)
        except OSError as error:  # told now, not after hours
            report(f"{output} cannot be made: {error.strerror or error}; summary and history are tried again in the end")

    @property
    def troubles(self) -> list[str]:
        """Sinks that fail now, and why."""
        return [f"{name}: {sink.trouble}" for name, sink in self._sinks.items() if sink.trouble]

    def write(self, observation: Observation) -> None:
        """Add one observation to all sinks; time zero begins a new history."""
        if observation.steps == 0:
            self.log = RunLog(self._world.scene, identity=self.log.identity, most_rows=self.log.most_rows)
        self.log.write(observation)
        for sink in self._sinks.values():
            sink.write(observation)
        self._look_after_sinks()

    def close(self) -> list[Path]:
        """Finish all files.

        Returns:
            The files written, as far as they go.
        """
        files = []
        for sink in self._sinks.values():
            sink.close()
            files += sink.finished
            if sink.path and (sink.trouble or sink.lost):
                why = sink.trouble or f"{sink.lost} bytes are missing, more than could wait for the disk"
                self._report(f"recording {sink.path}: {why}")
                self.failed.append(sink.path)
            elif sink.path:
                files.append(sink.path)
        if self._output is None or self.log.last is None:
            return files
        begin = self._output / self._world.scene.name
        for ending, write in ((".npz", self.log.save_history), (".json", self._save_summary), (".png", self._draw)):
            path = begin.with_name(begin.name + ending)
            writing = path.with_name(f".writing-{path.name}")  # half a file is worse than none, or than that of an earlier run
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                write(writing)
                writing.replace(path)
                files.append(path)
            except ModuleNotFoundError:
                pass  # matplotlib is an extra; the npz holds all that the figure shows
            except OSError as error:
                self._report(f"{path} cannot be written: {error.strerror or error}")
                self.failed.append(path)
                with contextlib.suppress(OSError):
                    writing.unlink(missing_ok=True)
        return files

    def _save_summary(self, path: Path) -> None:
        self.log.save_summary(path, find_origin(self._world))

    def _draw(self, path: Path) -> None:
        from sand_sim.sinks.figure import draw_run

        draw_run(self.log, self._world.tools, path)

    def _look_after_sinks(self) -> None:
        """Report what has begun to fail and what is back."""
        for name, sink in self._sinks.items():
            if sink.trouble and name not in self._troubled:
                self._troubled.add(name)
                self._report(f"{name}: {sink.trouble}; the simulation goes on, and this is tried again")
            elif not sink.trouble and name in self._troubled:
                self._troubled.discard(name)
                self._report(f"{name} goes on")


def _open_sinks(
    world: World, recording: Path | None, view: bool, particles: bool, identity: str, report: Callable[[str], None]
) -> dict:
    """Sinks by the names that messages give them."""
    require_rerun()
    from sand_sim.sinks.recording_file import RecordingFile
    from sand_sim.sinks.viewer import Viewer, open_viewer

    sinks = {}
    if recording:
        sinks[f"recording {recording}"] = RecordingFile(recording, world, particles, identity)
    if view and open_viewer():
        sinks["the Rerun viewer"] = Viewer(world, particles, identity)
    elif view:
        report("the Rerun viewer could not be opened; going on without it")
    return sinks
