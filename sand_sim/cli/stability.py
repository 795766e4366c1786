"""Sweep stiff and extreme cases, and draw a map of where the method is stable, against the predicted limit."""

import argparse
import json
from pathlib import Path

from sand_sim.cli.console import Console
from sand_sim.cli.writing import make_folder, place
from sand_sim.interruption import Interruption
from sand_sim.study.stability import sweep, table_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "--out", type=place, default=Path("out"), help="folder for stability.json and stability.png (default: out)"
    )
    parser.add_argument("--quick", action="store_true", help="fewer cases and a coarser map")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON instead of a table")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb; the exit code is 1 if anything is silently wrong, or an automatic time step not stable."""
    make_folder(options.out)
    console = Console()
    result = sweep(options.quick, lambda what, share: console.line(f"{100.0 * share:3.0f} %  {what}"), interruption.check)
    console.end()
    files = [options.out / "stability.json"]
    result.save(files[0])
    note = ""
    try:
        from sand_sim.study.stability_figure import draw_map

        files.append(options.out / "stability.png")
        draw_map(result.cells, files[-1])
    except ModuleNotFoundError as error:
        files.pop()
        note = f"no picture: {error.name} cannot be imported; pip install 'sand_sim[figures]'"
    if options.json:
        print(json.dumps(result.as_dict(), indent=1, default=float))
    else:
        print(table_text(result))
        print("written: " + ", ".join(map(str, files)))
    if note:
        console.tell(note)
    return 1 if result.bad else 0
