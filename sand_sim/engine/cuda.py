"""Run recorded stages on an NVIDIA GPU.

A program, with its loop over steps and all it does only now and then, becomes one CUDA graph: the loop is a conditional node, so
the host is not asked until the frame is over. Launches follow one another, so nobody waits; there is one lane, whose items many
threads take in strides, and shares of what has to be walked through in order are many.

Every item and every sum is computed by the same code in the same order as on a CPU; what differs is how the compilers round. Two
things hang on which thread comes first, and no motion hangs on them: the order in which retired grains lie, and the last digits
of the energy that they have carried off.
"""

from collections.abc import Callable
from functools import partial

import warp as wp

from sampler.compiling import compile_modules
from sampler.cores import available_cores
from sand_sim.engine.count import Count
from sand_sim.engine.kernel import fill_gaps
from sand_sim.engine.lanes import RECORDING

_SHARES = 4096  # sums over all shares are serial, walks through one share too; for a million items this balances them
_BLOCK = 128  # threads; contact kernels need many registers
_THREADS_PER_MULTIPROCESSOR = 2048
_WAVES = 8  # of threads, before they take more than one item each


class CudaRecorder:
    """What a stage records itself on; see ``lanes.LaneRecorder`` for what its methods promise."""

    lanes = 1
    wide = True

    def __init__(self, device: "CudaDevice"):
        self._device, self.vectors = device, device.vectors

    def each(self, launched: wp.Kernel, over: Count, inputs: list, wait: bool = True) -> None:
        """Launch over all items of a population: thread k takes items k, k + stride and so on."""
        if over.capacity:
            threads = min(over.capacity, self._device.threads)
            self._launch(launched, threads, [0, over.spans, threads, *inputs])

    def share(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Launch one thread a share."""
        self._launch(launched, self._device.shares, [0, self._device.shares, *inputs])

    def once(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Launch a single thread."""
        self._launch(launched, 1, inputs)

    def when(self, flag: wp.array, body: Callable[[], None], otherwise: Callable[[], None] | None = None) -> None:
        """Run the body's launches only if ``flag[0]`` is not zero then, and those of ``otherwise`` if it is."""
        wp.capture_if(flag, on_true=body, on_false=otherwise)

    def repeat(self, flag: wp.array, body: Callable[[], None]) -> None:
        """Run the body's launches as long as ``flag[0]`` is not zero."""
        wp.capture_while(flag, body)

    def wait(self) -> None:
        """Launches follow one another."""

    def _launch(self, launched: wp.Kernel, size: int, inputs: list) -> None:
        name = self._device.name
        wp.launch(launched, dim=size, inputs=fill_gaps(launched, inputs, name), device=name, block_dim=_BLOCK)


class CudaDevice:
    """One NVIDIA GPU.

    Attributes:
        name: of the Warp device.
        label: what a user is told.
        lanes: one; see ``count.Count``.
        shares: threads of a launch by ``share``.
        portion: steps in one run at most; all that are asked for.
        threads: most threads of a launch by ``each``.
        wide: many threads work on one population at once.
        vectors: no thread does many contacts at once.

    Args:
        name: ``cuda``, or ``cuda:1`` and so on.

    Raises:
        ValueError: if there is no such device, or its driver is too old.
    """

    lanes = 1
    shares = _SHARES
    portion = 2**31 - 1
    wide, vectors = True, False

    def __init__(self, name: str = "cuda"):
        present = [device.alias for device in wp.get_cuda_devices()]
        driver, toolkit = wp.get_cuda_driver_version(), wp.get_cuda_toolkit_version()
        if driver and toolkit and driver < (toolkit[0], 0):  # Warp shows no GPU then
            least = f"an NVIDIA driver for CUDA {toolkit[0]} or newer, and this one is for {driver[0]}.{driver[1]}"
            raise ValueError(f"'{name}' needs {least}; use cpu, or update the driver")
        if not present:
            raise ValueError(f"'{name}' needs an NVIDIA GPU and its driver, and none is found here; use auto or cpu")
        if name not in ("cuda", *present):
            raise ValueError(f"there is no '{name}'; present are {', '.join(present)}, and cpu")
        if not wp.is_conditional_graph_supported():
            raise ValueError(f"'{name}' needs an NVIDIA driver for CUDA 12.4 or newer; use cpu, or update the driver")
        device = wp.get_device(name)
        self.name, self.label = device.alias, f"{device.alias}, {device.name}"
        self.threads = device.sm_count * _THREADS_PER_MULTIPROCESSOR * _WAVES

    def load(self, kernels: list[wp.Kernel], progress: Callable[[str, float], None]) -> None:
        """Compile what is not in Warp's cache, on several threads, and load it all; nothing can be loaded while recording."""
        modules, told = (kernel.module for kernel in kernels), partial(progress, "compiling kernels")
        compile_modules(modules, self.name, available_cores(), told, block_dim=_BLOCK)

    def record(self, program: Callable[[CudaRecorder], None], steps: wp.array | None = None) -> Callable[[], None]:
        """Record a program as one graph.

        Args:
            program: launches its stages on the recorder it is given, of kernels that have been loaded.
            steps: of no interest here.

        Returns:
            A function that sets the recorded program going. Reading an array waits until it is done.
        """
        with RECORDING, wp.ScopedCapture(device=self.name) as capture:
            program(CudaRecorder(self))
        return lambda: wp.capture_launch(capture.graph)

    def synchronize(self) -> None:
        """Wait until all that was set going is done."""
        wp.synchronize_device(self.name)
