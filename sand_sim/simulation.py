"""A world with a clock: commands and requests from any thread, stepping in one, paced as asked.

Pacing:
    ``realtime``  simulated time follows wall time times a factor, as far as the machine keeps up.
    ``fast``      as fast as possible.
    ``lockstep``  only up to the time of the last stamped pose of every tool that has been commanded, or by ``step``.

A pose with a time is reached at that time. In lockstep poses queue up and their times must rise. Otherwise a pose without a time
replaces the one before and is reached after the time that passed between the two, but never faster than the tool's ``max_speed``.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future

from sand_sim.border import CommandError, Observation, ToolPose
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.world import World

PACINGS = ("realtime", "fast", "lockstep")
_LONGEST_INTERVAL = 0.2  # [s] between two poses that are taken for one stream
_LATEST = 0.2  # [s] that real time may lag behind before the arrears are forgotten
_NAP = 0.05  # [s]


class Simulation:
    """Runs a world in a thread of its own.

    Args:
        world: which nobody else touches from now on.
        pacing: one of ``PACINGS``.
        real_time_factor: simulated over wall seconds in ``realtime``.
        on_frame: called in the stepping thread with each observation.
        on_fault: called in the stepping thread with the error that stopped it; after ``UnstableError`` a reset brings it back.
        on_reject: called with the error for each rejected command.

    Attributes:
        fault: the error that has stopped the stepping, None while all is well.
        rejected: number of rejected commands by reason.
        limited: number of poses that were reached later than asked to keep to ``max_speed``.
        last_rejection: message of the last rejected command.
    """

    def __init__(
        self,
        world: World,
        pacing: str = "realtime",
        real_time_factor: float = 1.0,
        on_frame: Callable[[Observation], None] = lambda observation: None,
        on_fault: Callable[[Exception], None] = lambda error: None,
        on_reject: Callable[[CommandError], None] = lambda error: None,
    ):
        self.world, self.pacing, self.real_time_factor = world, pacing, real_time_factor
        self.fault: Exception | None = None
        self.rejected: Counter[str] = Counter()
        self.limited = 0
        self.last_rejection = ""
        self._on_frame, self._on_fault, self._on_reject = on_frame, on_fault, on_reject
        self._wake = threading.Condition()
        self._inbox: deque[ToolPose] = deque()
        self._requests: deque[tuple[str, Future]] = deque()
        self._courses = {tool.name: deque() for tool in world.scene.tools}
        self._last_command: dict[str, float] = {}
        self._promised: dict[str, float] = {}
        self._paused = self._stopping = False
        self._due = (0.0, 0.0)
        self._frame_end = world.time + self.frame
        self._thread = threading.Thread(target=self._run, name="sand_sim stepping")

    @property
    def frame(self) -> float:
        """Simulated time between two observations [s]."""
        return self.world.frame_steps * self.world.time_step

    @property
    def paused(self) -> bool:
        """Whether stepping is held."""
        return self._paused

    def start(self) -> None:
        """Begin to step."""
        self._thread.start()

    def stop(self) -> None:
        """End the stepping thread after the chunk it is in."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        if self._thread.ident is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def submit(self, command: ToolPose) -> None:
        """Hand a command over; it is checked and carried out, or rejected and counted, before the next step."""
        with self._wake:
            self._inbox.append(command)
            self._wake.notify_all()

    def reject(self, error: CommandError) -> None:
        """Count a command that was refused before it could be submitted."""
        self.rejected[error.reason] += 1
        self.last_rejection = str(error)
        self._on_reject(error)

    def pause(self, paused: bool) -> None:
        """Hold or go on."""
        with self._wake:
            self._paused = paused
            self._due = (0.0, 0.0)
            self._wake.notify_all()

    def step(self) -> Future:
        """Advance by one frame, also while paused or in lockstep; the future is done when its observation has been shown."""
        return self._request("step")

    def reset(self) -> Future:
        """Go back to time zero and forget all commands; the future is done when the new observation has been shown."""
        return self._request("reset")

    def _request(self, what: str) -> Future:
        future: Future = Future()
        with self._wake:
            if self._stopping:
                future.cancel()
            self._requests.append((what, future))
            self._wake.notify_all()
        return future

    def _run(self) -> None:
        try:
            self._on_frame(self.world.observe())
            while not self._stopping:
                try:
                    self._take_in()
                    end = self._allowed_until()
                    if end > self.world.time + 0.5 * self.world.time_step:
                        self._advance(min(end, self._frame_end))
                        continue
                except UnstableError as error:
                    self._fail(error)
                with self._wake:
                    if not (self._inbox or self._requests or self._stopping):
                        self._wake.wait(_NAP if self.pacing == "realtime" else None)
        except Exception as error:
            self._fail(error)
        finally:
            with self._wake:
                self._stopping = True
                for _, future in self._requests:
                    future.cancel()

    def _take_in(self) -> None:
        """Carry out what has come in from other threads."""
        with self._wake:
            commands, requests = list(self._inbox), list(self._requests)
            self._inbox.clear()
            self._requests.clear()
        self._take_commands(commands)
        for what, future in requests:
            try:
                if what == "reset":
                    self._reset()
                    self._on_frame(self.world.observe())
                elif self.fault is not None:
                    raise self.fault
                else:
                    self._frame_end = self.world.time + self.frame
                    self._advance(self._frame_end)
                future.set_result(None)
            except UnstableError as error:
                self._fail(error)
                future.set_exception(error)
            except Exception as error:
                future.set_exception(error)
                raise

    def _take_commands(self, commands: list[ToolPose]) -> None:
        """Check commands and carry them out; outside lockstep only the last good one of each tool, which replaces the others."""
        good = []
        for command in commands:
            try:
                if self.fault is not None:
                    raise CommandError("stopped", f"tool '{command.tool}': stepping has stopped, reset to go on")
                good.append(self.world.check(command))
            except CommandError as error:
                self.reject(error)
        replaced: set[str] = set()
        for command in good if self.pacing == "lockstep" else reversed(good):
            try:
                if command.tool not in replaced:
                    self._accept(command)
                    if self.pacing != "lockstep":
                        replaced.add(command.tool)
            except CommandError as error:
                self.reject(error)

    def _fail(self, error: Exception) -> None:
        if self.fault is not error:
            self.fault = error
            self._on_fault(error)

    def _accept(self, command: ToolPose) -> None:
        course, now = self._courses[command.tool], self.world.time
        if self.pacing == "lockstep":
            latest = max(now, self._promised.get(command.tool, now))
            if command.time is None or command.time <= latest + 0.5 * self.world.time_step:
                stamp = "none" if command.time is None else f"{command.time:.6f} s"
                raise CommandError(
                    "late",
                    f"tool '{command.tool}': stamp {stamp} must be later than {latest:.6f} s of simulated time in lockstep",
                )
            self._promised[command.tool] = command.time
            course.append(command)
            return
        if command.time is None or command.time <= now:
            passed = min(now - self._last_command.get(command.tool, -1.0), _LONGEST_INTERVAL)
            soonest = now + self.world.travel(command) / self.world.scene.tool(command.tool).max_speed
            wanted = now + max(passed, self.world.time_step)
            self.limited += soonest > wanted
            command = ToolPose(command.tool, command.position, command.orientation, max(wanted, soonest))
        self.world.apply(command)
        self._last_command[command.tool] = now
        course.clear()

    def _allowed_until(self) -> float:
        """Simulated time up to which stepping is allowed now."""
        if self._paused or self.fault is not None:
            return 0.0
        if self.pacing == "fast":
            return float("inf")
        if self.pacing == "lockstep":
            return min(self._promised.values(), default=0.0)
        wall, now = time.monotonic(), self.world.time
        if self._due == (0.0, 0.0) or now < self._due[1] + (wall - self._due[0] - _LATEST) * self.real_time_factor:
            self._due = (wall, now)
        return self._frame_end if now < self._due[1] + (wall - self._due[0]) * self.real_time_factor else 0.0

    def _advance(self, end: float) -> None:
        """Step to a time, starting queued poses on the way, and show the world at the end of a frame or of a lockstep."""
        world = self.world
        while world.time < end - 0.5 * world.time_step and not self._stopping:
            self._start_queued()
            until = min([end, *(world.arrival(name) for name, course in self._courses.items() if course)])
            world.step(max(1, round((until - world.time) / world.time_step)))
        if not self._stopping:
            if world.time > self._frame_end - 0.5 * world.time_step:
                self._frame_end = world.time + self.frame
            self._on_frame(world.observe())

    def _start_queued(self) -> None:
        for name, course in self._courses.items():
            while course and self.world.resting(name):
                try:
                    self.world.apply(course.popleft())
                    break
                except CommandError as error:
                    self.reject(error)

    def _reset(self) -> None:
        self.world.reset()
        self.fault = None
        for course in self._courses.values():
            course.clear()
        self._last_command.clear()
        self._promised.clear()
        self._due = (0.0, 0.0)
        self._frame_end = self.world.time + self.frame
