"""Where tools have been told to go: which commands are taken, when each begins, and why the others are refused.

In lockstep every command must carry a time, and times of one tool must rise. Otherwise

    without a time                 it replaces all before it, and is reached after the simulated time since the command before
    time ahead of the simulation   it waits for its turn and is reached at its time, however much comes after it
    time just behind               (measured poses that come in with a delay) as without one, but reached after the time between
                                   its stamp and the stamp before
    the time of the one before     (a clock that ticks more seldom) it takes the place of that one and is given as much time
    time before the one before     refused as ``out_of_order``, in lockstep also the same time: which of two counts would depend
                                   on which comes before time goes on
    time too far behind            refused as ``too_old``
    time too far ahead             refused as ``future``: mostly a stamp of the wall clock

After a gap a stream begins anew: its first pose is reached after the length of a gap. A velocity holds for a while only, so that
a tool stops when whoever drives it is gone. Commands that were on their way when time was set back are forgotten as soon as one
comes whose stamp can only be of the time after that.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from sand_sim.border import CommandError, ToolPose, ToolVelocity
from sand_sim.tool_motion.commands import Command, in_world
from sand_sim.world import World

_MOST_WAITING = 100_000
_LESS_THAN_HALF = 3.0  # [rad] of a turn


@dataclass(frozen=True)
class StampRules:
    """Limits on the times that commands carry, in simulated seconds.

    Attributes:
        oldest: how far a stamp may lie behind [s].
        furthest: how far it may lie ahead [s].
        gap: commands farther apart than this belong to two streams [s].
        hold: how long a velocity lasts unless the next one comes [s].
        relative: whether stamps are of another clock; the first one means one gap from now, the others are counted from it.
    """

    oldest: float = 0.5
    furthest: float = 60.0
    gap: float = 0.2
    hold: float = 0.2
    relative: bool = False


USUAL = StampRules()


@dataclass
class Course:
    """What one tool has been told.

    Attributes:
        waiting: commands whose turn has not come.
        last_stamp: of the last good command that had one [s].
        followed_stamp: of the last command with one that was carried out at once [s].
        last_taken: when the last command was taken [s].
        promised: time of the last command that is reached at its own time [s]; stepping is allowed up to there in lockstep.
    """

    waiting: deque[Command] = field(default_factory=deque)
    last_stamp: float = -np.inf
    followed_stamp: float = -np.inf
    last_taken: float = -np.inf
    promised: float = -np.inf


class Courses:
    """The courses of all tools of a world.

    Args:
        world: whose tools they are.
        lockstep: whether time waits for the commands.
        rules: limits on stamps.

    Attributes:
        limited: number of commands that were slowed to keep to ``max_speed``.
        delays: longest time by which ``max_speed`` made a tool late [s], by its name.
        unstamped: number of poses without a time that were carried out.
        alike: number of commands with the time of the one before, which have taken its place.
        shift: from the clock of relative stamps to simulated time [s]; None before the first of them.
        placed: tools that their first pose, since the start or a reset, puts where it says instead of sending them there.
    """

    def __init__(self, world: World, lockstep: bool, rules: StampRules):
        self.lockstep, self.rules = lockstep, rules
        self.limited = self.unstamped = self.alike = 0
        self.delays: dict[str, float] = {}
        self.placed: frozenset[str] = frozenset()
        self._world, self._has_placed = world, False
        self.clear()

    def clear(self) -> None:
        """Forget all commands, after which time may begin anew."""
        self.by_tool = {tool.name: Course() for tool in self._world.scene.tools}
        self.shift: float | None = None
        self._old_from: dict[str, float] = {}

    def heed_late_ones(self, before: float) -> None:
        """Expect commands that are still on their way with stamps of the time that has been left [s]."""
        self._old_from = dict.fromkeys(self.by_tool, before - self.rules.oldest)

    @property
    def promised(self) -> float:
        """Time up to which every tool that has been commanded knows where to go [s]; minus infinity if none has been."""
        return min((course.promised for course in self.by_tool.values() if course.promised > -np.inf), default=-np.inf)

    def awaited(self) -> list[str]:
        """Tools without whose next command time does not go on in lockstep; all while none is driven."""
        driven = {name: course.promised for name, course in dict(self.by_tool).items() if course.promised > -np.inf}
        soon = self._world.time + self._world.time_step
        return [name for name, promised in driven.items() if promised < soon] if driven else [*self.by_tool]

    def next_begin(self) -> float:
        """When the next waiting command begins [s]; infinity if none waits."""
        return min((self._world.arrival(name) for name, course in self.by_tool.items() if course.waiting), default=np.inf)

    def place(self, tool: str, position, orientation=None) -> None:
        """As ``World.place_tool``, and what the tool has been told is forgotten."""
        self._world.place_tool(tool, position, orientation)
        self.by_tool[tool] = Course(last_taken=self._world.time)

    def take(self, commands: list[Command], reject: Callable[[CommandError], None]) -> bool:
        """Check commands that came in together and carry them out, or let them wait.

        Of those of one tool that replace each other only the last good one is carried out.

        Returns:
            Whether a tool has been put somewhere else.
        """
        self._has_placed = False
        good: list[Command] = []
        for command in commands:
            if self._ends_late_ones(command):
                good = [one for one in good if one.tool != command.tool]
            if checked := self._checked(command, reject):
                good.append(checked)
        last = {command.tool: k for k, command in enumerate(good) if not self._waits(command)}
        replaced: set[str] = set()
        # From the last to the first, so that one that cannot be carried out leaves its place to the one before.
        for k, command in reversed(list(enumerate(good))):
            if k <= last.get(command.tool, -1) and command.tool not in replaced and self._done(self._replace, command, reject):
                replaced.add(command.tool)
        for k, command in enumerate(good):
            if k > last.get(command.tool, -1):
                self._done(self._append, command, reject)
        self.begin_waiting(reject)
        return self._has_placed

    def begin_waiting(self, reject: Callable[[CommandError], None]) -> None:
        """Set the tools that have arrived on their way to what waits for them."""
        for name, course in self.by_tool.items():
            while course.waiting and self._world.resting(name):
                try:
                    command = course.waiting.popleft()
                    if isinstance(command, ToolVelocity):
                        self._move(course, command, command.time)
                    else:
                        self._world.apply(command)
                    break
                except CommandError as error:
                    reject(error)

    @staticmethod
    def _done(act: Callable[[Command], None], command: Command, reject: Callable[[CommandError], None]) -> bool:
        try:
            act(command)
        except CommandError as error:
            reject(error)
            return False
        return True

    def _ends_late_ones(self, command: Command) -> bool:
        """Whether it is the first of its tool that was surely meant for the time now, after others, which are forgotten here."""
        old_from, tool = self._old_from.get(command.tool, -np.inf), command.tool
        if command.time is None or not self._world.time - self.rules.oldest <= command.time < old_from:
            return False
        del self._old_from[tool]
        late = self.by_tool[tool].last_stamp >= old_from
        if late:
            self.by_tool[tool] = Course()
        return late

    def _checked(self, command: Command, reject: Callable[[CommandError], None]) -> Command | None:
        shift = self.shift
        try:
            command = self._world.check(command)
            if self.rules.relative and command.time is not None:
                if shift is None:
                    shift = self._world.time + self.rules.gap - command.time
                command = replace(command, time=command.time + shift)
            self._check_stamp(command, self.by_tool[command.tool])
        except CommandError as error:
            reject(error)
            return None
        self.shift = shift
        if command.time is not None:
            course = self.by_tool[command.tool]
            self.alike += command.time == course.last_stamp
            course.last_stamp = command.time
        return command

    def _check_stamp(self, command: Command, course: Course) -> None:
        now, tool, rules = self._world.time, f"tool '{command.tool}'", self.rules
        if command.time is None:
            if self.lockstep:
                raise CommandError(
                    "no_stamp",
                    f"{tool}: in lockstep a command needs a stamp, this one has none (or stamps:=ignored is set)",
                )
            return
        stamp = f"{tool}: stamp {command.time:.6f} s"
        if command.time > now + rules.furthest:
            raise CommandError(
                "future",
                f"{stamp} is more than {rules.furthest:g} s ahead of simulated time {now:.6f} s; stamps are simulated "
                "time (use_sim_time and /clock), or zero for as soon as possible; with the node's parameter stamps:=relative "
                "they are counted from the first one, with stamps:=ignored any are taken for zero",
            )
        if command.time < course.last_stamp or (self.lockstep and command.time == course.last_stamp):
            bound, anew = "must not be before", "send one without a stamp, which replaces all before it, or reset,"
            if self.lockstep:
                bound, anew = "must be later than", "reset"
            raise CommandError(
                "out_of_order",
                f"{stamp} {bound} {course.last_stamp:.6f} s, the stamp of the command before; {anew} to begin anew",
            )
        if self.lockstep and command.time <= now + 0.5 * self._world.time_step:
            raise CommandError("late", f"{stamp} must be later than simulated time {now:.6f} s in lockstep")
        if command.time < now - rules.oldest:
            raise CommandError("too_old", f"{stamp} is more than {rules.oldest:g} s behind simulated time {now:.6f} s")
        if len(course.waiting) >= _MOST_WAITING:
            raise CommandError("flooded", f"{tool}: {_MOST_WAITING} commands are waiting already")

    def _waits(self, command: Command) -> bool:
        """Whether it is reached at its own time; poses only, outside lockstep."""
        if self.lockstep:
            return True
        ahead = self._world.time + 0.5 * self._world.time_step  # stamps are rounded to nanoseconds: that of now may lie above it
        return isinstance(command, ToolPose) and command.time is not None and command.time > ahead

    def _begin_there(self, command: Command) -> None:
        if command.tool in self.placed and isinstance(command, ToolPose) and self.by_tool[command.tool].last_taken == -np.inf:
            self._world.place_tool(command.tool, command.position, command.orientation)
            self._has_placed = True

    def _append(self, command: Command) -> None:
        self._begin_there(command)
        course, now = self.by_tool[command.tool], self._world.time
        if course.waiting and command.time == course.waiting[-1].time:
            course.waiting[-1] = command
        elif command.time == course.promised:
            self._reach(command, command.time)
        elif self.lockstep or course.promised > now:
            course.waiting.append(command)
        else:
            self._world.apply(command)  # what is under way has no time of its own to keep to
            course.waiting.clear()  # nor has the rest of a velocity
        course.promised, course.last_taken = command.time, now

    def _replace(self, command: Command) -> None:
        self._begin_there(command)
        course, now, rules = self.by_tool[command.tool], self._world.time, self.rules
        if isinstance(command, ToolVelocity):
            course.waiting.clear()
            self._move(course, self._within_reach(command), now + rules.hold)
        else:
            if command.time is None:
                since = now - course.last_taken
            elif command.time == course.followed_stamp:
                since = self._world.arrival(command.tool) - course.last_taken  # as the one whose place it takes
            else:
                since = command.time - course.followed_stamp
            self._reach(command, now + max(min(since, rules.gap), self._world.time_step))
            course.waiting.clear()
        course.promised, course.last_taken = -np.inf, now
        if command.time is None:
            course.last_stamp = min(course.last_stamp, now)  # later ones have been discarded
            self.unstamped += isinstance(command, ToolPose)
        else:
            course.followed_stamp = command.time

    def _reach(self, pose: ToolPose, end: float) -> None:
        """Set a tool on its way to a pose, to be there at a time [s], or later if it may not be so fast."""
        now = self._world.time
        soonest = self._world.travel(pose) / self._world.scene.tool(pose.tool).max_speed
        self._world.apply(replace(pose, time=max(end, now + soonest)))
        if soonest > 1.000001 * (end - now):
            self.limited += 1
            self.delays[pose.tool] = max(self.delays.get(pose.tool, 0.0), now + soonest - end)

    def _move(self, course: Course, velocity: ToolVelocity, end: float) -> None:
        """Move a tool at a velocity until a time [s], by less than half a turn at once: poses are reached the short way."""
        now = self._world.time
        soon = min(end, now + _unambiguous(velocity))
        pose = self._world.pose_after(velocity, soon - now)
        self._world.apply(replace(pose, time=soon))
        if end - soon > self._world.time_step:
            begun = self._world.pose_after(ToolVelocity(velocity.tool, np.zeros(3), np.zeros(3)), soon - now)
            course.waiting.appendleft(replace(in_world(velocity, begun.orientation), time=end))

    def _within_reach(self, velocity: ToolVelocity) -> ToolVelocity:
        """A velocity, made smaller in its direction if it is above ``max_speed``."""
        duration = min(self.rules.hold, _unambiguous(velocity))
        target = self._world.pose_after(velocity, duration)
        excess = self._world.travel(target) / (duration * self._world.scene.tool(velocity.tool).max_speed)
        if excess <= 1.0:
            return velocity
        self.limited += 1
        return replace(velocity, linear=velocity.linear / excess, angular=velocity.angular / excess)


def _unambiguous(velocity: ToolVelocity) -> float:
    """Time in which it turns a tool by a little less than half a turn [s]."""
    return _LESS_THAN_HALF / max(float(np.linalg.norm(velocity.angular)), 1e-300)
