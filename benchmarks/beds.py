"""Settled beds of grains of 2 mm: from files where there are any, else settled here.

A file holds one line ``x y z`` [m] per sphere, ``bed_8000.xyz`` for instance; in ``bed_clumps_8000.xyz`` four lines are a grain.
"""

from pathlib import Path

import numpy as np

from sand_sim import World, read_scene, rotation
from sand_sim.scene.shapes import tetrahedron

RADIUS = 0.001  # [m]
WIDTHS = {"bed_8000": 0.04, "bed_32000": 0.08, "bed_blade_grains": 0.08, "bed_clumps_8000": 0.064}  # of the square floor [m]


def bed_scene(width: float, grains: Path | None, *, shape: str = "sphere", fill: dict | None = None, **fields) -> dict:
    """Grains of glass-like sand in an open box of the same material, as the peers have it.

    Args:
        width: of the square floor [m].
        grains: npz file to start from, or None to pour ``fill``.
        shape: of the grains.
        fill: fields of the fill.
        fields: further sections of the scene.
    """
    start = {"file": str(grains)} if grains else fill
    return {
        "materials": {"sand": {"density": 2600.0, "young": 1e7, "poisson": 0.25}},
        "pairs": [{"between": ["sand", "sand"], "restitution": 0.5, "friction": 0.5}],
        "fills": [{"name": "bed", "material": "sand", "shape": shape} | start],
        "boundaries": [
            {"type": "box", "material": "sand", "low": [0, 0, 0], "high": [width, width, 2.0 * width], "open": ["top"]}
        ],
        "domain": {"low": [-0.05, -0.05, -0.05], "high": [width + 0.05, width + 0.05, 2.0 * width + 0.1]},
        "frame_rate": 200,
    } | fields


def find_bed(name: str, beds: Path | None, folder: Path) -> Path:
    """An npz file with a settled bed.

    Args:
        name: of ``WIDTHS``.
        beds: folder of beds, or None.
        folder: where the npz file goes, and stays: beds settled here are used again.
    """
    path, clumps = folder / f"{name}.npz", "clumps" in name
    given = beds / f"{name}.xyz" if beds else None
    if given and given.is_file():
        spheres = np.loadtxt(given)
        columns = match_clumps(spheres) if clumps else {"position": spheres}
    elif path.is_file():
        return path
    else:
        columns = settle(8000 if "8000" in name else 32000, WIDTHS[name], "tetrahedron" if clumps else "sphere", folder)
    radius = RADIUS * tetrahedron().equal_radius if clumps else RADIUS
    np.savez(path, radius=np.full(len(columns["position"]), radius), **columns)
    return path


def match_clumps(spheres: np.ndarray) -> dict[str, np.ndarray]:
    """Centres (n, 3) [m] and orientations (n, 4) of four-sphere grains from their spheres, shape (4 n, 3)."""
    grains = spheres.reshape(-1, 4, 3)
    centre = grains.mean(axis=1)
    corners = tetrahedron().centres
    # A tetrahedron may be numbered like its mirror image; then two corners are exchanged.
    turns, mirrored = (_turn_onto(corners[list(order)], grains - centre[:, None]) for order in ((0, 1, 2, 3), (0, 1, 3, 2)))
    turns = np.where((np.linalg.det(turns) > 0.0)[:, None, None], turns, mirrored)
    return {"position": centre, "orientation": np.array([rotation.from_matrix(turn) for turn in turns])}


def _turn_onto(corners: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Orthogonal matrices, shape (n, 3, 3), that turn corners (4, 3) best onto arms (n, 4, 3)."""
    u, _, v = np.linalg.svd(corners.T @ arms)
    return np.swapaxes(u @ v, 1, 2)


def settle(number: int, width: float, shape: str, folder: Path) -> dict[str, np.ndarray]:
    """Pour grains into the box and let them come to rest; positions (n, 3) [m], and orientations (n, 4) of clumps."""
    radius = RADIUS if shape == "sphere" else RADIUS * tetrahedron().equal_radius
    fill = {"radius": radius, "region": {"low": [0, 0, 0], "high": [width, width, 40.0 * width]}, "count": number}
    scene = bed_scene(width, None, shape=shape, fill=fill, settle={"time": 1.0, "speed": 1e-3})
    scene["domain"]["high"][2] = scene["boundaries"][0]["high"][2] = 42.0 * width
    world = World(read_scene(scene, folder))
    grains = world.observe().grains
    columns = {"position": grains.position}
    return columns if shape == "sphere" else columns | {"orientation": grains.orientation}
