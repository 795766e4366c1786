"""Which kernels a world launches, so that they are compiled side by side before the first step."""

import warp as wp

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.lanes import available_cores
from sand_sim.engine.measuring import record_measurement
from sand_sim.engine.stages import Stages, record_run
from sand_sim.engine.survey import Survey


def list_kernels(arrays: DemArrays, stages: Stages, device) -> list[wp.Kernel]:
    """All kernels of a world's steps and measurements on a device."""
    survey = Survey(device)
    record_run(arrays, stages, survey)
    record_measurement(arrays, stages, survey)
    return list(survey.kernels.values())


def load_kernels(arrays: DemArrays, stages: Stages, device) -> None:
    """Compile what is not in Warp's cache, on several threads, and load it all; a GPU does so when it records."""
    if not device.wide:
        modules = [kernel.module for kernel in list_kernels(arrays, stages, device)]
        wp.force_load(device.name, modules, max_workers=available_cores())
