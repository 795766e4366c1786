"""Something that is due some times a simulated second."""


class Rate:
    """Remembers when it is due next."""

    def __init__(self):
        self._next = 0.0
        self._last = -1.0

    def due(self, time: float, rate: float) -> bool:
        """Whether it is due now.

        Args:
            time: simulated [s]; one that is not later than the last one begins anew.
            rate: how often [1/s]; 0 for never.
        """
        if time <= self._last:
            self._next = time
        self._last = time
        if rate <= 0.0 or time < self._next - 1e-9:
            return False
        self._next = max(self._next + 1.0 / rate, time)
        return True
