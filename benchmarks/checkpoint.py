"""What a checkpoint costs: time taken from the stepping thread, time until it is on the disk, bytes per grain.

Measures the digging scene, and its bed 16 times beside itself. Prints one JSON line each. Run from the root of the source tree:
``python -m benchmarks.checkpoint [--folder FOLDER]``.
"""

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.beds import repeat
from benchmarks.provenance import provenance
from sand_sim import World, load_scene
from sand_sim.checkpoint import load_checkpoint, take_checkpoint, write_checkpoint
from sand_sim.config_folder import find_scene
from sand_sim.scene.types import Fill, Settle
from sand_sim.sinks.run_log import RunLog

TILES = 4
REPEATS = 7


def main() -> None:
    """Measure both worlds."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--folder", type=Path, help="where checkpoints are written (default: the system's temporary folder)")
    with tempfile.TemporaryDirectory(dir=parser.parse_args().folder) as name:
        world = World(load_scene(find_scene("dig")))
        print(json.dumps(measure(world, Path(name)) | provenance()))
        print(json.dumps(measure(repeated(world, Path(name)), Path(name)) | provenance()))


def measure(world: World, folder: Path) -> dict:
    """Medians after some frames."""
    path, log = folder / "one.checkpoint", RunLog(world.scene)
    took, wrote, read, stepped = [], [], [], []
    for _ in range(REPEATS + 1):
        begin = time.perf_counter()
        world.step(100)
        stepped.append((time.perf_counter() - begin) / 100)
        log.write(world.observe())
        begin = time.perf_counter()
        checkpoint = take_checkpoint(world, history=log.pack())
        taken = time.perf_counter()
        write_checkpoint(path, checkpoint)
        written = time.perf_counter()
        load_checkpoint(path, world)
        read.append(time.perf_counter() - written)
        took.append(taken - begin)
        wrote.append(written - taken)
    grains, medians = len(log.last.grains), [float(np.median(times[1:])) for times in (took, wrote, read, stepped)]
    named = dict(zip(("stepping_thread_s", "write_s", "load_s", "step_s"), medians, strict=True))
    row = {"benchmark": "checkpoint", "grains": grains, "contacts": log.last.health.contacts} | named
    return row | {"bytes_per_grain": round(path.stat().st_size / grains), "bytes": path.stat().st_size}


def repeated(world: World, folder: Path) -> World:
    """The same bed and its mirror images along both sides, without the tool."""
    scene, grains = world.scene, world.observe().grains
    box = scene.boundaries[0]
    low, size = np.array(box.low), np.subtract(box.high, box.low)
    position = repeat(grains.position - low, size[0], (TILES, 1))
    position = repeat(position, size[1], (1, TILES))
    file = folder / "bed.npz"
    np.savez(file, position=position + low, radius=np.tile(grains.radius.astype(float), TILES * TILES))
    wide = replace(box, high=tuple((low + size * [TILES, TILES, 1.0]).tolist()))
    fills = (Fill("bed", "sand", file=file),)
    return World(replace(scene, fills=fills, boundaries=(wide,), tools=(), settle=Settle()))


if __name__ == "__main__":
    main()
