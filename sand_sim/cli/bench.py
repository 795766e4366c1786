"""Measure speed: settled beds, a blade, scaling, cold start and the node; one JSON line per case. From a clone only.

Cases of speed run in turn, round after round, on one core and on all, so that a busy machine slows all of them alike. A run that
is not to be trusted has no speed: its line says why, and the command ends with code 1. Beds are settled at first use and kept.
"""

import argparse
import importlib
import json
import sys
from pathlib import Path

from sampler.cores import available_cores
from sand_sim.cli.console import Console
from sand_sim.cli.writing import check_file, place
from sand_sim.interruption import InterruptedByUserError, Interruption
from sand_sim.scene.types import SceneError

_ROOT = Path(__file__).parents[2]
_BEDS = Path("out/beds")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("cases", nargs="*", metavar="CASE", help="see --list; W1-8000, W1-32000, W2 and W3 if left out")
    parser.add_argument("--list", action="store_true", help="name the cases")
    parser.add_argument("--beds", type=place, help="folder with settled beds, bed_8000.xyz and so on; settled here if left out")
    parser.add_argument("--threads", type=int, nargs="+", metavar="N", help="numbers of cores; 1 and all if left out")
    parser.add_argument("--rounds", type=int, default=5, help="how often everything runs in turn (default: %(default)s)")
    parser.add_argument("--work", type=float, default=3e7, help="spheres times steps of one run (default: %(default)s)")
    parser.add_argument("--out", type=place, metavar="FILE", help="append the lines to this file, too")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb; the exit code is 1 if any run is not to be trusted."""
    cases = _load_cases()
    if options.list:
        print("\n".join(f"{name:14} {what}" for name, what in cases.CASES.items()))
        return 0
    names = list(dict.fromkeys(options.cases or cases.USUAL))
    unknown = [name for name in names if name not in cases.CASES]
    if unknown:
        raise SceneError(f"bench: unknown case '{unknown[0]}'; known are {', '.join(cases.CASES)}")
    if options.beds and not options.beds.is_dir():
        raise SceneError(f"bench: --beds {options.beds} is no folder")
    threads = options.threads or [1, available_cores()]
    if min(*threads, options.rounds, options.work) < 1:
        raise SceneError("bench: --threads, --rounds and --work must be at least 1")
    check_file(options.out, "--out")
    console, failed = Console(), False

    def progress(stage: str, share: float) -> None:
        interruption.check()
        console.stage(stage, share)

    setup = cases.Setup(options.beds, _BEDS, tuple(dict.fromkeys(threads)), options.rounds, options.work, progress)
    try:
        for row in cases.run_cases(names, setup):
            console.end()
            _write(row, options.out)
            failed = failed or "failed" in row
    except InterruptedByUserError:
        console.end()
        return 130
    return 1 if failed else 0


def _load_cases():
    """The module of the cases, which is in the source tree only."""
    if not (_ROOT / "benchmarks" / "cases.py").is_file():
        raise SceneError("bench: the benchmarks are not installed; run it from a clone of the source tree")
    if str(_ROOT) not in sys.path:
        sys.path.insert(0, str(_ROOT))
    return importlib.import_module("benchmarks.cases")


def _write(row: dict, out: Path | None) -> None:
    line = json.dumps(row)
    print(line, flush=True)
    if out:
        with out.open("a") as file:
            print(line, file=file)
