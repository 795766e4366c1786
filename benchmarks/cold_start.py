"""How long it takes until the first step: with nothing compiled yet, with all of it compiled, and with one number changed.

Processes of their own load a scene, leave out its settling, step once and observe. The cold one finds Warp's cache of kernels
and the sampler's cache of bodies empty, as on a new machine. Then the warm ones make the scene again with another friction.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.provenance import ROOT, provenance

BEGIN = "SAND_SIM_BENCH_BEGIN"  # environment: when the process was started [s]
CHANGES = 5


def time_cold_start(setup, scene: str = "dig") -> Iterator[dict]:
    """Rows for a cold and a warm start and for a changed number; the warm ones are medians over rounds."""
    with tempfile.TemporaryDirectory() as folder:
        setup.progress("cold start", 0.0)
        cold = _start(scene, Path(folder), setup.progress)
        warm = []
        for k in range(setup.rounds):
            setup.progress("warm start", k / setup.rounds)
            warm.append(_start(scene, Path(folder), setup.progress))
        setup.progress("warm start", 1.0)
    for name, starts in (("cold", [cold]), ("warm", warm)):
        middle = {key: round(statistics.median(one[key] for one in starts), 3) for key in cold if key != "changed_s"}
        yield {"benchmark": "cold-start", "case": name, "scene": scene} | middle | provenance()
    changed = [seconds for one in warm for seconds in one["changed_s"]]
    figures = {"median": statistics.median(changed), "least": min(changed), "most": max(changed)}
    row = {"benchmark": "cold-start", "case": "changed number", "scene": scene}
    yield row | {"seconds": {key: round(value, 4) for key, value in figures.items()}} | provenance()


def _start(scene: str, caches: Path, progress) -> dict:
    """Times of one process."""
    places = {"WARP_CACHE_PATH": str(caches / "warp"), "SAMPLER_CACHE": str(caches / "sampler")}
    command = [sys.executable, "-m", "benchmarks.cold_start", scene]
    environment = os.environ | places | {BEGIN: repr(time.time())}
    child = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        while True:
            try:
                output, _ = child.communicate(timeout=0.2)
                break
            except subprocess.TimeoutExpired:
                progress("starting", 0.0)
    finally:
        if child.poll() is None:
            child.kill()
            child.wait()
    return json.loads(output)


def main() -> None:
    """Time this process, in wall seconds since its start; to be run by ``time_cold_start``."""
    if BEGIN not in os.environ:
        sys.exit("this is one of the processes that are timed by: sand_sim bench cold-start")
    begin = float(os.environ[BEGIN])
    from sand_sim import World, load_scene
    from sand_sim.config_folder import find_scene

    imported = time.time()
    scene = load_scene(find_scene(sys.argv[1]))
    scene = replace(scene, settle=replace(scene.settle, time=0.0))
    world = World(scene)
    made = time.time()
    _step(world)
    report = {"total_s": time.time() - begin, "import_s": imported - begin, "world_s": made - imported}
    report |= {"first_step_s": time.time() - made, "processor_s": time.process_time(), "changed_s": []}
    for k in range(CHANGES):
        pairs = tuple(replace(pair, numbers=pair.numbers | {"friction": 0.4 + 0.01 * k}) for pair in scene.pairs)
        again = time.time()
        _step(World(replace(scene, pairs=pairs)))
        report["changed_s"].append(time.time() - again)
    print(json.dumps(report))


def _step(world) -> None:
    world.step(1)
    world.observe()


if __name__ == "__main__":
    main()
