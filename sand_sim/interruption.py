"""Ctrl-C and SIGTERM as a wish that long work looks at, instead of an exception at any moment."""

import signal


class InterruptedByUserError(Exception):
    """The user has asked to stop."""


class Interruption:
    """Turns SIGINT and SIGTERM into a flag, from now on; to be made in the main thread.

    A second signal acts at once, in case the flag is not looked at.
    """

    def __init__(self):
        self._asked = False  # not an Event: a second signal inside of set() would wait for its lock for ever
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

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
