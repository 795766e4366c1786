"""The verb ``bench`` on a tiny case, and beds made of mirror images."""

import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks.beds import RADIUS, repeat

PATIENCE = 120.0


def bench(folder, *words):
    command = [sys.executable, "-m", "sand_sim", "bench", *map(str, words)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=PATIENCE)


def write_bed(folder, spacing):
    """1,000 grains on a lattice in place of a settled bed."""
    beds = folder / "beds"
    beds.mkdir(exist_ok=True)
    lattice = np.stack(np.meshgrid(range(7), range(7), range(21), indexing="ij"), -1).reshape(-1, 3)
    np.savetxt(beds / "bed_1000.xyz", RADIUS + spacing * lattice)
    return beds


def test_one_line_per_case_and_number_of_cores(tmp_path):
    beds = write_bed(tmp_path, 0.00203)
    done = bench(tmp_path, "W1-1000", "--beds", beds, "--threads", 1, 2, "--rounds", 3, "--work", 3e4, "--out", "lines.jsonl")
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["threads"] for row in rows] == [1, 2]
    for row in rows:
        assert row["grains"] == row["spheres"] == 1029
        speed = row["grain_steps_per_second"]
        assert 0.0 < speed["least"] <= speed["median"] <= speed["most"]
        assert row["ns_per_grain_and_step"]["median"] * speed["median"] == pytest.approx(1e9, rel=1e-3)
        assert {"bytes_per_sphere", "coordination_number", "time_step_s", "doubts", "commit", "device", "versions"} <= set(row)
    assert (tmp_path / "lines.jsonl").read_text() == done.stdout


def test_a_doubtful_run_has_no_speed(tmp_path):
    beds = write_bed(tmp_path, 0.0014)
    done = bench(tmp_path, "W1-1000", "--beds", beds, "--threads", 1, "--rounds", 1, "--work", 3e4)
    assert done.returncode == 1
    (row,) = map(json.loads, done.stdout.splitlines())
    assert row["failed"]
    assert "grain_steps_per_second" not in row


def test_cases_are_listed_and_others_refused(tmp_path):
    assert {"W1-8000", "W2", "W3", "scaling", "cold-start", "node"} <= set(bench(tmp_path, "--list").stdout.split())
    done = bench(tmp_path, "W9")
    assert done.returncode == 1
    assert done.stderr.startswith("sand_sim: bench: unknown case 'W9'; known are W1-1000")
    assert len(done.stderr.strip().splitlines()) == 1


def test_mirror_images_are_no_nearer_to_each_other_than_grains_and_walls_were():
    random, width = np.random.default_rng(1), 0.01
    bed = random.uniform(0.97 * RADIUS, width - 0.97 * RADIUS, (60, 3))
    images = repeat(bed, width, (3, 2))
    assert images.shape == (360, 3)
    assert np.array_equal(images[:60], bed)
    assert images[:, 0].max() < 3 * width
    assert images[:, 1].max() < 2 * width

    def nearest(points):
        distance = np.linalg.norm(points[:, None] - points[None], axis=2)
        return distance[~np.eye(len(points), dtype=bool)].min()

    walls = min(bed[:, :2].min(), (width - bed[:, :2]).min())
    assert nearest(images) >= min(nearest(bed), 2.0 * walls) - 1e-12
