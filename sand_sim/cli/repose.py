"""Tell the angle at which a scene's grains come to rest, to choose friction and rolling resistance after real sand."""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from sand_sim.cli import changes
from sand_sim.cli.console import Console
from sand_sim.cli.numbers import count
from sand_sim.config_folder import find_scene
from sand_sim.interruption import Interruption
from sand_sim.scene.types import SceneError
from sand_sim.study.repose import find_repose


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own, such as dig")
    parser.add_argument("--fill", help="name of the grains; the first if left out")
    parser.add_argument("--repeats", type=count, default=2, help="beds that differ by chance (default: 2)")
    changes.add_argument(parser)
    parser.add_argument("--threads", type=count, help="most cores to use; the scene's choice if left out")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    console = Console()
    scene = changes.load_changed(find_scene(options.scene), options.set)
    scene = replace(scene, solver=replace(scene.solver, threads=options.threads)) if options.threads else scene
    if not scene.fills:
        raise SceneError("fills: the scene has no grains")
    fill, found = options.fill or scene.fills[0].name, []

    def progress(stage: str, share: float) -> None:
        interruption.check()
        console.line(f"bed {len(found) + 1} of {options.repeats}: {stage} {100.0 * share:3.0f} %")

    with tempfile.TemporaryDirectory() as folder:
        for seed in range(1, options.repeats + 1):
            found.append(find_repose(scene, fill, seed, Path(folder), progress))
    console.end()
    angles = [one.angle for one in found]
    doubts = sorted({doubt for one in found for doubt in one.doubts})
    if options.json:
        told = {"scene": scene.name, "fill": fill, "angles": angles, "grains": found[0].grains}
        print(json.dumps(told | {"doubts": doubts}))
        return 0
    spread = f", {min(angles):.1f} to {max(angles):.1f} in {len(angles)} beds" if len(angles) > 1 else ""
    print(f"{scene.name}: the slope of '{fill}' at a ledge comes to rest at {np.mean(angles):.1f} degrees{spread}")
    for doubt in doubts:
        print(f"  not to be trusted: {doubt}")
    return 0
