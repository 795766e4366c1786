"""Unit quaternions x y z w on the host, the little that commands and reports need."""

import numpy as np

_LEAST_LENGTH = 1e-6  # of a quaternion that somebody meant


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Rotation b, then rotation a, shape (..., 4)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = (np.moveaxis(np.asarray(q, float), -1, 0) for q in (a, b))
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def unit(q: np.ndarray) -> np.ndarray:
    """A quaternion at length one, shape (4,).

    Raises:
        ValueError: if it is the zero quaternion, or shorter than 1e-6.
    """
    q = np.asarray(q, float)
    largest = float(np.abs(q).max())  # divided out first, because squares of large numbers overflow
    if largest < _LEAST_LENGTH or largest * (length := float(np.linalg.norm(q / largest))) < _LEAST_LENGTH:
        raise ValueError("the zero quaternion; (0, 0, 0, 1) is no rotation")
    return q / largest / length


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


def from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Fixed-axis roll, pitch, yaw [rad] (REP-103), shape (4,)."""
    cr, sr, cp, sp, cy, sy = (f(a / 2.0) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


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


def to_matrices(turns: np.ndarray) -> np.ndarray:
    """Rotation matrices of unit quaternions, shape (..., 4) to (..., 3, 3)."""
    x, y, z, w = np.moveaxis(np.asarray(turns, float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternion of a rotation matrix, shape (4,)."""
    # The symmetric matrix whose largest eigenvector is the quaternion is well conditioned for every rotation.
    (a, b, c), (d, e, f), (g, h, i) = matrix
    symmetric = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    q = np.linalg.eigh(symmetric)[1][:, -1]
    return q if q[3] >= 0.0 else -q


def at_random(number: int, random: np.random.Generator) -> np.ndarray:
    """Evenly distributed unit quaternions, shape (number, 4)."""
    q = random.normal(size=(number, 4))
    return q / np.linalg.norm(q, axis=1)[:, None]
