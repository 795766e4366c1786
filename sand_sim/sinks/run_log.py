"""The history of a run, frame by frame, and what is said about it in the end."""

import json
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from uuid import uuid4

import numpy as np

from sand_sim.border import Observation, ToolReport
from sand_sim.readout.trust import kind_of
from sand_sim.scene.types import Scene, Tool
from sand_sim.scene.walls import walls_of
from sand_sim.tool_motion.track import phases_at, phases_of

_STILL = 1e-4  # [m/s] horizontal speed below which a tool has no draft
# What each row holds of the world's health, and of every tool, by the attribute of its report.
_PEAKS_OF_HEALTH = "momentum_residual", "gained"
_OF_HEALTH = ("contacts", "deepest", "kinetic", "dissipated", "momentum_residual")
_OF_TOOL = {name: name for name in ("position", "orientation", "velocity", "torque", "carried")} | {"force": "world_force"}
_LOADS = "force_N", "draft_N", "pull_N", "lift_N", "bearing_N", "torque_Nm"


@dataclass(frozen=True)
class View:
    """What is drawn of a moment.

    Attributes:
        time: simulated [s].
        position: of all spheres, shape (n, 3) [m].
        radius: shape (n,) [m].
        speed: shape (n,) [m/s].
        tool_position: of the tools' frames, shape (tools, 3) [m].
        tool_orientation: tool frames to world frame, shape (tools, 4).
    """

    time: np.ndarray
    position: np.ndarray
    radius: np.ndarray
    speed: np.ndarray
    tool_position: np.ndarray
    tool_orientation: np.ndarray

    @classmethod
    def of(cls, observation: Observation) -> "View":
        """What is drawn of an observation."""
        spheres, tools = observation.spheres, observation.tools
        return cls(
            np.array(observation.time),
            spheres.position,
            spheres.radius,
            spheres.speed,
            np.array([tool.position for tool in tools]).reshape(-1, 3),
            np.array([tool.orientation for tool in tools]).reshape(-1, 4),
        )


