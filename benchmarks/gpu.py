"""Speed on an NVIDIA GPU: settled beds of one and of four million spheres, mirror images of one tile; one JSON line per case.

Bytes are those that a step must move at least, each array once per stage that needs it; the bandwidth is that of a copy on the
same device, measured in the same run. Run from the root of the source tree: ``python -m benchmarks.gpu``.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import warp as wp

from benchmarks.profile import time_stages
from benchmarks.provenance import provenance
from benchmarks.scaling import repeated_world
from benchmarks.speed import Setup

TILE = "tile_8000"
CASES = {"W1-1M": (25, 5), "W1-4M": (25, 20)}  # images of the tile along x and y
SETTLE, STEPS, ROUNDS, CYCLES = 2000, 500, 5, 3
COPIED = 2**30  # [B]


def least_bytes(arrays) -> float:
    """Bytes that a step of single spheres between walls must move at least."""
    grains, listed, met = arrays.grains, arrays.pair_list, arrays.met

    def size(*some) -> int:
        return sum(wp.types.type_size_in_bytes(one.dtype) for one in some if one is not None)

    moved = (grains.place, grains.remainder, grains.motion, grains.spin, grains.half_motion, grains.half_spin)
    pair = size(listed.owner, listed.partner, met.order) + 2 * size(listed.memory) + 3 * size(listed.force, listed.couple)
    grain = 3 * size(*moved) - size(grains.remainder) + size(grains.origin) + 2 * size(listed.starts, met.starts)
    return pair * listed.pairs.get() + grain * grains.active.get()


def copy_bandwidth(device) -> float:
    """Bytes read and written in a second by a copy on the device."""
    source, target = (wp.zeros(COPIED, dtype=wp.uint8, device=device.name) for _ in range(2))
    times = []
    for _ in range(10):
        device.synchronize()
        begin = time.perf_counter()
        wp.copy(target, source)
        device.synchronize()
        times.append(time.perf_counter() - begin)
    return 2.0 * COPIED / float(np.median(times))


def measure(case: str, setup: Setup) -> dict:
    """Time a case."""
    world = repeated_world(TILE, CASES[case], setup, solver={"device": "cuda"})
    solver = world.assembly.solver
    solver.run(SETTLE)
    times = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        solver.run(STEPS)
        times.append((time.perf_counter() - begin) / STEPS)
    step, grains = float(np.median(times)), solver.arrays.grains.active.get()
    moved, bandwidth = least_bytes(solver.arrays) / step, copy_bandwidth(solver.device)
    stages = {name: float(np.median(spent)) for (_, name), spent in time_stages(world, CYCLES).items()}
    return {
        "benchmark": "gpu",
        "case": case,
        "grains": grains,
        "pairs_per_grain": round(solver.arrays.pair_list.pairs.get() / grains, 3),
        "grain_steps_per_second": round(grains / step),
        "slowest_over_median": round(max(times) / step, 3),
        "least_bytes_per_second": round(moved),
        "copy_bytes_per_second": round(bandwidth),
        "share_of_copy": round(moved / bandwidth, 3),
        "microseconds_per_step": round(1e6 * step, 1),
        "microseconds_per_stage": {name: round(1e6 * spent, 1) for name, spent in stages.items()},
        "doubts": list(world.observe().health.doubts),
    } | (provenance() | {"device": solver.device.label})


def main() -> None:
    """Run the cases."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("cases", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)} (default: all)")
    parser.add_argument("--beds", type=Path, help="folder of settled beds")
    options = parser.parse_args()
    unknown = set(options.cases) - set(CASES)
    if unknown:
        parser.error(f"unknown case '{unknown.pop()}'; known are {', '.join(CASES)}")
    if not wp.is_cuda_available():
        sys.exit("gpu: needs an NVIDIA GPU and its driver, and none is found here")
    setup = Setup(options.beds, Path("out/beds"), (1,), ROUNDS, 0.0, lambda stage, share: None)
    for case in options.cases:
        print(json.dumps(measure(case, setup)), flush=True)


if __name__ == "__main__":
    main()
