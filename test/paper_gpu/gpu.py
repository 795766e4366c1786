"""Memory, queue and graphs of a GPU that is not there. It is as unkind as a GPU may be.

What is asked for happens when the host waits, and not before. The host cannot touch the memory, fresh and freed memory hold
rubbish, and what a kernel writes behind an array is an error. The threads of a launch run in another order each time. While a
thread captures a graph, it may neither take memory nor wait.
"""

import ctypes
import mmap
import threading
from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import gcd
from random import Random

_ROOM = 4 << 30  # bytes of addresses; pages are had when they are written to
_PAGE = mmap.PAGESIZE
_FRESH, _FREED, _BESIDE = 0xCB, 0xDD, 0xEE
_NOBODY, _READ_AND_WRITE = 0, 3

_mprotect = ctypes.CDLL(None, use_errno=True).mprotect
_mprotect.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int

Work = Callable[[], None]


class PaperGpuError(RuntimeError):
    """What a GPU would answer with an error, or with rubbish."""


class Memory:
    """Arrays, each on pages of its own with a page behind it that nobody may write to."""

    def __init__(self):
        self._pages = mmap.mmap(-1, _ROOM, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._start = ctypes.addressof(ctypes.c_char.from_buffer(self._pages))
        self._next = self._start + _PAGE
        self._sizes: dict[int, int] = {}
        self._spare: dict[int, list[int]] = {}
        self._marked: dict[int, int] = {}
        self._protect(_NOBODY)

    def take(self, size: int) -> int:
        spare = self._spare.get(_pages_of(size))
        place = spare.pop() if spare else self._next
        if not spare and place == self._next:
            self._next += _pages_of(size) + _PAGE
        if self._next > self._start + _ROOM:
            raise PaperGpuError("out of memory")
        self._sizes[place] = size
        return place

    def give_back(self, place: int) -> int:
        """From now on no command may name it; ``recycle`` it once those before are done. Return its size."""
        if place not in self._sizes:
            raise PaperGpuError(f"{place:#x} is freed, and is none of the arrays")
        return self._sizes.pop(place)

    def mark(self, place: int, size: int) -> None:
        """Fill an array with rubbish, and what lies behind it."""
        ctypes.memset(place, _FRESH, size)
        ctypes.memset(place + size, _BESIDE, _beside(size))
        self._marked[place] = size

    def check_marks(self) -> None:
        """Raise if something has been written beside an array."""
        for place, size in self._marked.items():
            if ctypes.string_at(place + size, _beside(size)) != bytes([_BESIDE]) * _beside(size):
                raise PaperGpuError(f"behind the {size} bytes at {place:#x} something was written")

    def recycle(self, place: int, size: int) -> None:
        ctypes.memset(place, _FREED, size)
        del self._marked[place]
        self._spare.setdefault(_pages_of(size), []).append(place)

    def check(self, place: int, size: int) -> None:
        """Raise unless all of this lies in one array."""
        starts = sorted(self._sizes)
        k = bisect_right(starts, place) - 1
        if size and (k < 0 or place + size > starts[k] + self._sizes[starts[k]]):
            raise PaperGpuError(f"{size} bytes at {place:#x} are in none of the arrays")

    @contextmanager
    def opened(self) -> Iterator[None]:
        self._protect(_READ_AND_WRITE)
        try:
            yield
        finally:
            self._protect(_NOBODY)

    def _protect(self, how: int) -> None:
        if _mprotect(self._start, _ROOM, how):
            raise OSError(ctypes.get_errno(), "mprotect")


class Gpu:
    """One stream of commands.

    Args:
        seed: of the order of threads.
    """

    def __init__(self, seed: int = 0):
        self.memory = Memory()
        self.launches: dict[str, int] = {}  # by kernel
        self.graphs = 0
        self.captures = 0  # begun or gone on with
        self._random = Random(seed)
        self._lock = threading.RLock()
        self._queue: list[Work] = []
        self._graph: list[Work] | None = None
        self._capturing: int | None = None  # thread

    @property
    def idle(self) -> bool:
        return not self._queue

    @property
    def capturing(self) -> bool:
        """Whether this thread captures."""
        return self._capturing == threading.get_ident()

    def capture(self, graph: list[Work]) -> None:
        """Put what this thread asks for into a graph from now on."""
        with self._lock:
            if self._graph is not None:
                raise PaperGpuError("two graphs are captured at once")
            self._graph, self._capturing = graph, threading.get_ident()
            self.captures += 1

    def end_capture(self) -> list[Work]:
        graph, self._graph, self._capturing = self._graph, None, None
        return graph

    def later(self, work: Work) -> None:
        with self._lock:
            (self._graph if self.capturing else self._queue).append(work)

    def clean_up(self, work: Work) -> None:
        """Ask for what is no part of a graph even if one is captured: Python collects garbage when it likes, also in ``wait``."""
        with self._lock:
            self._queue.append(work)

    def wait(self) -> None:
        """Do all that was asked for."""
        self.forbid_while_capturing("waiting")
        with self._lock:
            if self._queue:
                work, self._queue = self._queue, []
                with self.memory.opened():
                    play(work)
                    self.memory.check_marks()

    def forbid_while_capturing(self, what: str) -> None:
        if self.capturing:
            raise PaperGpuError(f"{what} while a graph is captured")

    def take(self, size: int) -> int:
        self.forbid_while_capturing("memory is asked for")
        with self._lock:
            place = self.memory.take(size)
        self.clean_up(lambda: self.memory.mark(place, size))
        return place

    def give_back(self, place: int) -> None:
        with self._lock:
            size = self.memory.give_back(place)
        self.clean_up(lambda: self.memory.recycle(place, size))

    def launch(self, name: str, kernel: Callable, arguments: list[bytes], blocks: int, threads: int) -> None:
        """Ask for a launch of a kernel of ``ptx.Program``; arguments are copied now, as by a GPU."""
        held = [ctypes.create_string_buffer(one, len(one)) for one in arguments]
        places = (ctypes.c_uint64 * len(held))(*map(ctypes.addressof, held))
        number = blocks * threads

        def run(held=held):
            first, step = self._random.randrange(number), self._random.randrange(number) | 1
            while gcd(step, number) > 1:
                step += 2
            kernel(places, blocks, threads, first, step)

        self.launches[name] = self.launches.get(name, 0) + 1
        self.later(run)


def play(graph: list[Work]) -> None:
    for work in graph:
        work()


def _pages_of(size: int) -> int:
    return -(-max(size, 1) // _PAGE) * _PAGE


def _beside(size: int) -> int:
    """Bytes between an array and the next."""
    return _pages_of(size) + _PAGE - size
