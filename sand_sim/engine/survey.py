"""What a world launches, found without launching it, so that all of it is compiled side by side before the first step."""

from collections.abc import Callable

import warp as wp

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.count import Count
from sand_sim.engine.kernel import fill_gaps
from sand_sim.engine.measuring import record_measurement
from sand_sim.engine.stages import Stages, record_run


class Survey:
    """A recorder that only notes which kernels are launched.

    Attributes:
        kernels: the kernels, by their names, in the order in which they are first launched.
    """

    def __init__(self, device):
        self.lanes, self.wide, self.vectors, self._device = device.lanes, device.wide, device.vectors, device.name
        self.kernels = {}

    def each(self, launched: wp.Kernel, over: Count, inputs: list, wait: bool = True) -> None:
        """Note a launch over all items of a population."""
        self._note(launched, [0, over.spans, 1, *inputs])

    def share(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Note a launch over all shares."""
        self._note(launched, [0, 1, *inputs])

    def once(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Note a launch of a single thread."""
        self._note(launched, inputs)

    def when(self, flag: wp.array, body: Callable[[], None], otherwise: Callable[[], None] | None = None) -> None:
        """Note what the bodies launch."""
        body()
        if otherwise:
            otherwise()

    repeat = when

    def wait(self) -> None:
        """Lanes are of no interest here."""

    def _note(self, launched: wp.Kernel, inputs: list) -> None:
        fill_gaps(launched, inputs, self._device)  # makes the dummies, for which there is no room once a capture has begun
        self.kernels[launched.key, launched.module.name] = launched


def list_kernels(arrays: DemArrays, stages: Stages, device) -> list[wp.Kernel]:
    """All kernels of a world's steps and measurements on a device."""
    survey = Survey(device)
    record_run(arrays, stages, survey)
    record_measurement(arrays, stages, survey)
    return list(survey.kernels.values())
