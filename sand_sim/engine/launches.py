"""Which kernels a scene launches, found without launching any, so that they are compiled side by side before the first step."""

import warp as wp

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.measuring import record_measurement
from sand_sim.engine.stages import Stages, record_run


class LaunchList:
    """A recorder that only notes which kernels are launched.

    Attributes:
        lanes: as other recorders have it.
        kernels: in the order of their first launch.
    """

    def __init__(self, lanes: int):
        self.lanes, self.kernels = lanes, {}

    def each(self, launched, over, inputs, wait=True):
        """Note a kernel."""
        self.share(launched, inputs)

    def share(self, launched, inputs, wait=True):
        """Note a kernel."""
        self.kernels[launched] = None

    once = share

    def when(self, flag, body):
        """Note what may be launched."""
        body()

    repeat = when

    def wait(self):
        """Lanes are of no interest here."""


def list_kernels(arrays: DemArrays, stages: Stages) -> list[wp.Kernel]:
    """All kernels of a scene's steps and measurements."""
    listing = LaunchList(arrays.lanes)
    record_run(arrays, stages, listing)
    record_measurement(arrays, stages, listing)
    return list(listing.kernels)


def load_kernels(arrays: DemArrays, stages: Stages, workers: int) -> None:
    """Compile what is not in Warp's cache, on several threads, and load it all."""
    modules = [kernel.module for kernel in list_kernels(arrays, stages)]
    wp.force_load(arrays.grains.place.device, modules, max_workers=workers)
