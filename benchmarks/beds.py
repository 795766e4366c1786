"""Settled beds of grains of 2 mm: from files where there are any, else settled here.

A file holds one line ``x y z`` [m] per sphere, ``bed_8000.xyz`` for instance; in ``bed_clumps_8000.xyz`` four lines are a grain.
"""

from pathlib import Path

import numpy as np
import trimesh

from sand_sim import World, read_scene, rotation
from sand_sim.assembly.tool_model import Progress
from sand_sim.scene.shapes import tetrahedron

RADIUS = 0.001  # [m]
WIDTHS = {"bed_1000": 0.0142, "bed_8000": 0.04, "bed_32000": 0.08, "bed_blade_grains": 0.08}  # of the square floor [m]
WIDTHS |= {"bed_clumps_8000": 0.064, "tile_8000": 0.04, "tile_clumps_2000": 0.032}
POURED = {"bed_1000": 1000, "bed_8000": 8000, "tile_8000": 8000, "tile_clumps_2000": 2000}
SMALLER = {"bed_32000": "tile_8000", "bed_blade_grains": "bed_32000", "bed_clumps_8000": "tile_clumps_2000"}  # what it is made of
BLADE = {"low": (0.025, 0.02, 0.014), "high": (0.025, 0.06, 0.038), "particles": 1025}  # a sheet [m]


def bed_scene(
    widths: tuple[float, float], grains: Path | None, *, shape: str = "sphere", fill: dict | None = None, **fields
) -> dict:
    """Grains of glass-like sand in an open box of the same material, as the peers have it.

    Args:
        widths: of the floor along x and y [m].
        grains: npz file to start from, or None to pour ``fill``.
        shape: of the grains.
        fill: fields of the fill.
        fields: further sections of the scene.
    """
    height = 2.0 * min(widths)
    start = {"file": str(grains)} if grains else fill
    return {
        "materials": {"sand": {"density": 2600.0, "young": 1e7, "poisson": 0.25}},
        "pairs": [{"between": ["sand", "sand"], "restitution": 0.5, "friction": 0.5}],
        "fills": [{"name": "bed", "material": "sand", "shape": shape} | start],
        "boundaries": [{"type": "box", "material": "sand", "low": [0, 0, 0], "high": [*widths, height], "open": ["top"]}],
        "domain": {"low": [-0.05, -0.05, -0.05], "high": [widths[0] + 0.05, widths[1] + 0.05, height + 0.1]},
        "frame_rate": 200,
    } | fields


def find_bed(name: str, beds: Path | None, folder: Path, progress: Progress = lambda stage, share: None) -> Path:
    """An npz file with a settled bed.

    Args:
        name: of ``WIDTHS``.
        beds: folder of beds, or None.
        folder: where the npz file goes, and stays: beds settled here are used again.
        progress: called with what is being done and the share of it, 0 to 1.
    """
    clumps = "clumps" in name
    given = beds / f"{name}.xyz" if beds else None
    if given and given.is_file():
        path, spheres = folder / f"{name}_given.npz", np.loadtxt(given)
        columns = match_clumps(spheres) if clumps else {"position": spheres}
    else:
        path = folder / f"{name}.npz"
        if path.is_file():
            return path
        columns = make_bed(name, folder, progress)
    return _save(path, columns, "tetrahedron" if clumps else "sphere")


def make_bed(name: str, folder: Path, progress: Progress) -> dict[str, np.ndarray]:
    """Pour a bed, or put a larger one together from mirrored images of a smaller one, and let it come to rest.

    Returns:
        Positions (n, 3) [m], and orientations (n, 4) of clumps.
    """
    width = WIDTHS[name]
    if name in POURED:
        return settle(name, folder, progress)
    smaller = SMALLER[name]
    columns = dict(np.load(find_bed(smaller, None, folder, progress)))
    if name == "bed_blade_grains":
        low, high = np.array(BLADE["low"]), np.array(BLADE["high"])
        position = columns["position"]
        beside = np.linalg.norm(position - np.clip(position, low, high), axis=1) > 2.0 * RADIUS
        return _rest({"position": position[beside]}, width, "sphere", folder, progress, {"blade": blade_tool(folder)})
    clumps = "clumps" in name
    spheres = clump_spheres(columns) if clumps else columns["position"]
    spheres = repeat(spheres, WIDTHS[smaller], (2, 2))
    columns = match_clumps(spheres) if clumps else {"position": spheres}
    return _rest(columns, width, "tetrahedron" if clumps else "sphere", folder, progress)


