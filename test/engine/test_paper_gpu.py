"""What is made for GPUs runs where there is none (see ``paper_gpu``). Each test is a run of pytest that finds such a GPU."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TEST = Path(__file__).parents[1]


def run(*arguments):
    """Number of tests that passed on the paper GPU; none may fail, and its kernels must have run."""
    command = [sys.executable, "-m", "pytest", "-p", "paper_gpu", "-p", "no:cacheprovider", "-m", "not slow", *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TEST), *sys.path])}
    done = subprocess.run(command, cwd=TEST.parent, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-1000:]
    assert int(re.search(r"paper GPU: (\d+) kernels", done.stdout).group(1)) > 0, done.stdout
    return int(re.search(r"(\d+) passed", done.stdout).group(1))


def test_it_is_as_unkind_as_a_gpu():
    assert run(TEST / "paper_gpu" / "check_paper_gpu.py") >= 10


def test_grains_on_it_move_as_on_the_cpu():
    assert run(TEST / "engine" / "test_cuda.py") >= 22


def test_bodies_sampled_on_it_are_those_of_the_cpu():
    assert run(TEST / "sampler" / "test_sampler_cuda.py") >= 8


@pytest.mark.slow
def test_all_that_holds_on_the_cpu_holds_on_it():
    """Laws, neighbour lists, walls, tools and bodies, against closed forms and the NumPy reference."""
    assert run("--always-on-it", TEST / "engine", TEST / "contact", TEST / "changes") > 400
