"""What a node says while it prepares itself and cannot answer yet."""

import time
from collections.abc import Callable

_PERIOD = 2.0  # [s] between two lines; a start that is over sooner says nothing


class Preparation:
    """A progress callback that tells every few seconds how far the preparation is, and gives up when the user wants to stop.

    Args:
        check: called each time; may raise to give up.
        tell: takes a line.
    """

    def __init__(self, check: Callable[[], None], tell: Callable[[str], None]):
        self._check, self._tell, self._told = check, tell, time.monotonic()

    def __call__(self, stage: str, share: float) -> None:
        """Take note of the share of a stage that is done, 0 to 1."""
        self._check()
        if time.monotonic() - self._told > _PERIOD:
            self._told = time.monotonic()
            self._tell(f"{stage}, {share:.0%}")
