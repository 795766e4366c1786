"""What NumPy does with many vectors of three, several times as fast and to the same bit."""

import numpy as np


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Of vectors, shape (..., 3); shape (...)."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors, shape (n, 3)."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        product[:, k] = a[:, i] * b[:, j] - a[:, j] * b[:, i]
    return product


def extremes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the box around points, shape (..., 3)."""
    axes = [points[..., k] for k in range(3)]
    return np.array([axis.min() for axis in axes]), np.array([axis.max() for axis in axes])
