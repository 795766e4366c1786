"""Run recorded stages on all cores of a CPU.

Warp runs a CPU launch on one thread but releases Python's lock meanwhile. So each core gets a lane: its own recorded graph of
launches over its share of the items, replayed by its own thread without returning to Python. Lanes meet at a barrier after each
stage. Every item is computed by the same code in the same order whatever the number of lanes, so the results are identical.
A thread may also play several lanes, one after the other in each stage (``crew.py``).
"""

import ctypes
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import partial

import warp as wp

from sampler.compiling import compile_modules
from sampler.cores import available_cores
from sand_sim.engine.count import Count
from sand_sim.engine.crew import Crew
from sand_sim.engine.kernel import fill_gaps, kernel

_SPINS_BEFORE_YIELD = 2000
_ABANDONED = 32
RECORDING = threading.Lock()  # Warp records the launches of the whole process while a capture is open

_BARRIER = """
#if !defined(__CUDA_ARCH__)
    wp::int32* arrived = meeting.data;
    wp::int32* generation = meeting.data + 16;  // apart, each on a cache line of its own
    wp::int32* abandoned = meeting.data + 32;
    const wp::int32 mine = __atomic_load_n(generation, __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(arrived, 1, __ATOMIC_ACQ_REL) == threads) {
        __atomic_store_n(arrived, 0, __ATOMIC_RELAXED);
        __atomic_store_n(generation, mine + 1, __ATOMIC_RELEASE);
        return;
    }
    wp::int32 spins = 0;
    while (__atomic_load_n(generation, __ATOMIC_ACQUIRE) == mine && !__atomic_load_n(abandoned, __ATOMIC_RELAXED)) {
        if (++spins > patience) ((wp::int32 (*)())give_way)();
#if defined(__x86_64__)
        else __builtin_ia32_pause();
#elif defined(__aarch64__)
        else __asm__ volatile("yield");
#endif
    }
#endif
"""


@wp.func_native(_BARRIER)
def _meet(meeting: wp.array(dtype=int), threads: int, patience: int, give_way: wp.uint64): ...


@kernel
def meet(meeting: wp.array(dtype=int), threads: int, patience: int, give_way: wp.uint64):
    """Wait until all threads have come here; spin for a while, then give the core to others."""
    _meet(meeting, threads, patience, give_way)


