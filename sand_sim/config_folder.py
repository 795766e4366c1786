"""Where the package's own scenes and parameters are, from a source tree or installed."""

from pathlib import Path

from sampler import package_prefixes
from sand_sim.scene.types import SceneError

_NAME = "sand_sim"


def config_folder() -> Path:
    """The folder with ``dig.yaml``: of the source tree if run from one, else the share folder of the installed package."""
    candidates = [Path(__file__).parent.parent / "config"]
    candidates += [prefix / "share" / _NAME / "config" for prefix in package_prefixes()]
    for folder in candidates:
        if (folder / "dig.yaml").is_file():
            return folder
    raise SceneError(f"the scenes of {_NAME} are not found in {', '.join(map(str, candidates))}; install the package again")


def find_scene(name: str) -> Path:
    """A scene file by its path, or one of the package's own by its name with or without ``.yaml`` or ``config/``.

    Raises:
        SceneError: if there is no such file.
    """
    path = Path(name).expanduser()
    if path.is_file():
        return path
    own = config_folder() / path.name
    if path.parent in (Path(), Path("config")):  # else it is a file of the user's that is not there
        for candidate in (own, own.with_suffix(".yaml")):
            if candidate.is_file():
                return candidate
    known = ", ".join(sorted(p.stem for p in config_folder().glob("*.yaml")))
    raise SceneError(f"scene '{name}': there is no such file; the package's own scenes are {known}")
