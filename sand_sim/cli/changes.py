"""``--set PATH=VALUE``: entries of a scene file changed for one call of a verb."""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from sand_sim.scene.reading import load_scene
from sand_sim.scene.types import Scene, SceneError
from sand_sim.study.scene_writing import PATHS
from sand_sim.study.variation import Edit, Facts, Variation, to

_FILES = {key for keys in PATHS.values() for key in keys}


def add_argument(parser: argparse.ArgumentParser, when: str = "") -> None:
    """Declare the option; ``when`` says at which time of several the scene is changed."""
    parser.add_argument(
        "--set",
        type=_edit,
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help=f"change the scene{when}, as in --set duration=0.5 or --set 'fills.*.radius=0.004'; files are sought in the working "
        "folder, then beside the scene; may be repeated",
    )


def load_changed(path: Path, edits: list[Edit]) -> Scene:
    """Read and check a scene file with changes.

    Raises:
        SceneError: if the file cannot be read, an entry cannot be changed or a field is wrong.
    """
    return load_scene(path, partial(apply_edits, Variation("", "", tuple(edits))))


def apply_edits(variation: Variation, parsed: dict, facts: Facts | None = None) -> dict:
    """A scene as YAML gives it with changes.

    Raises:
        SceneError: if an entry cannot be changed, because of what it is in.
    """
    try:
        return variation.apply(parsed, facts)
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        paths = ", ".join(edit.path for edit in variation.edits)
        raise SceneError(f"cannot change {paths} in this scene: {error}") from None


def _edit(text: str) -> Edit:
    path, sign, value = text.partition("=")
    if not sign or not path or not value:
        raise argparse.ArgumentTypeError(f"must be PATH=VALUE, got '{text}'")
    try:
        parsed = yaml.safe_load(value)
    except yaml.YAMLError:
        parsed = None
    if parsed is None:  # which would leave the entry alone
        raise argparse.ArgumentTypeError(f"must be PATH=VALUE with a value as in a scene file, got '{text}'")
    return Edit(path, to(_from_here(path, parsed)))


def _from_here(path: str, value: Any) -> Any:
    """A file of the working folder by its whole path, as relative ones in a scene start at its own folder."""
    named = isinstance(value, str) and path.rpartition(".")[2] in _FILES
    return str(Path(value).resolve()) if named and Path(value).is_file() else value
