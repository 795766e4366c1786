"""Everything a run leaves behind: recording, history, summary and figure."""

from pathlib import Path

from sand_sim.border import Observation
from sand_sim.sinks.run_log import RunLog
from sand_sim.world import World


class RecordingError(ValueError):
    """A recording that cannot be made."""


class Recorder:
    """Writes observations to all sinks that are asked for.

    Args:
        world: that is observed.
        recording: Rerun file, None for none.
        output: folder for ``NAME.json``, ``NAME.npz`` and, where matplotlib is installed, ``NAME.png``; None for none.
        view: open the Rerun viewer.
        particles: draw the particles of tools in Rerun.

    Raises:
        RecordingError: if a recording or the viewer is asked for and Rerun cannot be imported.

    Attributes:
        log: history of the run.
    """

    def __init__(
        self,
        world: World,
        recording: Path | None = None,
        output: Path | None = None,
        view: bool = False,
        particles: bool = False,
    ):
        self.log = RunLog(world.scene)
        self._world, self._output = world, output
        self._rerun = None
        if recording or view:
            self._rerun = _open_rerun(world, recording, view, particles)

    def write(self, observation: Observation) -> None:
        """Add one observation to all sinks; time zero begins a new history."""
        if observation.steps == 0:
            self.log = RunLog(self._world.scene)
        self.log.write(observation)
        if self._rerun:
            self._rerun.write(observation)

    def close(self) -> list[Path]:
        """Finish all files.

        Returns:
            The files written to ``output``.
        """
        if self._rerun:
            self._rerun.close()
        if self._output is None or self.log.last is None:
            return []
        name = self._world.scene.name
        files = self.log.save(self._output, name)
        try:
            from sand_sim.sinks.figure import draw_run

            draw_run(self.log, self._world.tools, self._output / f"{name}.png")
            files.append(self._output / f"{name}.png")
        except ModuleNotFoundError:
            pass  # matplotlib is an extra; the npz holds all that the figure shows
        return files


def _open_rerun(world: World, recording: Path | None, view: bool, particles: bool):
    try:
        from sand_sim.sinks.rerun_sink import RerunSink
    except ImportError as error:
        raise RecordingError(
            f"recording: Rerun cannot be imported ({error}); pip install 'sand_sim[recording]', or leave recording and view empty"
        ) from None
    return RerunSink(world, recording, view, particles)
