"""Small worlds for tests, built through the public scene interface."""

from pathlib import Path

import numpy as np

from sand_sim import World, read_scene

RIGID = 1e25  # [Pa] of walls in reference cases with a rigid plane


class SceneMaker:
    """Writes grains to a file and makes scenes of them."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.number = 0

    def scene(self, position, radius, velocity=None, spin=None, material=None, **further):
        """The content of a scene file with explicitly placed grains of one material ``grain``."""
        position = np.atleast_2d(np.asarray(position, float))
        columns = {"position": position, "radius": np.broadcast_to(np.asarray(radius, float), len(position))}
        for name, value in (("velocity", velocity), ("spin", spin)):
            if value is not None:
                columns[name] = np.broadcast_to(np.asarray(value, float), position.shape)
        self.number += 1
        file = self.folder / f"grains_{self.number}.npz"
        np.savez(file, **columns)
        restitution, friction = further.pop("restitution", 0.5), further.pop("friction", 0.5)
        wall = further.pop("wall", {"density": 2500.0, "young": RIGID, "poisson": 0.3})
        solver = {"precision": further.pop("precision", "double")}
        for name in ("time_step", "skin", "threads"):
            if name in further:
                solver[name] = further.pop(name)
        parsed = {
            "gravity": further.pop("gravity", [0.0, 0.0, 0.0]),
            "materials": {"grain": material or {"density": 2500.0, "young": 1e7, "poisson": 0.25}, "wall": wall},
            "pairs": [
                {"between": ["grain", "grain"], "restitution": restitution, "friction": friction},
                {"between": ["grain", "wall"], "restitution": restitution, "friction": friction},
            ],
            "fills": [{"material": "grain", "file": str(file)}],
            "solver": solver,
        }
        return parsed | further

    def world(self, position, radius, **further) -> World:
        """A world of explicitly placed grains."""
        return World(read_scene(self.scene(position, radius, **further), self.folder))


def floor(height: float = 0.0) -> list[dict]:
    """A horizontal plane below the grains."""
    return [{"type": "plane", "name": "floor", "material": "wall", "point": [0.0, 0.0, height], "normal": [0.0, 0.0, 1.0]}]


def record(world: World, steps: int, every: int = 1) -> dict[str, np.ndarray]:
    """Step and keep the grains: time, shape (n,); position, velocity, spin, shape (n, grains, 3)."""
    rows = []
    for _ in range(steps):
        world.step(every)
        grains = world.observe().grains
        rows.append((world.time, grains.position, grains.velocity, grains.spin))
    names = ("time", "position", "velocity", "spin")
    return {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
