"""Progress on a terminal."""

import contextlib
import fcntl
import os
import struct
import sys
import termios

import pytest

from sand_sim.cli.console import Console
from sand_sim.cli.main import main


@pytest.fixture
def terminal(monkeypatch):
    """``terminal(columns)`` makes stderr a terminal so wide, and gives a function that closes it and reads what came."""
    leaders = []

    def make(columns):
        leader, follower = os.openpty()
        fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        stream = os.fdopen(follower, "w")
        monkeypatch.setattr(sys, "stderr", stream)
        leaders.append(leader)

        def read():
            stream.close()
            came = b""
            with contextlib.suppress(OSError):  # which is how a terminal ends that nobody writes to any more
                while more := os.read(leader, 100_000):
                    came += more
            return came.decode().replace("\r\n", "\n")

        return read

    yield make
    for leader in leaders:
        os.close(leader)


def screen(text):
    """The lines that are to be seen, if none is wider than the terminal."""
    return [line.split("\r\x1b[K")[-1] for line in text.split("\n")]


@pytest.mark.parametrize(("columns", "seen"), [(80, 79), (0, 100)])  # some terminals do not tell how wide they are
def test_progress_is_one_line_that_does_not_wrap(terminal, columns, seen):
    read, console = terminal(columns), Console()
    for digit in "123":
        console.line(100 * digit)
    console.end()
    assert screen(read()) == [seen * "3", ""]


def test_a_terminal_that_has_just_gone_is_no_error(monkeypatch):
    """Before the signal of it is looked at."""
    leader, follower = os.openpty()
    stream = os.fdopen(follower, "w")
    monkeypatch.setattr(sys, "stderr", stream)
    console = Console()
    console.line("progress")
    os.close(leader)
    console.line("progress", force=True)
    console.tell("a word")
    console.end()
    monkeypatch.undo()
    with contextlib.suppress(OSError):
        stream.close()


def test_what_is_told_stays_whole(terminal):
    """The next progress wrote over a warning of the time step."""
    read, console = terminal(80), Console()
    console.line("progress")
    console.tell(100 * "w")
    console.line("more progress")
    console.end()
    console.tell("last words")
    assert screen(read()) == [100 * "w", "more progress", "last words", ""]


def test_an_error_is_not_written_behind_progress(terminal):
    read, console = terminal(300), Console()
    console.line("settling  30 %")
    assert main(["run", "nothing"]) == 1
    line, rest = screen(read())
    assert line.startswith("sand_sim: scene 'nothing'")
    assert not rest
