"""Shared memory that is large enough for clouds, where the middleware is Fast DDS and nobody has chosen otherwise."""

import os
import shutil

from sand_sim.config_folder import config_folder

_CHOSEN_BY = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_BUILTIN_TRANSPORTS")
_SHARED_MEMORY = "/dev/shm"
_LEAST_FREE = 2**29  # bytes; containers often have 64 MB, which the segment would overflow


def enlarge_shared_memory() -> None:
    """Name our profile to Fast DDS; to be called before the middleware starts."""
    other = os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp") != "rmw_fastrtps_cpp"
    if other or any(name in os.environ for name in _CHOSEN_BY):
        return
    try:
        free = shutil.disk_usage(_SHARED_MEMORY).free
    except OSError:
        return
    if free >= _LEAST_FREE:
        os.environ[_CHOSEN_BY[0]] = str(config_folder() / "ros" / "fastdds.xml")
