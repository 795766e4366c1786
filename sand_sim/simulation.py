"""A world with a clock: commands and requests from any thread, stepping in one, paced as asked.

Pacing:
    ``realtime``  simulated time follows wall time times a factor, as far as the machine keeps up.
    ``fast``      as fast as possible.
    ``lockstep``  only up to the time of the last command of every tool that has been commanded, or by ``step``.

Which commands are taken, and when each begins, is told in ``courses.py``.
"""

import atexit
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from sand_sim.border import CommandError, Observation
from sand_sim.checkpoint import Checkpoint, CheckpointError, load_checkpoint, take_checkpoint, write_checkpoint
from sand_sim.checkpoints import CheckpointFolder
from sand_sim.courses import USUAL, Courses, StampRules
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.pending import pack_told, unpack_told
from sand_sim.tool_motion.commands import Command
from sand_sim.world import World

PACINGS = ("realtime", "fast", "lockstep")
_LATEST = 0.2  # [s] that real time may lag behind before the arrears are forgotten
_NAP = 0.05  # [s]
MOST_UNREAD = 10_000  # commands that wait for the stepping thread


class Simulation:
    """Runs a world in a thread of its own.

    Args:
        world: which nobody else touches from now on.
        pacing: one of ``PACINGS``.
        real_time_factor: simulated over wall seconds in ``realtime``.
        on_frame: called in the stepping thread with each observation.
        on_fault: called in the stepping thread with the error that stopped it; after ``UnstableError`` a reset brings it back.
        on_reject: called with the error for each rejected command.
        rules: limits on the stamps of commands.
        checkpoints: where the state is kept from time to time, if anywhere; closed at the end.
        pack_history: called in the stepping thread for what files of states shall hold besides.
        unpack_history: called in the stepping thread with that, before the observation of a state that has been loaded.

    Attributes:
        courses: where the tools have been told to go.
        fault: the error that has stopped the stepping, None while all is well.
        rejected: number of rejected commands by reason.
        last_rejection: message of the last rejected command.
        step_time: wall time of a step, mean since the last observation or command [s].
    """

    def __init__(
        self,
        world: World,
        pacing: str = "realtime",
        real_time_factor: float = 1.0,
        on_frame: Callable[[Observation], None] = lambda observation: None,
        on_fault: Callable[[Exception], None] = lambda error: None,
        on_reject: Callable[[CommandError], None] = lambda error: None,
        rules: StampRules = USUAL,
        checkpoints: CheckpointFolder | None = None,
        pack_history: Callable[[], dict[str, np.ndarray]] = dict,
        unpack_history: Callable[[dict[str, np.ndarray]], None] = lambda packed: None,
    ):
        self.world, self.pacing, self.real_time_factor = world, pacing, real_time_factor
        self.courses = Courses(world, pacing == "lockstep", rules)
        self.fault: Exception | None = None
        self.rejected: Counter[str] = Counter()
        self.last_rejection, self.step_time = "", 0.0
        self._on_frame, self._on_fault, self._on_reject = on_frame, on_fault, on_reject
        self._checkpoints, self._pack_history, self._unpack_history = checkpoints, pack_history, unpack_history
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="sand_sim state")
        self._wake, self._counting = threading.Condition(), threading.Lock()
        self._inbox: deque[Command] = deque()
        self._requests: deque[tuple[Callable[[], Any], Future]] = deque()
        self._paused, self._stopping, self._due = False, False, (0.0, 0.0)
        self._frame_end = world.time + self.frame
        self._thread = threading.Thread(target=self._run, name="sand_sim stepping", daemon=True)

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
        atexit.register(self.stop)  # a process that fails before that would wait for ever for a thread that waits for commands
        self._thread.start()

    def stop(self) -> None:
        """End the stepping thread after the chunk it is in, and finish files of states."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        if self._thread is threading.current_thread():
            return
        atexit.unregister(self.stop)
        if self._thread.ident is not None:
            self._thread.join()
        self._writer.shutdown()
        if self._checkpoints:
            self._checkpoints.close()

    def submit(self, command: Command) -> None:
        """Hand a command over; it is checked and carried out, or rejected and counted, before the next step."""
        with self._wake:
            full = len(self._inbox) >= MOST_UNREAD
            if not full:
                self._inbox.append(command)
                self._wake.notify_all()
        if full:
            self.reject(
                CommandError("flooded", f"tool '{command.tool}': {MOST_UNREAD} commands have come in since the last frame")
            )

    def reject(self, error: CommandError) -> None:
        """Count a command that was refused before it could be submitted."""
        with self._counting:
            self.rejected[error.reason] += 1
            self.last_rejection = str(error)
        self._on_reject(error)

    def pause(self, paused: bool) -> None:
        """Hold or go on."""
        with self._wake:
            self._paused = paused
            self._due = (0.0, 0.0)
            self._wake.notify_all()

    def set_pacing(self, pacing: str, real_time_factor: float) -> None:
        """Change the pacing while it runs."""
        with self._wake:
            self.pacing, self.real_time_factor = pacing, real_time_factor
            self.courses.lockstep = pacing == "lockstep"
            self._due = (0.0, 0.0)
            self._wake.notify_all()

    def step(self) -> Future:
        """Advance by one frame, also while paused or in lockstep; the future is done when its observation has been shown."""
        return self.request(self._step)

    def reset(self) -> Future:
        """Go back to time zero and forget all commands; the future is done when the new observation has been shown."""
        return self.change(self._reset)

    def change(self, act: Callable[[], Any]) -> Future:
        """As ``request``, and the world is shown when it has been changed."""
        return self.request(lambda: (act(), self._on_frame(self.world.observe()))[0])

    def save_state(self, path: Path) -> Future:
        """Write the state to a file; the future gives the path once it is on the disk, or ``CheckpointError``."""
        saved: Future = Future()

        def finish(done: Future) -> None:
            if done.cancelled():
                saved.cancel()
            elif error := done.exception():
                saved.set_exception(error)
            elif isinstance(result := done.result(), Future):  # the state has been copied and is being written
                result.add_done_callback(finish)
            else:
                saved.set_result(path)

        self.request(lambda: self._writer.submit(write_checkpoint, path, self._checkpoint())).add_done_callback(finish)
        return saved

    def load_state(self, path: Path) -> Future:
        """Go on from a file that ``save_state`` or a checkpoint has left, also after a fault.

        The future gives the simulated time [s] when the new observation has been shown, or ``CheckpointError`` for a file that
        cannot be used; all is as it was then.
        """
        return self.change(lambda: self._load(path))

    def resume(self) -> bool:
        """Go on from the newest good checkpoint, if there is one, as ``CheckpointFolder.resume``; call it before ``start``."""
        return self._checkpoints.resume(self.world, self._take_over) is not None

    def request(self, act: Callable[[], Any]) -> Future:
        """Do something with the world in the stepping thread, between two frames; the future holds what it returns or raises.

        It may raise ``CommandError`` or ``CheckpointError`` if it has changed nothing; any other error stops the stepping.
        """
        future: Future = Future()
        with self._wake:
            if self._stopping:
                future.cancel()
            else:
                self._requests.append((act, future))
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
                while self._requests:
                    self._requests.popleft()[1].cancel()
            self._keep_last()

    def _take_in(self) -> None:
        """Carry out what has come in from other threads."""
        with self._wake:
            commands, requests = list(self._inbox), len(self._requests)
            self._inbox.clear()
        if self.fault is None:
            with np.errstate(over="ignore", invalid="ignore"):  # what comes of huge numbers is refused
                placed = self.courses.take(commands, self.reject)
            if placed:
                self._on_frame(self.world.observe())
        else:
            for command in commands:
                self.reject(CommandError("stopped", f"tool '{command.tool}': stepping has stopped, reset to go on"))
        for _ in range(requests):
            act, future = self._requests.popleft()  # one by one: those left where one ends the stepping are cancelled
            if not future.set_running_or_notify_cancel():  # nobody waits for it any more
                continue
            try:
                future.set_result(act())
            except (CommandError, CheckpointError) as error:
                future.set_exception(error)
            except Exception as error:
                self._fail(error)  # first, so that whoever waits finds the fault
                future.set_exception(error)
                raise

    def _fail(self, error: Exception) -> None:
        if self.fault is not error:
            self.fault = error
            self._on_fault(error)

    def _allowed_until(self) -> float:
        """Simulated time up to which stepping is allowed now."""
        if self._paused or self.fault is not None:
            return 0.0
        if self.pacing == "fast":
            return float("inf")
        if self.pacing == "lockstep":
            return max(self.courses.promised, 0.0)
        wall, now = time.monotonic(), self.world.time
        if self._due == (0.0, 0.0) or now < self._due[1] + (wall - self._due[0] - _LATEST) * self.real_time_factor:
            self._due = (wall, now)
        return self._frame_end if now < self._due[1] + (wall - self._due[0]) * self.real_time_factor else 0.0

    def _advance(self, end: float) -> None:
        """Step to a time, starting queued poses on the way, and show the world at the end of a frame or of a lockstep."""
        world = self.world
        while world.time < end - 0.5 * world.time_step and not self._stopping:
            self.courses.begin_waiting(self.reject)
            until = min(end, self.courses.next_begin())
            steps, begin = max(1, round((until - world.time) / world.time_step)), time.perf_counter()
            world.step(steps)
            self.step_time = (time.perf_counter() - begin) / steps
        if not self._stopping:
            if world.time > self._frame_end - 0.5 * world.time_step:
                self._frame_end = world.time + self.frame
            self._on_frame(world.observe())
            if self._checkpoints and self._checkpoints.due(world.steps):
                self._checkpoints.offer(self._checkpoint())

    def _step(self) -> None:
        if self.fault is not None:
            raise self.fault
        self._frame_end = self.world.time + self.frame
        self._advance(self._frame_end)

    def _reset(self) -> None:
        before = self.world.time
        self.world.reset()
        self.fault, self._due = None, (0.0, 0.0)
        self.courses.clear()
        self.courses.heed_late_ones(before)
        self._frame_end = self.world.time + self.frame

    def _checkpoint(self) -> Checkpoint:
        return take_checkpoint(self.world, pack_told(self.courses, self.rejected, self._frame_end), self._pack_history())

    def _load(self, path: Path) -> float:
        self._writer.submit(bool).result()  # a state that is still being written may be the one that is asked for
        before = self.world.time
        load_checkpoint(path, self.world, self._take_over)
        self.courses.heed_late_ones(before)
        return self.world.time

    def _take_over(self, checkpoint: Checkpoint) -> None:
        """Go on with the commands and the history of a checkpoint whose state the world has."""
        courses, rejected, limited, frame_end = unpack_told(checkpoint.commands, self.world)
        self._unpack_history(checkpoint.history)
        self.courses.by_tool, self.courses.limited, self.courses.shift = courses, limited, None
        self.rejected, self._frame_end = rejected, frame_end
        self.fault, self._due = None, (0.0, 0.0)

    def _keep_last(self) -> None:
        """Keep where the run has been stopped, if that is the end of a frame."""
        world = self.world
        if self._checkpoints and self.fault is None and self._checkpoints.due(world.steps, soon=True):
            if world.time > self._frame_end - 0.5 * world.time_step:
                self._frame_end = world.time + self.frame
            elif not world.observed:
                return
            self._checkpoints.offer(self._checkpoint())
