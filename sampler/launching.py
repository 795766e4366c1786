"""Getting kernels ready, and launching one on all cores."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from itertools import pairwise

import numpy as np
import warp as wp

from sampler.compiling import compile_modules
from sampler.cores import available_cores

_MODULES = ("spreading", "crossing", "surface", "cells", "rays", "topology")  # that all bodies need; what takes longest first
_TOGETHER = 2000  # items below which a second core is not worth its start
_loaded: set[str] = set()  # devices


def load_kernels(device: str, progress: Callable[[], None]) -> None:
    """Compile the kernels that all bodies need side by side, where they are not in Warp's cache; once in a process.

    Args:
        device: Warp device.
        progress: called now and then; may raise to give up.
    """
    if device not in _loaded:
        modules = [wp.get_module(f"sampler_{name}") for name in _MODULES]
        compile_modules(modules, device, min(available_cores(), len(modules)), lambda share: progress())
        _loaded.add(device)


def launch_shares(kernel, number: int, inputs: list, outputs: list, device: str) -> None:
    """Launch a kernel whose argument before the outputs is its first item; on a CPU each core takes a share of the items."""
    cores = available_cores() if str(device) == "cpu" and number >= _TOGETHER else 1

    def run(first, last):
        wp.launch(kernel, dim=int(last - first), inputs=[*inputs, int(first), *outputs], device=device)

    wp.load_module(kernel.module, device)
    if cores == 1:
        run(0, number)
        return
    shares = []
    try:
        for ends in pairwise(np.linspace(0, number, 4 * cores + 1).astype(int)):
            shares.append(_pool(cores).submit(run, *ends))
        for share in shares:
            share.result()
    finally:  # also at Ctrl-C: arrays must not go while shares write to them
        for share in shares:
            share.cancel()
        wait(shares)


@cache
def _pool(cores: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores, thread_name_prefix="sampler")
