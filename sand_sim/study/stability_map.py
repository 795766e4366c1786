"""The map of stability: stiffness against time step over the predicted limit, for one impact and for a confined bed."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sand_sim.contact.damping import damping_ratio
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.integrator import VERLET
from sand_sim.scene.stable_step import grain_share, stable_step
from sand_sim.study.bed_cases import confined_scene
from sand_sim.study.bench import GRAIN, Bench, plane
from sand_sim.study.closed_forms import impact_limit, impact_overlap, impact_time, plane_modulus, sphere_mass
from sand_sim.study.verdict import FLAGGED, RIGHT, WRONG

STOPPED = "stopped"
_RADIUS = 0.005  # [m]
_SPEED = 0.1  # [m/s]
_PHASES = 8  # impacts that begin at different moments within a step
_OVERLAP, _RESTITUTION = 0.05, 0.5  # of the bed
_RIGHT = {"impact": 0.02, "bed": 1.0}
_YOUNGS = (1e5, 1e6, 1e7, 1e8, 1e9, 7e10)
_RATIOS = (0.02, 0.05, 0.08, 0.14, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0, 1.2, 1.45, 2.0, 3.0)


@dataclass(frozen=True)
class Cell:
    """One run of the map.

    Attributes:
        scene: ``impact`` or ``bed``.
        young: modulus [Pa].
        ratio: time step over the predicted limit [1].
        automatic: the automatic step over the predicted limit [1].
        error: of an impact the largest relative error of the rebound speed, of a bed its kinetic energy over that at the start;
            infinite where the run was stopped.
        verdict: ``right``, ``flagged``, ``stopped`` or ``silently wrong``.
        reason: why it was flagged or stopped.
    """

    scene: str
    young: float
    ratio: float
    automatic: float
    error: float
    verdict: str
    reason: str

    @property
    def stable(self) -> bool:
        """Whether the outcome is bounded by what physics allows: no more speed, no more energy than at the start."""
        return self.error <= 1.0


def grid(quick: bool) -> list[tuple[str, float, float]]:
    """Scene, modulus [Pa] and time step over the predicted limit of all cells."""
    youngs = _YOUNGS[::2] if quick else _YOUNGS
    ratios = _RATIOS[::2] if quick else _RATIOS
    return [(scene, young, ratio) for scene in ("impact", "bed") for young in youngs for ratio in ratios]


def run_cell(bench: Bench, scene: str, young: float, ratio: float) -> Cell:
    """Run one cell, forcing its time step."""
    make = _impact if scene == "impact" else _bed
    parsed, limit, steps, judge = make(bench, young, ratio)
    automatic = bench.open(parsed | {"solver": parsed["solver"] | {"time_step": None}}).assembly.time_step.safe
    parsed["solver"] |= {"time_step": ratio * limit, "force_time_step": True}
    world = bench.open(parsed)
    start = world.observe()
    try:
        world.step(steps)
    except UnstableError as error:
        return Cell(scene, young, ratio, automatic / limit, float("inf"), STOPPED, str(error))
    end = world.observe()
    error = judge(start, end)
    doubts = "; ".join(end.health.doubts)
    verdict = FLAGGED if doubts else RIGHT if error <= _RIGHT[scene] else WRONG
    return Cell(scene, young, ratio, automatic / limit, error, verdict, doubts)


def limits_found(cells: list[Cell]) -> Iterator[tuple[str, float, float, float]]:
    """Scene, modulus, and the two neighbouring ratios between which the runs cease to be stable."""
    for scene, young in dict.fromkeys((cell.scene, cell.young) for cell in cells):
        row = sorted((c for c in cells if (c.scene, c.young) == (scene, young)), key=lambda c: c.ratio)
        unstable = [cell.ratio for cell in row if not cell.stable]
        first = min(unstable, default=float("inf"))
        yield scene, young, max((c.ratio for c in row if c.ratio < first), default=0.0), first


def _impact(bench: Bench, young: float, ratio: float):
    """Grains that hit a rigid plane, each at another moment within a step."""
    mass, modulus = float(sphere_mass(_RADIUS, GRAIN["density"])), plane_modulus(young, GRAIN["poisson"])
    limit = impact_limit(mass, _RADIUS, modulus, _SPEED)
    dt, contact = ratio * limit, impact_time(impact_overlap(mass, _RADIUS, modulus, _SPEED), _SPEED)
    gaps = _SPEED * dt * (1.0 + np.arange(_PHASES) / _PHASES)
    points = np.column_stack([4.0 * _RADIUS * np.arange(_PHASES), np.zeros(_PHASES), _RADIUS + gaps])
    parsed = bench.scene(
        points,
        _RADIUS,
        [0.0, 0.0, -_SPEED],
        grain={"young": young},
        restitution=1.0,
        boundaries=[plane()],
        domain={"low": [-1.0, -1.0, -1.0], "high": [1.0, 1.0, 1.0]},
    )

    def judge(_, end) -> float:
        lost = len(end.grains) < _PHASES
        return float("inf") if lost else float(np.abs(end.grains.velocity[:, 2] / _SPEED - 1.0).max())

    return parsed, limit, int(np.ceil((2.0 * dt + 1.5 * contact) / dt)) + 4, judge


def _bed(bench: Bench, young: float, ratio: float):
    """A close-packed bed under pressure, slightly shaken."""
    parsed = confined_scene(bench, young, _RESTITUTION, 0.5, _OVERLAP)
    mass = float(sphere_mass(_RADIUS, GRAIN["density"]))
    stiffness = plane_modulus(young, GRAIN["poisson"]) * np.sqrt(0.5 * _RADIUS * _OVERLAP * _RADIUS)
    damping = 2.0 * damping_ratio(_RESTITUTION, 1.5) * np.sqrt(0.5 * stiffness * mass)
    share = grain_share(rotation=True, contacts=12.0)
    limit = stable_step(share * stiffness / mass, share * damping / mass, VERLET)
    steps = int(np.clip(100.0 / ratio, 200, 2000))
    return parsed, limit, steps, lambda start, end: end.health.kinetic / start.health.kinetic
