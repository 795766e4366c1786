"""Where the runs of a node leave their files, so that none takes the place of one before."""

from collections.abc import Callable, Iterable, Mapping
from itertools import chain, count
from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
from pathlib import Path


class RunFiles:
    """What has been written by the runs of one node; each configuring begins another one.

    Args:
        tell: called with a line for the user where a run goes to another place than the parameters say.
    """

    def __init__(self, tell: Callable[[str], None]):
        self._tell, self._written = tell, set()

    def places(self, parameters: Mapping, scene: str) -> tuple[Path | None, Path | None]:
        """Recording and output folder for the run that begins, None for none.

        A run that is resumed has its history from before, which it writes anew, but begins a recording of its own.

        Args:
            parameters: of the node.
            scene: its name, which is that of the files in the output folder.
        """
        recording, output = (Path(expanduser(parameters[name])) if parameters[name] else None for name in ("recording", "output"))
        if recording and (parameters["resume"] or recording in self._written):
            path = recording
            recording = self._unused(path, chain([path], (path.with_stem(f"{path.stem}.{number}") for number in count(2))))
        ours = {output / f"{scene}{ending}" for ending in (".npz", ".json", ".png")} if output else set()
        if ours & self._written and not parameters["resume"]:
            path = output
            output = self._unused(path, (path / str(number) for number in count(2)))
        return recording, output

    def add(self, path: Path) -> None:
        """Remember a file that has been written."""
        self._written.add(path)

    def _unused(self, path: Path, others: Iterable[Path]) -> Path:
        unused = next(one for one in others if not one.exists())
        if unused != path:
            self._tell(f"{path} holds an earlier run; this one goes to {unused}")
        return unused