@dataclass
class RunLog:
    """Collects one row per observation.

    Attributes:
        scene: what is run.
        started: wall clock at the start [s], later by what was left out.
        rows: values of each frame by name.
        last: the last observation.
        views: the bed at the end of each phase of a trajectory, by the phase's name.
        fault: why the run stopped before its end, empty if it did not.
        interrupted: whether the user stopped it.
        identity: the same before and after a run has been resumed.
        peaks: largest values of all frames by name, also of those that are given up.
        doubted: when the run was last doubted [s] and why, by the kind of the doubt, of all frames.
        most_rows: how many are kept; beyond, every other one is given up, and from then on every other frame is written.
    """

    scene: Scene
    started: float = field(default_factory=time.monotonic)
    rows: list[dict] = field(default_factory=list)
    last: Observation | None = None
    views: dict[str, View] = field(default_factory=dict)
    fault: str = ""
    interrupted: bool = False
    identity: str = field(default_factory=lambda: uuid4().hex)
    peaks: dict[str, float] = field(default_factory=dict)
    doubted: dict[str, tuple[float, str]] = field(default_factory=dict)
    most_rows: int = 2**31
    _every: int = 1
    _frames: int = 0
    _steps: int = -1  # at the last frame

    def write(self, observation: Observation) -> None:
        """Add one observation; a moment that is there already, before a checkpoint, is not added again."""
        health, self.last = observation.health, observation
        if observation.steps == self._steps:
            return
        self._steps = observation.steps
        for phase in phases_at(self.scene, observation.time):
            self.views[phase] = View.of(observation)
        self.doubted |= {kind_of(doubt): (observation.time, doubt) for doubt in health.doubts}
        seen = {name: getattr(health, name) for name in _PEAKS_OF_HEALTH}
        for tool in observation.tools:
            seen |= {f"{tool.name}.{name}": value for name, value in _loads_of(tool).items()}
        self.peaks |= {name: max(self.peaks.get(name, 0.0), float(value)) for name, value in seen.items()}  # past NaN
        number, self._frames = self._frames, self._frames + 1
        if number % self._every:
            return
        row = {"time": observation.time, "wall": time.monotonic() - self.started, "steps": observation.steps}
        row |= {name: getattr(health, name) for name in _OF_HEALTH}
        row |= {f"{tool.name}.{name}": getattr(tool, part) for tool in observation.tools for name, part in _OF_TOOL.items()}
        for wall in observation.walls:  # those of one name are one
            row[f"wall.{wall.name}.force"] = row.get(f"wall.{wall.name}.force", 0.0) + wall.force
            if wall.name in self._plungers:
                row[f"wall.{wall.name}.position"] = wall.position
        self.rows.append(row)
        if len(self.rows) > self.most_rows:
            self.rows, self._every = self.rows[::2], 2 * self._every

    def leave_out(self, since: float) -> None:
        """Leave the time since a moment of the wall clock [s], in which the run was held, out of what it has taken."""
        self.started += time.monotonic() - max(since, self.started)

    @property
    def _names(self) -> set[str]:
        """Of all columns."""
        names = {"time", "wall", "steps", *_OF_HEALTH} | {f"{tool.name}.{name}" for tool in self.scene.tools for name in _OF_TOOL}
        boundaries = self.scene.boundaries
        walls = [*(wall for one in boundaries for wall in walls_of(one)), *(one for one in boundaries if one.terrain)]
        return names | {f"wall.{one.name}.force" for one in walls} | {f"wall.{name}.position" for name in self._plungers}

    @property
    def _peak_names(self) -> set[str]:
        """Of all peaks."""
        return {*_PEAKS_OF_HEALTH} | {f"{tool.name}.{name}" for tool in self.scene.tools for name in _LOADS}

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

    def pack(self) -> dict[str, np.ndarray]:
        """All but the last observation as plain arrays, for a checkpoint."""
        views = {phase: vars(view).items() for phase, view in self.views.items()}
        packed = {"identity": np.array(self.identity), "thinned": np.array([self._every, self._frames, self._steps])}
        packed |= {f"row/{name}": column for name, column in self.columns().items()}
        packed |= {f"peak/{name}": np.array(value) for name, value in self.peaks.items()}
        packed["doubts"] = np.array([[repr(float(time)), doubt] for time, doubt in self.doubted.values()], str).reshape(-1, 2)
        return packed | {f"view/{phase}/{name}": array for phase, items in views.items() for name, array in items}

    def unpack(self, packed: dict[str, np.ndarray]) -> None:
        """Go on from what ``pack`` gave, as if no time had passed meanwhile.

        Raises:
            ValueError: if that was another run's.
        """
        columns, peaks, views = {}, {}, {}
        for name, array in packed.items():
            kind, _, name_there = name.partition("/")
            if kind == "row":
                columns[name_there] = array
            elif kind == "peak":
                peaks[name_there] = array
            elif kind == "view":
                phase, _, part = name_there.rpartition("/")
                views.setdefault(phase, {})[part] = array
        if packed and (columns.keys() != self._names or peaks.keys() != self._peak_names):
            raise ValueError("history: not of this scene")
        try:
            rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
            views = {phase: View(**parts) for phase, parts in views.items()}
            peaks = {name: float(peak) for name, peak in peaks.items()}
            wall = float(rows[-1]["wall"]) if rows else 0.0
            doubts = {kind_of(str(doubt)): (float(time), str(doubt)) for time, doubt in packed.get("doubts", ())}
            every, frames, steps = (int(number) for number in packed.get("thinned", (1, 0, -1)))
        except TypeError as error:
            raise ValueError(f"history: {error}") from None
        if every < 1:
            raise ValueError(f"history: every {every}th frame")
        self.rows, self.views, self.started = rows, views, time.monotonic() - wall
        self.peaks, self._every, self._frames, self._steps = peaks, every, frames, steps
        self.doubted = doubts
        self.identity = str(packed.get("identity", self.identity))

    def summarise(self) -> dict:
        """What a run comes down to, SI units."""
        if self.last is None:
            return {"steps": 0}
        columns, health = self.columns(), self.last.health
        energies = {name: getattr(health, name) for name in ("tool_work", "kinetic", "potential", "elastic", "dissipated")}
        energies["gained"] = self.peaks["gained"]  # what is dissipated afterwards hides it
        lasting = {kind_of(doubt) for doubt in health.doubts}
        passed = [f"{doubt} (at t = {time:.3g} s)" for kind, (time, doubt) in self.doubted.items() if kind not in lasting]
        summary = {
            "grains": len(self.last.grains),
            "retired_grains": health.retired,
            "steps": self.last.steps,
            "time_step_s": health.time_step,
            "simulated_s": self.last.time,
            "interrupted": self.interrupted,
            "wall_s": columns["wall"][-1],
            "real_time_factor": self.real_time_factor,
            "contacts": health.contacts,
            "largest_momentum_residual": self.peaks["momentum_residual"],
            "largest_overlap_over_radius": health.deepest,
            "energy_J": energies,
            "doubts": [*health.doubts, *passed, *([self.fault] if self.fault else [])],
            "tools": {tool.name: _summarise_tool(columns, tool, self.peaks) for tool in self.scene.tools},
        }
        return json.loads(json.dumps(summary, default=float))

    def save_history(self, path: Path) -> None:
        """Write all columns and the last bed to an npz file."""
        grains = {f"bed.{key}": value for key, value in asdict(self.last.grains).items()}
        np.savez_compressed(path, **self.columns(), **grains)

    def save_summary(self, path: Path, origin: dict) -> None:
        """Write the summary to a JSON file, with what the run was made from and with."""
        path.write_text(json.dumps(self.summarise() | origin, indent=2) + "\n")


def _loads_of(tool: ToolReport) -> dict[str, float]:
    """What a tool bears now.

    Draft is the force against its horizontal motion and pull that along it, as a wheel's; lift is the downward force of the sand
    that lifting has to overcome and bearing the upward one; torque is about the origin of the tool's frame.
    """
    along, force = tool.velocity[:2], tool.world_force
    draft = -force[:2] @ along / max(np.linalg.norm(along), _STILL)
    loads = np.linalg.norm(force), draft, -draft, -force[2], force[2], np.linalg.norm(tool.torque)
    return dict(zip(_LOADS, map(float, loads), strict=True))


def _summarise_tool(columns: dict[str, np.ndarray], tool: Tool, peaks: dict[str, float]) -> dict:
    """Peaks of the loads, and where the trajectory has a phase ``carry`` the masses carried and spilled in it."""
    force, carried, time = columns[f"{tool.name}.force"], columns[f"{tool.name}.carried"], columns["time"]
    summary = {f"peak_{name}": peaks[f"{tool.name}.{name}"] for name in _LOADS}
    begin, end = phases_of(tool.trajectory).get("carry", (np.inf, np.inf))
    during = np.flatnonzero((time >= begin) & (time <= end))
    if len(during):
        summary["carried_kg"] = carried[during[-1]]
        summary["spilled_kg"] = carried[during[0]] - carried[during[-1]]
        summary["carried_weight_N"] = np.mean(-force[during, 2])
    return summary
