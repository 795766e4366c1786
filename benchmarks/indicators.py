"""What the error indicators of every run cost: time of looking at a world once a frame, over the time of the frame's steps.

Prints one JSON line. Run from the root of the source tree: ``python -m benchmarks.indicators [SCENE]``.
"""

import argparse
import json
import time

import numpy as np

from benchmarks.provenance import provenance
from sand_sim import World, load_scene
from sand_sim.config_folder import find_scene

FRAMES = 7


def main() -> None:
    """Time frames and looks in turn."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("scene", nargs="?", default="dig", help="scene file or name (default: %(default)s)")
    scene = load_scene(find_scene(parser.parse_args().scene))
    world = World(scene)
    steps, looks = [], []
    for _ in range(FRAMES + 1):
        begin = time.perf_counter()
        world.step(world.frame_steps)
        middle = time.perf_counter()
        health = world.observe().health
        steps.append(middle - begin)
        looks.append(time.perf_counter() - middle)
    share = float(np.median(np.array(looks[1:]) / np.array(steps[1:])))  # the first look compiles
    row = {"benchmark": "indicators", "scene": scene.name, "frame_s": float(np.median(steps[1:]))}
    row |= {"look_s": float(np.median(looks[1:])), "share": round(share, 5), "doubts": list(health.doubts)}
    print(json.dumps(row | provenance()))


if __name__ == "__main__":
    main()
