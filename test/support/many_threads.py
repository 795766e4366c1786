"""The CUDA device's way of sharing work out, on a CPU: the same launch sizes, lanes, shares and sorts, only one after another."""

from sand_sim.engine.cuda import CudaDevice, CudaRecorder


class ManyThreads(CudaDevice):
    """A stand-in for a GPU.

    Args:
        threads: most threads of a launch; few, so that each takes several items.
        shares: of what is walked through in order.
        eager: launch at once instead of recording; conditions are then read by Python.

    Attributes:
        vectors: as on a CPU, because compilers may round otherwise where they do many contacts at once.
    """

    vectors = True

    def __init__(self, threads=100, shares=37, eager=False):
        self.name = self.label = "cpu"
        self.threads, self.shares, self.eager = threads, shares, eager

    def record(self, program):
        return (lambda: program(CudaRecorder(self))) if self.eager else super().record(program)
