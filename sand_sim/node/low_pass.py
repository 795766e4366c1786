"""Low-pass filter for wrenches and other signals that come frame by frame."""

from math import inf, isfinite, pi, sqrt, tan

import numpy as np


class LowPass:
    """Second-order Butterworth filter ``H(s) = 1 / (1 + sqrt(2) s/w + (s/w)^2)``, w = 2 pi cut-off.

    Of second order, because forces of grains on a tool are noisy up to the frame rate: at ten times the cut-off it leaves 1 %
    where a first-order filter leaves 10 %, for 4 % of overshoot after a step and a delay of 0.23 / cut-off at low frequencies.

    It is integrated by the trapezoidal rule with the frequency warped so that the gain is exactly one at rest and exactly
    1/sqrt(2) at the cut-off, whatever the sample time. Its state is that of the continuous filter, so sample times may change
    from one sample to the next. Where a sample time is too long for the cut-off (half its period or more) nothing is to be
    filtered, and the sample itself comes out.

    Args:
        cutoff: frequency at which the power is halved [Hz]; infinity filters nothing.

    Raises:
        ValueError: if the cut-off is not positive.

    Source: V. Zavalishin, The Art of VA Filter Design, 2012, section 4.4 (state variable filter); S. Butterworth 1930.
    """

    def __init__(self, cutoff: float):
        if not cutoff > 0.0:
            raise ValueError(f"cutoff: must be a positive frequency in Hz, not {cutoff}")
        self.cutoff = cutoff
        self.reset()

    def reset(self) -> None:
        """Forget all samples; the next one is the initial state, as if it had been there for ever."""
        self._band, self._low = None, None

    def filter(self, sample: np.ndarray, interval: float) -> np.ndarray:
        """Take in a sample.

        Args:
            sample: of any shape, the same every time.
            interval: time since the sample before [s]; the first sample's does not matter. With zero nothing changes.

        Returns:
            Filtered sample, of the same shape and unit.

        Raises:
            ValueError: if the interval is negative or not finite.
        """
        sample = np.asarray(sample, float)
        if self._low is None:
            self._band, self._low, self._last = np.zeros_like(sample), sample.copy(), sample.copy()
            return sample.copy()
        if not (isfinite(interval) and interval >= 0.0):
            raise ValueError(f"interval: must be a time in seconds since the sample before, not {interval}")
        if interval == 0.0:
            return self._last.copy()
        share = self.cutoff * interval  # of a period of the cut-off
        warped = tan(pi * share) if share < 0.5 else inf
        if warped == inf:
            self._band, self._low, self._last = np.zeros_like(sample), sample.copy(), sample.copy()
            return sample.copy()
        gain = 1.0 / (1.0 + warped * (warped + sqrt(2.0)))
        band = gain * (self._band + warped * (sample - self._low))
        low = self._low + warped * band
        self._band, self._low = 2.0 * band - self._band, 2.0 * low - self._low
        self._last = low
        return low.copy()
