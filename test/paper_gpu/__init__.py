"""Kernels made for NVIDIA GPUs, run where there is none: ``python -m pytest -p paper_gpu`` with this folder's parent on the path.

Warp then finds a GPU. Its kernels are compiled for CUDA as always, the PTX that comes of it runs on the CPU, and graphs, streams
and memory are those of ``paper_gpu.gpu``. What a driver refuses, and how fast a GPU is, cannot be seen with it.
"""

import warp as wp

from paper_gpu.entry_points import EntryPoints
from paper_gpu.gpu import Gpu

GPU = Gpu()


def _install() -> None:
    """Before Warp is initialized."""
    from warp._src.context import Runtime

    load = Runtime.load_dll

    def load_dll(runtime, path):
        library = load(runtime, path)
        return library if "clang" in str(path) else EntryPoints(library, GPU)

    Runtime.load_dll = load_dll
    wp.config.cuda_output = "ptx"


_install()


def pytest_addoption(parser):
    parser.addoption("--always-on-it", action="store_true", help="scenes that ask for a CPU run on the paper GPU, too")


def pytest_configure(config):
    if config.getoption("--always-on-it"):
        from sand_sim.engine import device

        device.CpuDevice = lambda threads: device.CudaDevice("cuda")


def pytest_terminal_summary(terminalreporter):
    terminalreporter.write_line(
        f"paper GPU: {len(GPU.launches)} kernels, {sum(GPU.launches.values())} launches, {GPU.graphs} graphs"
    )
