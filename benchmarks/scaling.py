"""Time and memory per grain from 1,000 to 1,000,000 grains: a settled bed and its mirror images side by side."""

import gc
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.beds import RADIUS, WIDTHS, bed_scene, find_bed, repeat
from benchmarks.processes import resident_bytes
from benchmarks.speed import Setup, speed_row, time_in_turn
from benchmarks.workloads import Workload
from sand_sim import World, read_scene

SIZES = {1000: ("bed_1000", (1, 1)), 8000: ("tile_8000", (1, 1)), 64_000: ("tile_8000", (4, 2))}
SIZES |= {256_000: ("tile_8000", (8, 4)), 1_000_000: ("tile_8000", (25, 5))}  # bed and its images along x and y

RUN_IN = 400  # steps; the first lists are wide, because nobody knows yet how fast the grains move


def time_scaling(setup: Setup, sizes: dict[int, tuple[str, tuple[int, int]]] = SIZES) -> Iterator[dict]:
    """One row for each size, on the largest number of cores asked for; all sizes run in turn."""
    setup = replace(setup, threads=(max(setup.threads),))
    threads, workloads, resident = setup.threads[0], {}, {}
    for number, (bed, tiles) in sizes.items():
        setup.progress(f"making a bed of {number:,} grains", 0.0)
        gc.collect()
        before = resident_bytes()
        workloads[number, threads] = Workload(f"{number}", repeated_world(bed, tiles, setup, solver={"threads": threads}))
        gc.collect()
        resident[number] = (resident_bytes() - before) / number
    for workload in workloads.values():
        setup.progress(f"running in a bed of {workload.name} grains", 0.0)
        workload.run(RUN_IN)
    times, faults = time_in_turn(workloads, setup)
    for (number, _), workload in workloads.items():
        row = speed_row("scaling", f"{number}", threads, workload, times[number, threads], faults.get((number, threads)))
        yield row | {"resident_bytes_per_grain": round(resident[number]), "process_resident_bytes": resident_bytes()}


def repeated_world(bed: str, tiles: tuple[int, int], setup: Setup, **fields) -> World:
    """A world with a settled bed and its mirror images; ``fields`` are further sections of its scene."""
    return World(read_scene(repeated_scene(bed, tiles, setup, **fields), setup.folder.resolve()), setup.progress)


def repeated_scene(bed: str, tiles: tuple[int, int], setup: Setup, **fields) -> dict:
    """The scene of a settled bed and its mirror images."""
    folder = setup.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    with np.load(find_bed(bed, setup.beds, folder, setup.progress)) as columns:
        position = repeat(columns["position"], WIDTHS[bed], tiles)
    path = folder / "repeated.npz"
    np.savez(path, position=position, radius=np.full(len(position), RADIUS))
    return bed_scene((tiles[0] * WIDTHS[bed], tiles[1] * WIDTHS[bed]), path, **fields)
