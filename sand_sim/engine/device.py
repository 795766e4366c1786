"""Which device a scene runs on.

A device has a ``name`` for Warp and a ``label`` for people; ``lanes`` into which populations are cut (``count.Count``);
``shares`` among which launches by ``share`` are cut; it is ``wide`` if many threads work on one lane, and has ``vectors`` if a
thread does many contacts at once. It loads kernels and records programs.
"""

import re

from sand_sim.engine.cuda import CudaDevice
from sand_sim.engine.lanes import CpuDevice


def open_device(name: str, threads: int | None) -> CpuDevice | CudaDevice:
    """Open a device.

    Args:
        name: ``auto`` or ``cpu``; ``cuda``, or ``cuda:1`` for the second GPU. The CPU comes first until a GPU has run the tests.
        threads: cores to use on a CPU; all available if None.

    Raises:
        ValueError: if there is no such device.
    """
    if name in ("auto", "cpu"):
        return CpuDevice(threads)
    if re.fullmatch(r"cuda(:\d+)?", name):
        return CudaDevice(name)
    raise ValueError(f"unknown device '{name}'; known are auto, cpu, cuda, cuda:0 and so on")
