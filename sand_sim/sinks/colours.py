"""One colour scale for grain speeds, in recordings and figures alike."""

import numpy as np

from sand_sim.scene.types import Scene

_STOPS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
_COLOURS = np.array([[214, 184, 132], [232, 190, 90], [240, 140, 60], [205, 62, 58], [110, 24, 74]], float)


def fastest_shown(scene: Scene) -> float:
    """Speed at the end of the scale [m/s]: as fast as any tool may be; 1 m/s without tools."""
    return max((tool.max_speed for tool in scene.tools), default=1.0)


def colour_by_speed(speed: np.ndarray, fastest: float) -> np.ndarray:
    """Colours from sand (at rest) to dark red (at ``fastest`` and above); slow motion is spread out by a square root.

    Args:
        speed: shape (n,) [m/s].
        fastest: speed at the end of the scale [m/s].

    Returns:
        RGB, shape (n, 3), uint8.
    """
    share = np.sqrt(np.clip(speed / fastest, 0.0, 1.0))
    return np.column_stack([np.interp(share, _STOPS, _COLOURS[:, k]) for k in range(3)]).astype(np.uint8)
