"""Where the package's own scenes and parameters are, from a source tree or installed."""

from os.path import expanduser  # unlike that of Path it leaves a home that nobody knows as it is
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
    """A scene file by its path, or one of the package's own by its bare name.

    A name with an ending or a folder is that of a file: where the user's own ``dig.yaml`` is not there, nobody wants ours.

    Raises:
        SceneError: if there is no such file.
    """
    path = Path(expanduser(name))
    if path.is_file():
        return path
    known = {own.stem: own for own in sorted(config_folder().glob("*.yaml"))}
    if name in known:
        return known[name]
    where, like = "" if path.is_absolute() else f" in {Path.cwd()}", Path(expanduser(f"{name}.yaml"))
    hint = f"is '{like}' meant?" if like.is_file() else f"the package's own scenes are {', '.join(known)}"
    raise SceneError(f"scene '{name}': there is no such file{where}; {hint}")
