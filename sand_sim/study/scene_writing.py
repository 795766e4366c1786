"""Changing entries of a scene file and nothing else in it, comments included."""

import os
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml

# Entries that may be paths, by the sections they are in.
PATHS = {
    "fills": ("file", "shape"),
    "boundaries": ("mesh", "heights"),
    "tools": ("mesh", "urdf"),
    "bodies": ("mesh", "spheres"),
}


def write_scene(source: Path, edited: dict, path: Path) -> bool:
    """Write a scene file with changed entries.

    Args:
        source: the file as it is.
        edited: what it shall hold.
        path: of the new file; relative paths in it are changed to start at its folder.

    Returns:
        Whether comments and layout were kept; where an entry cannot be changed in its place the whole file is written anew.
    """
    text, edited = source.read_text(encoding="utf-8"), _moved(edited, source.parent, path.parent)
    try:
        changed = change_text(text, edited)
        kept = yaml.safe_load(changed) == edited
    except (ValueError, yaml.YAMLError):
        kept = False
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(changed if kept else yaml.safe_dump(edited, sort_keys=False), encoding="utf-8")
    return kept


def change_text(text: str, edited: dict) -> str:
    """The text of a YAML file with its differences from ``edited`` written in their places.

    Raises:
        ValueError: if entries were taken away.
    """
    replacements: list[tuple[int, int, str]] = []
    _compare(yaml.compose(text), yaml.safe_load(text), edited, replacements, text)
    for begin, end, new in sorted(replacements, reverse=True):
        text = text[:begin] + new + text[end:]
    return text


def _moved(parsed: dict, old: Path, new: Path) -> dict:
    """The scene with its relative paths starting at another folder."""
    moved = deepcopy(parsed)
    for section, keys in PATHS.items():
        entries = moved.get(section) or ()
        for entry in entries.values() if isinstance(entries, dict) else entries:
            for key in keys:
                path = entry.get(key)
                if isinstance(path, str) and (old / path).is_file() and not Path(path).is_absolute():
                    entry[key] = os.path.relpath((old / path).resolve(), new.resolve())
    return moved


def _compare(node: yaml.Node, old: Any, new: Any, replacements: list, text: str) -> None:
    if old == new:
        return
    begin, end = node.start_mark.index, node.end_mark.index
    if isinstance(node, yaml.MappingNode) and isinstance(new, dict):
        if not set(old) <= set(new):
            raise ValueError("entries were taken away")
        for key_node, value_node in node.value:
            key = yaml.safe_load(text[key_node.start_mark.index : key_node.end_mark.index])
            _compare(value_node, old[key], new[key], replacements, text)
        added = {key: value for key, value in new.items() if key not in old}
        if added and node.flow_style:
            inside = "".join(f", {key}: {_flow(value)}" for key, value in added.items())
            replacements.append((end - 1, end - 1, inside))
        elif added:
            indent = " " * node.start_mark.column
            lines = "".join(f"{indent}{key}: {_flow(value)}\n" for key, value in added.items())
            # A block mapping's end mark lies behind the blank lines and comments that follow it: go back to its last entry.
            last = text.find("\n", node.value[-1][1].end_mark.index - 1)
            place, before = (last + 1, "") if last >= 0 else (len(text), "\n")
            replacements.append((place, place, before + lines))
    elif isinstance(node, yaml.SequenceNode) and isinstance(new, list) and len(old) == len(new):
        for inner, before, after in zip(node.value, old, new, strict=True):
            _compare(inner, before, after, replacements, text)
    else:
        replacements.append((begin, end, _flow(new)))


def _flow(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False).removesuffix("...\n").strip()
