"""Progress on the console: one line that is written over on a terminal, now and then a line elsewhere."""

import errno
import os
import sys
import time

_EVERY = 5.0  # [s] between lines where lines cannot be written over


class Console:
    """Shows where long work is."""

    def __init__(self):
        self._stream, self._shown, self._open = sys.stderr, 0.0, False  # that of now, not of the import
        self._stage = ""

    def stage(self, name: str, share: float) -> None:
        """Show the share of a stage that is done, 0 to 1."""
        if name != self._stage or share >= 1.0 or self._stream.isatty():
            self.line(f"{name} {100.0 * share:3.0f} %", force=name != self._stage or share >= 1.0)
            self._stage = name
        if share >= 1.0:
            self.end()

    def line(self, text: str, force: bool = False) -> None:
        """Show one line; where it cannot be written over only every few seconds unless forced.

        What the terminal is too narrow for is cut: a line that wraps cannot be written over.
        """
        now = time.monotonic()
        if self._stream.isatty():
            columns = os.get_terminal_size(self._stream.fileno()).columns  # 0 where that is not known
            self._print(f"\r\x1b[K{text[: columns - 1] if columns else text}", end="")
            self._open = True
        elif force or now - self._shown > _EVERY:
            self._print(text)
            self._shown = now

    def tell(self, text: str) -> None:
        """Show a line that stays, whole, in place of progress that may stand there."""
        self._print(f"\r\x1b[K{text}" if self._stream.isatty() else text)
        self._open = False

    def end(self) -> None:
        """Leave the line as it stands."""
        if self._open:
            self._print("")
            self._open = False

    def _print(self, text: str, end: str = "\n") -> None:
        try:
            print(text, end=end, file=self._stream, flush=True)
        except OSError as error:
            if error.errno != errno.EIO:  # of a terminal that has just been closed, which ``Interruption`` sees to
                raise
