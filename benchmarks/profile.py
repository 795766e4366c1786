"""Where the time of a step goes, stage by stage, in a settled bed; prints one JSON line per stage.

Each stage is recorded by itself and played again and again, all of them in turn. Renewing the lists is divided by the steps
between two renewals. Run from the root of the source tree: ``python -m benchmarks.profile``.
"""

import argparse
import json
import time
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from benchmarks.workloads import make_workload

CYCLES, STEPS = 9, 2000
PLAYS = {"listing": 10, "tool listing": 10, "step": 100}  # in one program


def time_stages(world, cycles: int) -> dict[tuple[str, str], np.ndarray]:
    """Seconds of each stage, by its group and name, once; shape (cycles,)."""
    solver = world.assembly.solver
    arrays, device, stages = solver.arrays, solver.device, solver.stages
    # Lists made anew so often are wider than those of a run, so that steps come first.
    groups = {"step": stages.step, "listing": stages.listing, "tool listing": stages.tool_listing}
    programs = {}
    for group, members in groups.items():
        for stage in members:
            programs[group, stage.name] = device.record(partial(_repeat, stage, arrays, PLAYS[group]))
    spent = {key: [] for key in programs}
    state = world.save()
    for _ in range(cycles):
        for key, program in programs.items():
            arrays.flags.proceed.fill_(1)
            begin = time.perf_counter()
            program()
            device.synchronize()
            spent[key].append((time.perf_counter() - begin) / PLAYS[key[0]])
        world.restore(state)
    return {key: np.array(times) for key, times in spent.items()}


def _repeat(stage, arrays, times: int, recorder) -> None:
    for _ in range(times):
        stage.record(arrays, recorder)


def count_renewals(workload, steps: int) -> dict[str, int]:
    """How often the lists of grains, and of tools, are made anew in so many steps."""
    workload.steer(steps)
    solver = workload.world.assembly.solver
    flags = {"listing": solver.arrays.flags.grains_moved, "tool listing": solver.arrays.flags.tools_moved}
    renewals = dict.fromkeys(flags, 0)
    for _ in range(steps):
        solver.run(1)
        for name, flag in flags.items():
            renewals[name] += int(flag.numpy()[0])
    renewals["tool listing"] += renewals["listing"]
    return renewals


def main() -> None:
    """Profile a case."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("case", nargs="?", default="W1-8000", help="of benchmarks.workloads (default: W1-8000)")
    parser.add_argument("--beds", type=Path, help="folder of settled beds")
    parser.add_argument("--threads", type=int, default=1, help="cores (default: 1)")
    options = parser.parse_args()
    workload = make_workload(options.case, options.beds, Path("out/beds"), options.threads)
    workload.run(STEPS)
    shares = {name: number / STEPS for name, number in count_renewals(workload, STEPS).items()}
    spheres = len(workload.world.assembly.table)
    for (group, name), times in time_stages(workload.world, CYCLES).items():
        share = shares.get(group, 1.0)
        row = {"benchmark": "profile", "case": options.case, "stage": name}
        row["ns_per_sphere_and_step"] = round(1e9 * share * float(np.median(times)) / spheres, 3)
        row["ns_per_sphere_once"] = round(1e9 * float(np.median(times)) / spheres, 2)
        print(json.dumps(row | {"times_per_step": share} | provenance(options.threads)))


if __name__ == "__main__":
    main()
