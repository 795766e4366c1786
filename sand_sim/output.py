"""Output that nobody reads to its end, as in ``| head``."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

UNREAD = 141  # exit code, by which shells tell that a program ended because nobody read on


@contextmanager
def perhaps_unread() -> Iterator[None]:
    """End the code inside quietly when the reader of its output has gone."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()  # now: at exit Python would report the broken pipe as an error
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what is still in the buffer
