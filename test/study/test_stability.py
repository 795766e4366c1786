"""The stability study: its verdicts, a handful of its cases, its verb; the whole sweep is slow."""

import json
import subprocess
import sys

import numpy as np
import pytest

from sand_sim import UnstableError
from sand_sim.integrator import EULER, VERLET
from sand_sim.scene.stable_step import particles_touched, stable_step
from sand_sim.study.bench import Bench
from sand_sim.study.stability import all_cases, sweep, table_text
from sand_sim.study.stability_map import limits_found, run_cell
from sand_sim.study.verdict import FLAGGED, REFUSED, RIGHT, WRONG, Case, Check, examine

# Every group, quick ones, chosen for what they would catch.
HANDFUL = {
    "E = 7e+10 Pa, impact at 1 m/s": RIGHT,
    "impact at 100 m/s, E = 1e+07 Pa": FLAGGED,
    "e = 0.05, impact on a plane": RIGHT,
    "e = 0.05, confined bed, overlap 5 % of a radius": RIGHT,
    "mu = 2, on a slope": RIGHT,
    "grain that spins at 10,000 rad/s lands on a floor": RIGHT,
    "grain of 10 um, at rest": RIGHT,
    "grain of 10 um, E = 7e+10 Pa, in a wide domain, single": FLAGGED,
    "1e+06, heavy rests on light": RIGHT,
    "100 g, falls and bounces": RIGHT,
    "10 km from the origin, single": RIGHT,
    "tool at 10 m/s hits a grain, E = 7e+10 Pa": RIGHT,
    "jumps 0.3 m in one step": REFUSED,
    "one grain inside a hollow tool": FLAGGED,
    "overlap of half a radius": FLAGGED,
    "overlap of half a radius, settled first": FLAGGED,
    "10 times the safe one": REFUSED,
    "10 times the safe one, forced": FLAGGED,
}


@pytest.mark.parametrize("name", HANDFUL)
def test_cases(name):
    (case,) = [case for case in all_cases() if case.name == name]
    finding = examine(case)
    assert finding.verdict == HANDFUL[name], finding.reason
    assert not finding.bad
    assert bool(finding.reason) == (finding.verdict != RIGHT)


def test_every_extreme_has_cases():
    groups = {case.group for case in all_cases(quick=True)}
    assert groups >= {"stiffness", "speed", "restitution", "friction", "size", "size ratio", "mass ratio", "gravity", "place"}
    assert groups >= {"crushing", "tool", "start", "own time step"}


def falling(bench, **solver):
    world = bench.make([0.0, 0.0, 0.006], 0.005, [0.0, 0.0, -1.0], solver=solver)
    world.step(3)
    return world


def test_a_silent_error_is_called_one():
    def run(bench):
        falling(bench)
        yield Check("one", 1.0, 2.0, 0.1)

    finding = examine(Case("group", "name", run))
    assert finding.verdict == WRONG
    assert finding.bad
    assert finding.reason == "one is 1, must be 2"


def test_what_is_not_a_number_is_an_error():
    assert not Check("one", float("nan"), 0.0, 1e9).passed


def test_an_automatic_step_must_be_stable():
    def run(bench):
        falling(bench)
        raise UnstableError("blown up")
        yield

    assert examine(Case("group", "name", run)).bad
    assert not examine(Case("group", "name", run, violent=True)).bad
    assert not examine(Case("group", "name", run, automatic=False)).bad


@pytest.mark.parametrize("integrator", [EULER, VERLET])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.74, 4.0])
def test_predicted_limit_is_that_of_the_integrator(integrator, ratio):
    """Against the eigenvalues of one step of a damped oscillator of frequency one."""

    def largest(dt):
        w, c = dt, 2.0 * ratio * dt  # frequency and damping in units of the step
        if integrator == EULER:
            step = [[1.0 - w * w, 1.0 - c], [-w * w, 1.0 - c]]
        else:
            step = [[1.0, 1.0, 1.0], [0.0, 1.0, 1.0], [-w * w, -w * w - c, -w * w - 1.5 * c]]
        return np.abs(np.linalg.eigvals(np.array(step))).max()

    limit = stable_step(1.0, 2.0 * ratio, integrator)
    assert largest(0.999 * limit) <= 1.0 + 1e-9
    assert largest(1.001 * limit) > 1.0 + 1e-9


def test_particles_touched_are_counted_right():
    """Against a triangular lattice counted out."""
    grain, particle, spacing, overlap = 5e-3, 2.5e-4, 3.75e-4, 5e-5
    rows = np.arange(-60, 61)
    x = (rows[None, :] + 0.5 * (rows[:, None] % 2)) * spacing
    y = np.broadcast_to(rows[:, None] * spacing * np.sqrt(3.0) / 2.0, x.shape)
    height = grain + particle - overlap
    counted = (np.sqrt(x**2 + y**2 + height**2) < grain + particle).sum()
    assert particles_touched(grain, particle, spacing, overlap) == pytest.approx(counted, rel=0.1)


@pytest.mark.parametrize(("scene", "ratio", "stable"), [("impact", 0.05, True), ("impact", 2.0, False), ("bed", 0.7, True)])
def test_map(tmp_path, scene, ratio, stable):
    cell = run_cell(Bench(tmp_path), scene, 1e7, ratio)
    assert cell.stable == stable
    assert cell.verdict == (RIGHT if stable else FLAGGED)


def test_picture_and_table(tmp_path):
    pytest.importorskip("matplotlib")
    from sand_sim.study.stability import Sweep
    from sand_sim.study.stability_figure import draw_map

    cells = [run_cell(Bench(tmp_path), "impact", young, ratio) for young in (1e6, 1e9) for ratio in (0.05, 3.0)]
    draw_map(cells, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000
    result = Sweep([], cells)
    assert result.bad == []
    assert [limit[2:] for limit in limits_found(cells)] == [(0.05, 3.0)] * 2
    assert "E = 1e+09 Pa: 0.05 and 3" in table_text(result)
    result.save(tmp_path / "stability.json")
    assert len(json.loads((tmp_path / "stability.json").read_text())["map"]) == 4


@pytest.mark.slow
def test_the_whole_sweep(tmp_path):
    """The verb as users type it."""
    command = [sys.executable, "-m", "sand_sim", "stability", "--out", "results", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=1200, check=False)
    result = json.loads(done.stdout)
    assert result["bad"] == []
    assert done.returncode == 0
    assert {one["verdict"] for one in result["cases"]} == {RIGHT, FLAGGED, REFUSED}
    assert all(limit["unstable_at"] is None or limit["unstable_at"] > 0.85 for limit in result["limits_found"])
    assert (tmp_path / "results" / "stability.png").is_file()


@pytest.mark.slow
def test_the_quick_sweep():
    shares = []
    assert sweep(quick=True, progress=lambda what, share: shares.append(share)).bad == []
    assert shares == sorted(shares)
