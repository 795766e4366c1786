"""Small worlds for tests, built through the public scene interface."""

from pathlib import Path

import numpy as np
import trimesh
import yaml

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
        numbers = {"restitution": further.pop("restitution", 0.5), "friction": further.pop("friction", 0.5)}
        numbers |= further.pop("numbers", {})
        wall = further.pop("wall", {"density": 2500.0, "young": RIGID, "poisson": 0.3})
        solver = {"precision": further.pop("precision", "double")}
        for name in ("time_step", "force_time_step", "skin", "threads", "integrator", "device"):
            if name in further:
                solver[name] = further.pop(name)
        parsed = {
            "gravity": further.pop("gravity", [0.0, 0.0, 0.0]),
            "materials": {"grain": material or {"density": 2500.0, "young": 1e7, "poisson": 0.25}, "wall": wall},
            "pairs": [
                {"between": ["grain", "grain"]} | numbers,
                {"between": ["grain", "wall"]} | numbers,
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


def write_small_scene(folder: Path, **further) -> Path:
    """A scene file with a few grains on a floor and a plate above them, quick to start and to run."""
    mesh = trimesh.creation.box((0.06, 0.06, 0.004))
    mesh.export(folder / "plate.stl")
    lattice = np.stack(np.meshgrid(range(4), range(4), range(2), indexing="ij"), -1).reshape(-1, 3)
    np.savez(folder / "bed.npz", position=0.0101 * lattice + [0.0, 0.0, 0.0049], radius=np.full(len(lattice), 0.005))
    parsed = {
        "name": "small",
        "materials": {
            "sand": {"density": 2600.0, "young": 1e7, "poisson": 0.25},
            "steel": {"density": 7800.0, "young": 1e8, "poisson": 0.3},
        },
        "pairs": [
            {"between": ["sand", "sand"], "restitution": 0.3, "friction": 0.5},
            {"between": ["sand", "steel"], "restitution": 0.3, "friction": 0.3},
        ],
        "fills": [{"material": "sand", "file": "bed.npz"}],
        "boundaries": [{"name": "floor", "type": "plane", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 1]}],
        "domain": {"low": [-0.2, -0.2, -0.05], "high": [0.25, 0.25, 0.3]},
        "tools": {
            "plate": {
                "mesh": "plate.stl",
                "material": "steel",
                "particle_radius": 0.003,
                "max_speed": 1.0,
                "trajectory": [
                    {"time": 0.0, "position": [0.015, 0.015, 0.06]},
                    {"time": 0.3, "position": [0.015, 0.015, 0.024], "phase": "press"},
                    {"time": 0.4, "position": [0.02, 0.015, 0.05], "phase": "carry"},
                ],
            }
        },
        "duration": 0.4,
        "frame_rate": 50,
    }
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(parsed | further))
    return path
