"""The history of a run, frame by frame, and what is said about it in the end."""

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from sand_sim.border import Observation
from sand_sim.scene.types import Scene, Tool
from sand_sim.track import phases_at, phases_of

_STILL = 1e-4  # [m/s] horizontal speed below which a tool has no draft


@dataclass
class RunLog:
    """Collects one row per observation.

    Attributes:
        scene: what is run.
        started: wall clock at the start [s].
        rows: values of each frame by name.
        last: the last observation.
        scenes: the observation at the end of each phase of a trajectory, by the phase's name.
        fault: why the run stopped before its end, empty if it did not.
    """

    scene: Scene
    started: float = field(default_factory=time.monotonic)
    rows: list[dict] = field(default_factory=list)
    last: Observation | None = None
    scenes: dict[str, Observation] = field(default_factory=dict)
    fault: str = ""

    def write(self, observation: Observation) -> None:
        """Add one observation."""
        health = observation.health
        for phase in phases_at(self.scene, observation.time):
            self.scenes[phase] = observation
        row = {
            "time": observation.time,
            "wall": time.monotonic() - self.started,
            "steps": observation.steps,
            "contacts": health.contacts,
            "deepest": health.deepest,
            "kinetic": health.kinetic,
            "dissipated": health.dissipated,
            "momentum_residual": health.momentum_residual,
        }
        for tool in observation.tools:
            row[f"{tool.name}.position"] = tool.position
            row[f"{tool.name}.velocity"] = tool.velocity
            row[f"{tool.name}.force"] = tool.world_force
            row[f"{tool.name}.torque"] = tool.torque
            row[f"{tool.name}.carried"] = tool.carried
        for wall in observation.walls:
            if wall.name in self._plungers:
                row[f"wall.{wall.name}.position"], row[f"wall.{wall.name}.force"] = wall.position, wall.force
        self.rows.append(row)
        self.last = observation

    @property
    def _plungers(self) -> set[str]:
        return {boundary.name for boundary in self.scene.boundaries if boundary.drive}

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time so far."""
        return self.rows[-1]["time"] / max(self.rows[-1]["wall"], 1e-9) if self.rows else 0.0

    def columns(self) -> dict[str, np.ndarray]:
        """All rows as arrays: times, shape (frames,), and vectors, shape (frames, 3)."""
        return {name: np.array([row[name] for row in self.rows]) for name in (self.rows[0] if self.rows else ())}

    def summarise(self) -> dict:
        """What a run comes down to, SI units."""
        if self.last is None:
            return {"steps": 0}
        columns, health = self.columns(), self.last.health
        energies = {name: getattr(health, name) for name in ("tool_work", "kinetic", "potential", "elastic", "dissipated")}
        summary = {
            "grains": len(self.last.grains),
            "retired_grains": health.retired,
            "steps": self.last.steps,
            "time_step_s": health.time_step,
            "simulated_s": self.last.time,
            "wall_s": columns["wall"][-1],
            "real_time_factor": self.real_time_factor,
            "contacts": health.contacts,
            "largest_momentum_residual": np.nanmax(columns["momentum_residual"], initial=0.0),
            "largest_overlap_over_radius": health.deepest,
            "energy_J": energies,
            "doubts": [*health.doubts, *([self.fault] if self.fault else [])],
            "tools": {tool.name: _summarise_tool(columns, tool) for tool in self.scene.tools},
        }
        return json.loads(json.dumps(summary, default=float))

    def save(self, folder: Path, name: str) -> list[Path]:
        """Write ``name.npz`` (all columns, the last bed) and ``name.json`` (the summary) to a folder; return their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        grains = {f"bed.{key}": value for key, value in asdict(self.last.grains).items()}
        history, summary = folder / f"{name}.npz", folder / f"{name}.json"
        np.savez_compressed(history, **self.columns(), **grains)
        summary.write_text(json.dumps(self.summarise(), indent=2) + "\n")
        return [history, summary]


def _summarise_tool(columns: dict[str, np.ndarray], tool: Tool) -> dict:
    """Peaks of the forces, and where the trajectory has a phase ``carry`` the masses carried and spilled in it.

    Draft is the force against the tool's horizontal motion, lift the downward force of the sand that lifting has to overcome.
    """
    force, velocity = columns[f"{tool.name}.force"], columns[f"{tool.name}.velocity"]
    carried, time = columns[f"{tool.name}.carried"], columns["time"]
    speed = np.linalg.norm(velocity[:, :2], axis=1)
    draft = -np.sum(force[:, :2] * velocity[:, :2], axis=1) / np.maximum(speed, _STILL)
    summary = {"peak_draft_N": draft.max(initial=0.0) + 0.0, "peak_lift_N": (-force[:, 2]).max(initial=0.0) + 0.0}
    begin, end = phases_of(tool.trajectory).get("carry", (np.inf, np.inf))
    during = np.flatnonzero((time >= begin) & (time <= end))
    if len(during):
        summary["carried_kg"] = carried[during[-1]]
        summary["spilled_kg"] = carried[during[0]] - carried[during[-1]]
        summary["carried_weight_N"] = np.mean(-force[during, 2])
    return summary
