"""The ball shot into a bed, against eight other codes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REPORTED = {"displacement_20ms_mm": -102.1, "displacement_25ms_mm": -124.0, "displacement_30ms_mm": -138.2, "deepest_mm": -138.5}


def run(*words):
    command = [sys.executable, "-m", "benchmarks.dosta_ball", *map(str, words)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_missing_data_are_refused_in_one_line(tmp_path):
    done = run("--data", tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("dosta_ball: --data: ")
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_ball_goes_as_deep_as_in_eight_other_codes(tmp_path):
    data = Path(os.environ.get("DOSTA_DATA", ROOT.parent / "shared/data/dosta"))
    if not data.is_dir():
        pytest.skip(f"needs the data set of the case in {data}, or where DOSTA_DATA says")
    done = run("--data", data, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["grains"] == 25_001
    assert report["retired"] == 0
    assert report["steps"] == 68_000
    for name, expected in REPORTED.items():
        assert report[name] == pytest.approx(expected, abs=1.0), name
    assert (tmp_path / "dosta_ball.png").stat().st_size > 10_000
