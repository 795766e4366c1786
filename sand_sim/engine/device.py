"""Which device a scene runs on."""

from sand_sim.engine.lanes import CpuDevice


def open_device(name: str, threads: int | None):
    """Open a device.

    Args:
        name: ``auto`` or ``cpu``.
        threads: cores to use; all available if None.

    Raises:
        ValueError: if there is no such device.
    """
    if name in ("auto", "cpu"):
        return CpuDevice(threads)
    raise ValueError(f"unknown device '{name}'; known are auto and cpu")
