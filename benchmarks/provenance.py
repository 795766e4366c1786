"""Where a figure comes from: commit, device, versions."""

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[1]


def provenance(threads: int | None = None) -> dict:
    """Commit, device and versions, for the JSON line of a benchmark.

    Args:
        threads: cores used; all if None.
    """
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return {
        "commit": commit.stdout.strip() or "unknown",
        "device": f"{processor_name()}, {threads or os.cpu_count()} threads",
        "versions": {name: version(name) for name in ("warp-lang", "numpy")} | {"python": platform.python_version()},
    }


def processor_name() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())
