"""Steps while other programs keep the cores busy: one thread, and as many as there are cores or as are quickest.

Prints one JSON line for each number of other programs. Run from the root of the source tree: ``python -m benchmarks.busy_cores``.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.provenance import provenance
from sand_sim import World, load_scene
from sand_sim.config_folder import find_scene

_ROUNDS, _SECONDS = 3, 4.0  # of each world in turn


def pace(world: World) -> float:
    """Time of a step [s]."""
    begin, before = time.perf_counter(), world.steps
    while time.perf_counter() < begin + _SECONDS:
        world.step(100)
    return (time.perf_counter() - begin) / (world.steps - before)


def main() -> None:
    """Time both worlds in turn beside more and more programs."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("scene", nargs="?", default="hopper", help="scene file or name (default: %(default)s)")
    scene = load_scene(find_scene(parser.parse_args().scene))
    worlds = {name: World(replace(scene, solver=replace(scene.solver, threads=n))) for name, n in (("one", 1), ("all", None))}
    for number in (0, 1, os.cpu_count(), 2 * os.cpu_count()):
        others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(number)]
        try:
            paces = {name: [] for name in worlds}
            for _ in range(_ROUNDS):
                for name, world in worlds.items():
                    paces[name].append(pace(world))
        finally:
            for other in others:
                other.kill()
                other.wait()
        row = {"benchmark": "busy-cores", "scene": scene.name, "grains": len(worlds["one"].observe().grains), "others": number}
        row |= {f"{name}_us": round(1e6 * float(np.median(some)), 1) for name, some in paces.items()}
        print(json.dumps(row | provenance()), flush=True)


if __name__ == "__main__":
    main()
