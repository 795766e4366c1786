"""A blade in sand, against forces measured in a laboratory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_draft_is_that_measured_in_washed_sand():
    """Obermayr et al. 2011: 820 N on the mean at 0.2 m; a quarter is what sands and laboratories differ by."""
    command = [sys.executable, "-m", "benchmarks.blade", "--depth", "0.2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["draft_N"] == pytest.approx(820.0, rel=0.25)
    assert report["doubts"] == []