class LaneRecorder:
    """What a stage records itself on; this one keeps the shares of the lanes that one thread plays.

    Attributes:
        lanes: how many there are.
        wide: whether many threads work on one lane; here each has its own, or several.
        vectors: whether a thread does many contacts at once, in vector registers.
    """

    wide, vectors = False, True

    def __init__(self, device: "CpuDevice", thread: int, threads: int):
        self._device, self._threads = device, threads
        self.lanes = device.lanes
        self._own = range(thread * self.lanes // threads, (thread + 1) * self.lanes // threads)

    def each(self, launched: wp.Kernel, over: Count, inputs: list, wait: bool = True) -> None:
        """Launch over all items of a population.

        Args:
            launched: kernel that takes ``(lane, spans, stride, *inputs)`` and loops over
                ``range(spans[lane] + wp.tid(), spans[lane + 1], stride)``. Here one thread takes all items of the lane.
            over: the population.
            inputs: the kernel's further arguments.
            wait: whether the lanes meet afterwards; False if the next stage touches nothing of this one.
        """
        for lane in self._own if over.capacity else ():
            self._launch(launched, 1, [lane, over.spans, 1, *inputs])
        if wait:
            self.wait()

    def share(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Launch one thread a share, here a lane.

        The kernel takes ``(lane, shares, *inputs)`` and finds what share ``lane + wp.tid()`` has to do.
        """
        for lane in self._own:
            self._launch(launched, 1, [lane, self.lanes, *inputs])
        if wait:
            self.wait()

    def once(self, launched: wp.Kernel, inputs: list, wait: bool = True) -> None:
        """Launch a single thread on the first lane."""
        if 0 in self._own:
            self._launch(launched, 1, inputs)
        if wait:
            self.wait()

    def when(self, flag: wp.array, body: Callable[[], None], otherwise: Callable[[], None] | None = None) -> None:
        """Run the body's launches only if ``flag[0]`` is not zero then, and those of ``otherwise`` if it is."""
        wp.capture_if(flag, on_true=body, on_false=otherwise)

    def repeat(self, flag: wp.array, body: Callable[[], None]) -> None:
        """Run the body's launches as long as ``flag[0]`` is not zero."""
        wp.capture_while(flag, body)

    def wait(self) -> None:
        """Let all lanes meet."""
        if self._threads > 1:
            self._launch(meet, 1, self._device.meeting_arguments(self._threads))

    def _launch(self, launched: wp.Kernel, size: int, inputs: list) -> None:
        wp.launch(launched, dim=size, inputs=fill_gaps(launched, inputs, "cpu"), device="cpu")


class CpuDevice:
    """All cores of this machine as one device."""

    name = "cpu"
    wide, vectors = False, True

    def __init__(self, threads: int | None = None):
        self.lanes = self.shares = threads or available_cores()
        self.label = f"cpu, {self.lanes} thread{'s' if self.lanes > 1 else ''}"
        self._give_way = wp.uint64(ctypes.cast(ctypes.CDLL(None).sched_yield, ctypes.c_void_p).value)
        self._meeting = wp.zeros(48, dtype=int, device="cpu")
        self._threads = ThreadPoolExecutor(self.lanes, thread_name_prefix="sand_sim lane")
        self._crew = Crew(self.lanes)

    def meeting_arguments(self, threads: int) -> list:
        """What ``meet`` is given so that so many threads meet."""
        return [self._meeting, threads, _SPINS_BEFORE_YIELD, self._give_way]

    @property
    def portion(self) -> int:
        """Steps to take in one run at most: after them there may be more threads, or fewer."""
        return self._crew.portion

    def load(self, kernels: list[wp.Kernel], progress: Callable[[str, float], None]) -> None:
        """Compile what is not in Warp's cache, on several threads, and load it all."""
        modules, told = (kernel.module for kernel in kernels), partial(progress, "compiling kernels")
        compile_modules(modules, "cpu", available_cores(), told)

    def record(self, program: Callable[[LaneRecorder], None], steps: wp.array | None = None) -> Callable[[], None]:
        """Record a program once per thread.

        Args:
            program: launches its stages on the recorder it is given; it must launch the same stages whatever the lane.
            steps: a counter that it advances, int, shape (1,); by its pace the number of threads is chosen.

        Returns:
            A function that runs the recorded program on all lanes and returns when it is done.
        """
        recorded: dict[int, list] = {}

        def run() -> None:
            threads = self._crew.size
            if threads not in recorded:
                recorded[threads] = [self._record(program, thread, threads) for thread in range(threads)]
            before, begin = _read(steps), time.perf_counter()
            self._run(recorded[threads])
            seconds, done = time.perf_counter() - begin, _read(steps) - before
            if done:
                self._crew.note(done, seconds)

        return run

    def synchronize(self) -> None:
        """Nothing is pending on a CPU once ``record``'s function has returned."""

    def _record(self, program: Callable[[LaneRecorder], None], thread: int, threads: int):
        with RECORDING, wp.ScopedCapture(device="cpu") as capture:
            program(LaneRecorder(self, thread, threads))
        return capture.graph

    def _run(self, graphs: list) -> None:
        running = []
        try:
            for graph in graphs:
                running.append(self._threads.submit(wp.capture_launch, graph))
            finished, _ = wait(running, return_when=FIRST_EXCEPTION)
            for lane in finished:
                lane.result()
        except BaseException:
            # A lane that failed or never started would leave the others waiting for ever.
            if len(running) < len(graphs) or any(lane.done() and lane.exception() for lane in running):
                self._meeting.numpy()[_ABANDONED] = 1
            wait(running)
            self._meeting.zero_()
            raise


def _read(counter: wp.array | None) -> int:
    return 0 if counter is None else int(counter.numpy()[0])
