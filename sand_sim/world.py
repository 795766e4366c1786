"""A running world: commands in, steps, observations out."""

from dataclasses import astuple, replace

import numpy as np

from sand_sim.assembly.assemble import Assembly, assemble
from sand_sim.assembly.scene_identity import describe_scene, digest
from sand_sim.assembly.tool_model import Progress, ToolModel
from sand_sim.border import CommandError, GrainContacts, Health, Observation, ToolContacts, ToolPose, ToolVelocity
from sand_sim.changes.carrying_over import describe_changes, expect_layout, fit
from sand_sim.changes.changing import Changeable
from sand_sim.engine.explicit_dem import ExplicitDem, UnstableError
from sand_sim.engine.state_check import check_layout, check_numbers
from sand_sim.engine.tools import ToolTrack
from sand_sim.readout.beforehand import find_coarseness, find_fine_surfaces, find_overlap
from sand_sim.readout.contact_reading import observe_grain_contacts, observe_tool_contacts
from sand_sim.readout.observing import (
    StartEnergy,
    observe_bodies,
    observe_grains,
    observe_health,
    observe_spheres,
    observe_tools,
    observe_walls,
    start_energy,
)
from sand_sim.readout.sweeping import SweptGround
from sand_sim.readout.trust import BLOWN_UP, GAINED, gained_share
from sand_sim.readout.wrenches import MeanWrenches
from sand_sim.scene.types import Scene
from sand_sim.settling import settle
from sand_sim.tool_motion.commands import Command, check_command, check_steps, pose_after
from sand_sim.tool_motion.track import SPEED_TOLERANCE, Track, travel

_FEWEST_BETWEEN = 100  # steps between two states that are kept, so that keeping them stays below 3 % of the time


