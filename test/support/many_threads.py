"""The CUDA device's way of sharing work out, on a CPU: the same launch sizes, lanes, shares and sorts, only one after another."""

import numpy as np
import warp as wp

from sand_sim.engine.cuda import CudaDevice, CudaRecorder


class ManyThreads(CudaDevice):
    """A stand-in for a GPU.

    Args:
        threads: most threads of a launch; few, so that each takes several items.
        shares: of what is walked through in order.
        eager: launch at once instead of recording; conditions are then read by Python.
        vectors: as on a CPU, because compilers may round otherwise where they do many contacts at once; false as on a GPU.
    """

    def __init__(self, threads=100, shares=37, eager=False, vectors=True):
        self.name = self.label = "cpu"
        self.threads, self.shares, self.eager, self.vectors = threads, shares, eager, vectors

    def record(self, program, steps=None):
        return (lambda: program(CudaRecorder(self))) if self.eager else super().record(program)


class ShuffledThreads(ManyThreads):
    """The same with the threads of each launch in another order every time: what hangs on it would be a race on a GPU."""

    def __init__(self, threads=7, shares=5, seed=0):
        super().__init__(threads, shares, eager=True, vectors=False)
        self.random = np.random.default_rng(seed)

    def record(self, program, steps=None):
        return lambda: program(_ShuffledRecorder(self))


class _ShuffledRecorder(CudaRecorder):
    def each(self, launched, over, inputs, wait=True):
        number = over.get()
        threads = min(number, self._device.threads)
        for k in self._device.random.permutation(threads):
            self._launch(launched, 1, [0, wp.array([k, number], dtype=int, device="cpu"), threads, *inputs])

    def share(self, launched, inputs, wait=True):
        for k in self._device.random.permutation(self._device.shares):
            self._launch(launched, 1, [int(k), self._device.shares, *inputs])
