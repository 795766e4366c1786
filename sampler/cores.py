"""How many cores there are to work on."""

import os
from pathlib import Path

_QUOTA = Path("/sys/fs/cgroup/cpu.max")  # of the group of processes: microseconds it may use of so many, on all cores together


def available_cores() -> int:
    """Cores this process may use; of a container that may use a share of the machine, as many as that share is worth."""
    # Only Linux says which cores a process may use.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = _QUOTA.read_text().split()
        return min(cores, max(1, round(int(quota) / int(period))))
    except (OSError, ValueError):  # none, or "max"
        return cores
