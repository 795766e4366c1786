"""The benchmark of the GPU."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from many_threads import ManyThreads

from benchmarks import gpu
from benchmarks.beds import WIDTHS
from benchmarks.speed import Setup

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(wp.is_cuda_available(), reason="this machine has a GPU")
def test_without_a_gpu_it_says_so_in_one_line():
    command = [sys.executable, "-m", "benchmarks.gpu"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("gpu: needs an NVIDIA GPU")
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_its_measures_make_sense(tmp_path, monkeypatch):
    """On the stand-in, with a bed of a few grains, two by two."""
    lattice = np.stack(np.meshgrid(range(5), range(5), range(4), indexing="ij"), -1).reshape(-1, 3)
    np.savez(tmp_path / "tile_8000.npz", position=0.001 + 0.00199 * lattice, radius=np.full(len(lattice), 0.001))
    monkeypatch.setattr("sand_sim.assembly.assemble.open_device", lambda name, threads: ManyThreads(1000, 64))
    monkeypatch.setattr(gpu, "CASES", {"small": (2, 2)})
    monkeypatch.setitem(WIDTHS, "tile_8000", 0.01)
    monkeypatch.setattr(gpu, "COPIED", 2**22)
    for name in ("SETTLE", "STEPS", "CYCLES"):
        monkeypatch.setattr(gpu, name, 2)
    row = gpu.measure("small", Setup(None, tmp_path, (1,), 1, 0.0, lambda stage, share: None))
    assert row["grains"] == 400
    assert row["least_bytes_per_second"] > 0.0
    assert set(row["microseconds_per_stage"]) >= {"pair forces", "move grains", "sort grains", "list contacts"}