def repeat(spheres: np.ndarray, width: float, tiles: tuple[int, int]) -> np.ndarray:
    """A bed repeated along x and y, each image the mirror image of its neighbour.

    A tile settles between rigid walls without friction, which push as its mirror images do; so where there were walls, images
    are in balance with each other. Spheres on either side of a mirror are no nearer to each other than one is to the other's
    image, and overlap with their own images by twice what they overlapped with the wall.

    Args:
        spheres: centres between 0 and the width along x and y, shape (n, 3) [m].
        width: of the bed [m].
        tiles: images along x and y.

    Returns:
        Centres, shape (n tiles, 3), image by image [m].
    """
    for axis, number in enumerate(tiles):
        images = []
        for k in range(number):
            image = spheres.copy()
            image[:, axis] = k * width + (width - spheres[:, axis] if k % 2 else spheres[:, axis])
            images.append(image)
        spheres = np.concatenate(images)
    return spheres


def clump_spheres(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Spheres of four-sphere grains, shape (4 n, 3) [m], four lines a grain."""
    arms = np.einsum("nij,kj->nki", rotation.to_matrices(columns["orientation"]), RADIUS * tetrahedron().centres)
    return (columns["position"][:, None] + arms).reshape(-1, 3)


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


def settle(name: str, folder: Path, progress: Progress) -> dict[str, np.ndarray]:
    """Pour grains into a box and let them come to rest; positions (n, 3) [m], and orientations (n, 4) of clumps."""
    width, shape = WIDTHS[name], "tetrahedron" if "clumps" in name else "sphere"
    radius = RADIUS if shape == "sphere" else RADIUS * tetrahedron().equal_radius
    fill = {"radius": radius, "region": {"low": [0, 0, 0], "high": [width, width, 40.0 * width]}, "count": POURED[name]}
    scene = bed_scene((width, width), None, shape=shape, fill=fill, settle={"time": 1.0, "speed": 1e-3})
    box = scene["boundaries"][0]
    scene["domain"]["high"][2] = box["high"][2] = 42.0 * width
    if name.startswith("tile"):
        box |= {"open": ["left", "right", "front", "back", "top"]}
        scene["boundaries"].append(box | {"name": "mirrors", "material": "mirror", "open": ["bottom", "top"]})
        scene["materials"]["mirror"] = {"density": 2600.0, "young": 1e25, "poisson": 0.25}
        scene["pairs"].append({"between": ["sand", "mirror"], "restitution": 0.5, "friction": 0.0})
    return _grains_at_rest(scene, shape, folder, progress)


def _rest(columns: dict, width: float, shape: str, folder: Path, progress: Progress, tools: dict | None = None) -> dict:
    """Let a bed come to rest that nearly is."""
    fields = {"settle": {"time": 0.1, "speed": 1e-3}} | ({"tools": tools} if tools else {})
    scene = bed_scene((width, width), _save(folder / "unsettled.npz", columns, shape), shape=shape, **fields)
    return _grains_at_rest(scene, shape, folder, progress)


def _grains_at_rest(scene: dict, shape: str, folder: Path, progress: Progress) -> dict[str, np.ndarray]:
    grains = World(read_scene(scene, folder), progress).observe().grains
    columns = {"position": grains.position}
    return columns if shape == "sphere" else columns | {"orientation": grains.orientation}


def _save(path: Path, columns: dict[str, np.ndarray], shape: str) -> Path:
    radius = RADIUS if shape == "sphere" else RADIUS * tetrahedron().equal_radius
    np.savez(path, **(columns | {"radius": np.full(len(columns["position"]), radius)}))
    return path


def blade_tool(folder: Path) -> dict:
    """The blade as a scene has it."""
    low, high = np.array(BLADE["low"]), np.array(BLADE["high"])
    path = folder / "blade.stl"
    corners = [low, (low[0], high[1], low[2]), high, (low[0], low[1], high[2])]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).export(path)
    spacing = float(np.sqrt(2.0 * np.prod((high - low)[1:]) / (np.sqrt(3.0) * BLADE["particles"])))
    return {"mesh": str(path), "material": "sand", "particle_radius": RADIUS, "particle_spacing": spacing, "max_speed": 0.2}
