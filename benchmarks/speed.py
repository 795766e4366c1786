"""Grain-steps per second of the workloads, on one core and on all, in turn, round after round, so that all have the same luck."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from benchmarks.workloads import Workload, make_workload
from sand_sim import UnstableError
from sand_sim.assembly.tool_model import Progress
from sand_sim.plan import array_sizes

SPEED_CASES = {
    "W1-1000": "1,000 settled spheres, quick to try",
    "W1-8000": "8,000 settled spheres",
    "W1-32000": "32,000 settled spheres",
    "W1-32000-idle": "the same, with ten idle tools far away",
    "W2": "8,000 settled grains of four spheres",
    "W3": "a blade drawn through 32,000 spheres",
}


@dataclass(frozen=True)
class Setup:
    """How cases are run.

    Attributes:
        beds: folder of settled beds, or None.
        folder: where beds settled here are kept.
        threads: numbers of cores, one after the other.
        rounds: how often all that is compared runs in turn.
        work: spheres times steps of one run.
        progress: called with what is being done and the share of it, 0 to 1; may raise to give up.
    """

    beds: Path | None
    folder: Path
    threads: tuple[int, ...]
    rounds: int
    work: float
    progress: Progress


def time_speed(names: list[str], setup: Setup) -> Iterator[dict]:
    """One row for each case and number of cores."""
    workloads = {
        (name, threads): make_workload(name, setup.beds, setup.folder, threads, setup.progress)
        for name in names
        for threads in setup.threads
    }
    times, faults = time_in_turn(workloads, setup)
    for (name, threads), workload in workloads.items():
        yield speed_row("speed", name, threads, workload, times[name, threads], faults.get((name, threads)))


def time_in_turn(workloads: dict[tuple, Workload], setup: Setup) -> tuple[dict[tuple, np.ndarray], dict[tuple, str]]:
    """Run all workloads in turn.

    Returns:
        Seconds per step of each, shape (rounds,), and for those that blew up what happened.
    """
    times, faults = {key: [] for key in workloads}, {}
    turns = (setup.rounds + 1) * len(workloads)
    for turn in range(turns):
        key = list(workloads)[turn % len(workloads)]
        setup.progress("timing", turn / turns)
        workload = workloads[key]
        steps = max(1, round(setup.work / len(workload.world.assembly.table)))
        if key not in faults:
            try:
                spent = workload.run(steps)
            except UnstableError as error:
                faults[key] = str(error)
                continue
            if turn >= len(workloads):  # the first round settles in
                times[key].append(spent / steps)
    setup.progress("timing", 1.0)
    return {key: np.array(values) for key, values in times.items()}, faults


def speed_row(benchmark: str, name: str, threads: int, workload: Workload, times: np.ndarray, fault: str | None) -> dict:
    """What is said about a case; one that blew up or is doubtful has no speed, but says why under ``failed``.

    Args:
        benchmark: it belongs to.
        name: of the case.
        threads: cores it ran on.
        workload: after it ran.
        times: seconds per step, shape (rounds,).
        fault: why it stopped, if it did.
    """
    figures, assembly = workload.figures(), workload.world.assembly
    row = {"benchmark": benchmark, "case": name, "threads": threads} | figures
    row["bytes_per_sphere"] = round(sum(array_sizes(assembly.solver.arrays).values()) / figures["spheres"], 1)
    row["time_step_s"] = workload.world.time_step
    why = [fault] if fault else figures["doubts"]
    if why:
        row["failed"] = "; ".join(why)
    else:
        row["grain_steps_per_second"] = spread(figures["grains"] / times)
        row["ns_per_grain_and_step"] = spread(1e9 * times / figures["grains"])
    return row | provenance(threads)


def spread(values: np.ndarray) -> dict[str, float]:
    """Median, least and most of some values, to four digits."""
    ends = {"median": np.median(values), "least": np.min(values), "most": np.max(values)}
    return {name: float(f"{value:.4g}") for name, value in ends.items()}
