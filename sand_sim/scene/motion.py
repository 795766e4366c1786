"""Motions that go on for a while: even ones, and a sine, of which a trajectory is told by few numbers."""

import math
from dataclasses import dataclass

import numpy as np

from sand_sim import rotation

_PIECES = 100  # straight ones for a period of a sine, so that the velocity jumps by at most a sixteenth of its peak
_TURN = 2.0 * math.pi / 3.0  # [rad] from one pose to the next at most: tools turn the shorter way round


@dataclass(frozen=True)
class Motion:
    """Even motion and a sine on top of it, all in the world frame, of a tool's own frame.

    Attributes:
        velocity: [m/s].
        spin: [rad/s]; the tool turns about the origin of its frame.
        amplitude: of the sine along a line [m], which begins in its middle, this way.
        frequency: of the sine [Hz].
    """

    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    amplitude: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frequency: float = 0.0

    def after(self, position: np.ndarray, orientation: np.ndarray, passed: float) -> tuple[np.ndarray, np.ndarray]:
        """Where a tool is that was somewhere when the motion began.

        Args:
            position: at the begin, shape (3,) [m].
            orientation: at the begin, shape (4,).
            passed: since then [s].
        """
        swung = math.sin(2.0 * math.pi * self.frequency * passed)
        position = np.asarray(position) + passed * np.asarray(self.velocity) + swung * np.asarray(self.amplitude)
        return position, rotation.multiply(rotation.from_vector(passed * np.asarray(self.spin)), np.asarray(orientation))

    @property
    def fastest(self) -> float:
        """Speed of the origin at most [m/s]."""
        return math.hypot(*self.velocity) + 2.0 * math.pi * self.frequency * math.hypot(*self.amplitude)

    def stops(self, begin: float, end: float) -> list[float]:
        """Times between two, both since the motion began [s], so that straight ways between the poses then make this motion."""
        rate, often = math.hypot(*self.spin), _PIECES * self.frequency
        piece = min(_TURN / rate if rate else math.inf, 1.0 / often if often else math.inf)
        return [k * piece for k in range(math.floor(begin / piece) + 1, math.ceil(end / piece))] if piece < math.inf else []
