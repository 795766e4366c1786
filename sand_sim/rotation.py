"""Unit quaternions x y z w on the host, the little that commands and reports need."""

import numpy as np


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation b, then rotation a, shape (4,)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def inverse(q: np.ndarray) -> np.ndarray:
    """The opposite rotation, shape (4,)."""
    return np.array([-q[0], -q[1], -q[2], q[3]])


def rotate(q: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotate vectors, shape (..., 3)."""
    axis, w = np.asarray(q[:3]), q[3]
    twice = 2.0 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)


def from_vector(vector: np.ndarray) -> np.ndarray:
    """Rotation about a vector by its length [rad]."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    return np.append(np.asarray(vector) / angle * np.sin(0.5 * angle), np.cos(0.5 * angle))


def to_vector(q: np.ndarray) -> np.ndarray:
    """Axis times angle [rad] of the shorter way round, shape (3,)."""
    q = np.asarray(q, float) if q[3] >= 0.0 else -np.asarray(q, float)
    sine = float(np.linalg.norm(q[:3]))
    if sine == 0.0:
        return np.zeros(3)
    return q[:3] / sine * 2.0 * np.arctan2(sine, q[3])


def between(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Rotation at a share (0 to 1) of the way from a to b, at constant angular velocity."""
    return multiply(from_vector(share * to_vector(multiply(b, inverse(a)))), a)
