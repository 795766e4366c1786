"""Worlds for studies: explicitly placed grains and simple tools, made through the public scene interface."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from sand_sim.scene.reading import read_scene
from sand_sim.world import World

RIGID = 1e25  # [Pa] of walls where closed forms ask for a rigid plane
GRAIN = {"density": 2500.0, "young": 1e7, "poisson": 0.25}
WALL = {"density": 2500.0, "young": RIGID, "poisson": 0.25}


class Bench:
    """Makes worlds and remembers the last, so that its indicators can be read whatever became of it.

    Args:
        folder: for files of grains and meshes.
        check: called now and then; may raise to give up.

    Attributes:
        world: the last one made, None before.
    """

    def __init__(self, folder: Path, check: Callable[[], None] = lambda: None):
        self.folder, self.check = folder, check
        self.world: World | None = None

    def make(self, position, radius, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), **further) -> World:
        """A world of grains at positions [m] with radii [m], velocities [m/s] and spins [rad/s].

        Args:
            position: shape (n, 3) or (3,).
            radius: shape (n,) or one for all.
            velocity: shape (n, 3) or one for all.
            spin: shape (n, 3) or one for all.
            further: sections of a scene file, which replace the defaults; ``grain`` and ``wall`` change materials,
                ``restitution`` and ``friction`` all pairs, and what remains under ``solver`` joins the defaults.
        """
        return self.open(self.scene(position, radius, velocity, spin, **further))

    def open(self, parsed: dict) -> World:
        """The world of a scene's content."""
        self.check()
        self.world = None
        self.world = World(read_scene(parsed, self.folder))
        return self.world

    def scene(self, position, radius, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), **further) -> dict:
        """The content of a scene file, see ``make``."""
        position = np.atleast_2d(np.asarray(position, float))
        np.savez(
            self.folder / "grains.npz",
            position=position,
            radius=np.broadcast_to(np.asarray(radius, float), len(position)),
            velocity=np.broadcast_to(np.asarray(velocity, float), position.shape),
            spin=np.broadcast_to(np.asarray(spin, float), position.shape),
        )
        rule = {"restitution": further.pop("restitution", 0.5), "friction": further.pop("friction", 0.5)}
        parsed = {
            "gravity": [0.0, 0.0, 0.0],
            "materials": {"grain": GRAIN | further.pop("grain", {}), "wall": WALL | further.pop("wall", {})},
            "pairs": [{"between": ["grain", other], **rule} for other in ("grain", "wall")],
            "fills": [{"material": "grain", "file": "grains.npz"}],
            "solver": {"precision": "double", "threads": 1} | further.pop("solver", {}),
        }
        return parsed | further

    def plate(self, low, high, particle_radius: float, max_speed: float, position=(0.0, 0.0, 0.0)) -> dict:
        """A scene's ``tools`` with one block between two corners in its own frame [m], at a position [m]."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        mesh = trimesh.creation.box(high - low)
        mesh.apply_translation(0.5 * (low + high))
        mesh.export(self.folder / "plate.stl")
        tool = {"mesh": "plate.stl", "material": "wall", "particle_radius": particle_radius, "max_speed": max_speed}
        return {"plate": tool | {"pose": {"position": [float(c) for c in position]}}}


def run_for(world: World, time: float) -> None:
    """Step for at least a time [s]."""
    world.step(max(1, int(np.ceil(time / world.time_step))))


def plane(height: float = 0.0) -> dict:
    """An entry of ``boundaries``: a level plane at a height [m]."""
    return {"type": "plane", "name": "floor", "material": "wall", "point": [0.0, 0.0, height], "normal": [0.0, 0.0, 1.0]}


def box(low, high, **further) -> dict:
    """An entry of ``boundaries``: a closed box between two corners [m]."""
    corners = {"low": [float(c) for c in low], "high": [float(c) for c in high]}
    return {"type": "box", "name": "box", "material": "wall"} | corners | further


def lattice(numbers, spacing: float, start=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Points of a simple cubic lattice, shape (n, 3) [m]."""
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in numbers], indexing="ij"), -1).reshape(-1, 3)
    return spacing * grid + np.asarray(start, float)


def close_packing(cells: int, spacing: float) -> np.ndarray:
    """Centres of a face-centred cubic packing with a distance between neighbours [m], shape (4 cells^3, 3)."""
    corners = lattice((cells,) * 3, 1.0)
    basis = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]])
    return np.sqrt(2.0) * spacing * (corners[:, None] + basis).reshape(-1, 3)
