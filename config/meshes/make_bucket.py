"""Make ``bucket.stl``, the bucket of the digging demo: a curved shell with side walls, one closed solid, in metres.

The tool frame lies in the pivot at the top of the back; x points forward to the cutting lip, y to the left, z up.
Run it with ``python config/meshes/make_bucket.py``.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh

WIDTH = 0.14
WALL = 0.006
# Outer shell in the x-z plane, from the top of the back round the bottom to the lip; convex.
OUTER = np.array(
    [
        [-0.030, 0.000],
        [-0.052, -0.022],
        [-0.060, -0.052],
        [-0.052, -0.082],
        [-0.030, -0.104],
        [0.000, -0.115],
        [0.055, -0.115],
        [0.105, -0.108],
    ]
)


def inset(outline: np.ndarray, distance: float) -> np.ndarray:
    """The outline moved inwards by a distance, its ends staying on the mouth, the line between them."""
    edges = np.diff(outline, axis=0)
    normals = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    mouth = outline[0] - outline[-1]
    lines = [(p + distance * n, e) for p, n, e in zip(outline[:-1], normals, edges, strict=True)]
    lines = [(outline[0], mouth), *lines, (outline[-1], mouth)]
    points = []
    for (p, d), (q, e) in pairwise(lines):
        share = np.linalg.solve(np.column_stack([d, -e]), q - p)[0]
        points.append(p + share * d)
    return np.array(points)


def make_bucket() -> trimesh.Trimesh:
    """Outer shell, inner shell, and the rim of the mouth that joins them."""
    inner, half, depth = inset(OUTER, WALL), 0.5 * WIDTH, 0.5 * WIDTH - WALL
    number = len(OUTER)
    rings = [(OUTER, half), (OUTER, -half), (inner, depth), (inner, -depth)]
    vertices = np.concatenate([np.column_stack([r[:, 0], np.full(number, y), r[:, 1]]) for r, y in rings])
    left, right, hollow_left, hollow_right = (k * number for k in range(4))
    faces = []
    for k in range(number - 1):
        faces += [[left + k, left + k + 1, right + k + 1], [left + k, right + k + 1, right + k]]
        faces += [
            [hollow_left + k, hollow_right + k + 1, hollow_left + k + 1],
            [hollow_left + k, hollow_right + k, hollow_right + k + 1],
        ]
    for k in range(1, number - 1):
        faces += [[left, left + k + 1, left + k], [right, right + k, right + k + 1]]
        faces += [[hollow_left, hollow_left + k, hollow_left + k + 1], [hollow_right, hollow_right + k + 1, hollow_right + k]]
    last = number - 1
    for outer, inside in (
        ((left, right), (hollow_left, hollow_right)),
        ((right + last, left + last), (hollow_right + last, hollow_left + last)),
        ((left + last, left), (hollow_left + last, hollow_left)),
        ((right, right + last), (hollow_right, hollow_right + last)),
    ):
        faces += [[outer[0], outer[1], inside[1]], [outer[0], inside[1], inside[0]]]
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    mesh.fix_normals()
    return mesh


if __name__ == "__main__":
    bucket = make_bucket()
    assert bucket.is_watertight and bucket.volume > 0.0
    bucket.export(Path(__file__).with_name("bucket.stl"))
    print(f"bucket.stl: {len(bucket.faces)} faces, {bucket.volume * 1e6:.1f} cm^3 of steel")
