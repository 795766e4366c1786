"""Materials of worlds of free rigid bodies."""

from scenes import RIGID

MATERIALS = {
    "stone": {"density": 2500.0, "young": 1e7, "poisson": 0.25},
    "wall": {"density": 2500.0, "young": RIGID, "poisson": 0.3},
}
