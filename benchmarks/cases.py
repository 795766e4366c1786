"""The cases of ``sand_sim bench``."""

from collections.abc import Iterator

from benchmarks.cold_start import time_cold_start
from benchmarks.node_load import time_node
from benchmarks.scaling import time_scaling
from benchmarks.speed import SPEED_CASES, Setup, time_speed

FURTHER = {
    "scaling": ("time and memory per grain from 1,000 to 1,000,000 grains, on all cores", time_scaling),
    "cold-start": ("time until the first step, with nothing compiled, all compiled, one number changed", time_cold_start),
    "node": ("what the ROS node adds to the time of steps, and its latency", time_node),
}
CASES = SPEED_CASES | {name: what for name, (what, _) in FURTHER.items()}
USUAL = ("W1-8000", "W1-32000", "W2", "W3")


def run_cases(names: list[str], setup: Setup) -> Iterator[dict]:
    """Run cases, those of speed together in turn; one row for each thing measured."""
    speed = [name for name in names if name in SPEED_CASES]
    if speed:
        yield from time_speed(speed, setup)
    for name in names:
        if name in FURTHER:
            yield from FURTHER[name][1](setup)