class World(Changeable):
    """Grains, walls and tools of a scene, settled as it asks.

    Attributes:
        scene: it was made from.
        warnings: what the user should know before the run.
        identity: what a state must have in common with it, see ``scene_identity``; told now, because files may go.

    Args:
        scene: checked scene.
        progress: called with the name of a stage of the preparation and the share of it that is done, 0 to 1.

    Raises:
        SceneError: if the scene cannot be made into a world, or blows up while it settles.
    """

    def __init__(self, scene: Scene, progress: Progress = lambda stage, share: None):
        self.scene = scene
        self.assembly: Assembly = assemble(scene, progress)
        self._tool_index = {tool.name: k for k, tool in enumerate(scene.tools)}
        self._grounds = [Track.rest(ground.pose) for ground in self.assembly.grounds]
        self._set_tracks([Track.rest(tool.pose) for tool in scene.tools])
        self._solver.renew_lists()
        self._overlap = find_overlap(self.assembly)
        self._beforehand = self._overlap + find_fine_surfaces(self.assembly) + find_coarseness(self.assembly)
        self.warnings = self.assembly.warnings + settle(self.assembly, self._beforehand, progress)
        self._solver.begin()
        self._solver.engage_plungers()
        self._start = start_energy(self.assembly)
        self._wrenches = MeanWrenches(self._solver.arrays, self._turns, now=0)
        self._swept = SweptGround(observe_spheres(self.assembly), self.assembly.tools, self._poses)
        self._loaded = replace(self.assembly, solver=None)
        self.identity = describe_scene(self._loaded)
        self._digest = digest(self.identity)
        self._models: dict[tuple[int, str, float], ToolModel] = {}
        self._initial = self.save()
        self.reset()

    @property
    def _solver(self) -> ExplicitDem:
        return self.assembly.solver

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._solver.steps_done * self.time_step

    @property
    def steps(self) -> int:
        """Time steps since time zero."""
        return self._solver.steps_done

    @property
    def observed(self) -> bool:
        """Whether the present state has been observed."""
        return self._wrenches.steps == self.steps

    @property
    def time_step(self) -> float:
        """[s]."""
        return self.assembly.time_step.value

    @property
    def frame_steps(self) -> int:
        """Steps that make a frame at the scene's frame rate."""
        return self.assembly.frame_steps

    @property
    def tools(self) -> list[ToolModel]:
        """Tools with their meshes and particles, in the order of the scene."""
        return self.assembly.tools

    def check(self, command: Command) -> Command:
        """See that a command makes sense by itself, and bring its orientation to length one.

        Raises:
            CommandError: if the tool is unknown, or pose, velocity or time are not finite.
        """
        self._index_of(command.tool)
        return check_command(command)

    def pose_after(self, velocity: ToolVelocity, duration: float) -> ToolPose:
        """Where a velocity leads a tool from where it is, in a time [s], and when.

        Raises:
            CommandError: as ``check``, and if it is half a turn or more.
        """
        pose = pose_after(self.check(velocity), *self._tracks[self._tool_index[velocity.tool]].at(self.time), duration)
        return replace(pose, time=self.time + duration)

    def apply(self, command: ToolPose) -> None:
        """Set a tool on its way to a pose; without a time it gets there as fast as it may.

        Raises:
            CommandError: as ``check``, and if the time has passed or the tool would be too fast; the world is unchanged then.
        """
        if isinstance(command, ToolVelocity):
            raise CommandError("velocity", "a world moves tools to poses; give it those of 'pose_after(velocity, duration)'")
        command = self.check(command)
        tool, index, now = f"tool '{command.tool}'", self._tool_index[command.tool], self.time
        if command.time is not None and command.time <= now:
            raise CommandError("late", f"{tool}: time {command.time:.6f} s has passed, simulated time is {now:.6f} s")
        fastest, track = self.tools[index].tool.max_speed, self._tracks[index]
        # Most poses end between two steps; a tool that rested for the rest of the step would move less far than grains feel.
        begin = track.end_time if 0.0 <= now - track.end_time < self.time_step else now
        soonest = begin + self.travel(command) / fastest
        end = max(soonest, now + self.time_step) if command.time is None else command.time
        begin_position, begin_orientation = track.at(begin)
        speed = (soonest - begin) / (end - begin) * fastest
        if speed > fastest * SPEED_TOLERANCE:
            raise CommandError(
                "too_fast",
                f"{tool} would move at {speed:.3g} m/s, its max_speed is {fastest:.3g} m/s; from where it is, "
                f"{begin_position.round(4).tolist()}, command nearer poses or later times, or raise max_speed in the scene",
            )
        track = Track(begin, end, begin_position, command.position, begin_orientation, command.orientation)
        self._swept.pass_by(index, begin_position, begin_orientation)
        self._set_tracks([*self._tracks[:index], track, *self._tracks[index + 1 :]])

    def travel(self, command: ToolPose) -> float:
        """How far any point of the tool moves at most on its way from where it is to the commanded pose [m]."""
        index = self._tool_index[command.tool]
        return travel(self._tracks[index].at(self.time), (command.position, command.orientation), self.tools[index].reach)

    def arrival(self, tool: str) -> float:
        """When a tool reaches, or has reached, its last commanded pose [s]."""
        return self._tracks[self._tool_index[tool]].end_time

    def resting(self, tool: str) -> bool:
        """Whether a tool has reached its last commanded pose."""
        return self.time > self.arrival(tool) - 0.5 * self.time_step

    def step(self, steps: int = 1) -> None:
        """Advance by a number of time steps.

        Once a frame, and whenever it is observed, the state is kept if energy is in order.

        Raises:
            CommandError: as ``check_steps``.
            UnstableError: if the run has blown up; the world is then back in the last good state that was kept.
        """
        check_steps(steps)
        if self._measured and self._measured[0] == self._solver.steps_done:
            self._keep()
        every = max(self.frame_steps, _FEWEST_BETWEEN)
        for done in range(0, steps, every):
            try:
                self._solver.run(min(every, steps - done))
            except UnstableError as error:
                raise self._go_back(str(error)) from None
            if self._solver.steps_done >= self._kept_steps + every:
                self._keep()

    def observe(self) -> Observation:
        """What the world shows now; forces on tools are means since the last observation."""
        steps, health, spheres = self._solver.steps_done, self._health(), observe_spheres(self.assembly)
        cloud = observe_grains(self.assembly, spheres)
        means = self._wrenches.observe(self._solver.arrays, self._turns, steps)
        reports = observe_tools(self.assembly, self._tracks, cloud, self.time, means, self._sweep())
        bodies = observe_bodies(self.assembly, cloud)
        return Observation(self.time, steps, cloud, reports, observe_walls(self.assembly), health, bodies, spheres)

    def feel(self, tool: str) -> tuple[np.ndarray, np.ndarray]:
        """Force of the sand on a tool and torque about its frame's origin, world frame, shape (3,) each [N], [N m].

        Means over the steps since it was last felt. Nothing else is read, so that a controller may do so every few steps.

        Raises:
            CommandError: if the tool is unknown.
        """
        return tuple(self._wrenches.feel(self._solver.arrays, self._index_of(tool), self.steps))

    def tool_contacts(self, tool: str) -> ToolContacts:
        """Every contact of a tool with grains now, with its force; read when asked for, so that no frame pays for it.

        Raises:
            CommandError: if the tool is unknown.
        """
        self._index_of(tool)
        self._health()
        return observe_tool_contacts(self.assembly, tool)

    def grain_contacts(self) -> GrainContacts:
        """Every contact between grains now, with its force: for force chains, coordination numbers and stresses."""
        self._health()
        return observe_grain_contacts(self.assembly)

    @property
    def _poses(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return [track.at(self.time) for track in self._tracks]

    @property
    def _turns(self) -> list[np.ndarray]:
        return [track.at(self.time)[1] for track in [*self._tracks, *self._grounds]]

    def _index_of(self, tool: str) -> int:
        if tool not in self._tool_index:
            raise CommandError("unknown_tool", f"tool '{tool}' is unknown; known are {', '.join(self._tool_index) or 'none'}")
        return self._tool_index[tool]

    def _sweep(self) -> np.ndarray:
        """Volumes swept by the tools up to now, shape (tools,) [m^3]."""
        return self._swept.advance(self._poses)

    def reset(self) -> None:
        """Go back to time zero."""
        self.restore(self._initial)

    def save(self) -> dict[str, np.ndarray]:
        """The whole state as plain arrays; put back with ``restore`` it goes on to the bit."""
        self._solver.renew_lists()  # as the next step would; so a state is the same whether somebody has looked or not
        state = self._solver.take_state()
        for name in Track.__dataclass_fields__:
            state[f"track.{name}"] = np.array([getattr(track, name) for track in self._tracks])
        self._sweep()
        state |= self._swept.save() | describe_changes(self.assembly, self._loaded) | {"scene": self._digest}
        state["start"], state["observed_steps"] = np.array(astuple(self._start)), np.array(self._wrenches.steps)
        if self._wrenches.wrench is not None:
            state["observed_wrench"] = self._wrenches.wrench
        return state

    def check_state(self, state: dict[str, np.ndarray]) -> None:
        """See that a state from a file can be put back: kernels trust the numbers in it as places in memory.

        Raises:
            ValueError: if it cannot; nothing is changed then.
        """
        check_layout(state, expect_layout(self._initial, state))
        fitting = fit(self.assembly, self._loaded, self._models, state)
        check_numbers(fitting.solver.arrays, state)

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Put a state from ``save`` back; grains that have been added or removed since, and tools, become what they were.

        Raises:
            ValueError: if the state is of another scene; nothing is changed then.
        """
        fitting = fit(self.assembly, self._loaded, self._models, state)
        check_layout(state, expect_layout(self._initial, state))
        self.assembly = fitting
        self._solver.put_state(state)
        self._tracks = [Track(*row) for row in zip(*(state[f"track.{name}"] for name in Track.__dataclass_fields__), strict=True)]
        self._look_anew()
        self._swept.restore(state)
        self._start = StartEnergy(*(float(value) for value in state["start"]))
        observed = int(state["observed_steps"]), state.get("observed_wrench")
        self._wrenches = MeanWrenches(self._solver.arrays, self._turns, self.steps, *observed)
        self._good, self._good_health, self._kept_steps = state, self._health(), self._solver.steps_done

    def _health(self) -> Health:
        """Error indicators, measured once a step even where a state is both kept and observed."""
        steps = self._solver.steps_done
        if self._measured is None or self._measured[0] != steps:
            self._measured = (steps, observe_health(self.assembly, self._start, self._beforehand))
        return self._measured[1]

    def _keep(self) -> None:
        """Keep the present state to fall back on, unless energy has come from nowhere.

        Raises:
            UnstableError: if most of the energy there is came from nowhere.
        """
        health = self._health()
        if not gained_share(health) < BLOWN_UP:
            raise self._go_back(f"{health.gained:.3g} J, most of the energy there is, appeared from nowhere")
        if gained_share(health) < GAINED and self._kept_steps != self._solver.steps_done:
            self._good, self._good_health = self.save(), health
            self._kept_steps = self._solver.steps_done

    def _go_back(self, cause: str) -> UnstableError:
        """Restore the last good state, and make the error to raise, which names the cause."""
        blown = self.time
        self.restore(self._good)
        safe = self.assembly.safe_step(self._good_health.fastest, self._good_health.deepest)
        remedy = f"a time step of {0.995 * safe:.3g} s would be safe, it is {self.time_step:.3g} s"  # not more when rounded
        if self._overlap or self.time_step < 1.01 * safe:
            doubts = "; ".join(self._good_health.doubts) or "look for bodies that overlap or are too fast"
            remedy = f"the time step of {self.time_step:.2g} s is not at fault: {doubts}"
        return UnstableError(f"blown up at t = {blown:.6g} s: {cause}; kept is the state at t = {self.time:.6g} s; {remedy}")

    def _set_tracks(self, tracks: list[Track]) -> None:
        self._tracks, structs = tracks, []
        for track in [*tracks, *self._grounds]:
            one = ToolTrack()
            one.begin_time, one.end_time = track.begin_time, track.end_time
            one.begin_position, one.begin_rotation = track.begin_position, track.begin_orientation
            one.velocity, one.spin = track.velocity, track.spin
            structs.append(one)
        if structs:
            self._solver.arrays.tools.set_tracks(structs)
