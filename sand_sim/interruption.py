"""Ctrl-C, SIGTERM and a terminal that is closed as a wish that long work looks at, instead of an exception at any moment."""

import os
import signal


class InterruptedByUserError(Exception):
    """The user has asked to stop."""


class Interruption:
    """Turns SIGINT, SIGTERM and SIGHUP into a flag, from now on; to be made in the main thread.

    A second signal acts at once, in case the flag is not looked at; but SIGHUP comes from the shell and from the system.
    """

    def __init__(self):
        self._asked = False  # not an Event: a second signal inside of set() would wait for its lock for ever
        self._terminals = [stream for stream in (1, 2) if os.isatty(stream)]
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as nohup has it
            signal.signal(signal.SIGHUP, self._hang_up)

    @property
    def asked(self) -> bool:
        """Whether the user wants to stop."""
        return self._asked

    def check(self) -> None:
        """Raise ``InterruptedByUserError`` if the user wants to stop."""
        if self.asked:
            raise InterruptedByUserError("interrupted by the user")

    def _ask(self, number: int, _) -> None:
        if self.asked:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        self._asked = True

    def _hang_up(self, *_) -> None:
        """Nothing can be written to the terminal any more, which would be an error before the results are."""
        self._asked = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in self._terminals:
            os.dup2(nowhere, stream)
        os.close(nowhere)
