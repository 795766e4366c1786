"""What a surface costs by how it is told: grains in a closed funnel that is a wall, a rough tool, or a smooth mesh.

All stand with the same grains and step in turn, so that a busy machine slows all of them alike. Prints JSON lines. Run from the
root of the source tree: ``python -m benchmarks.funnel``.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.provenance import provenance
from sand_sim import World, read_scene

GRAINS, ROUNDS, STEPS = 2500, 20, 200
HOLE, RIM, HEIGHT, WALL = 0.008, 0.05, 0.08, 0.004  # [m]
CASES = {"wall": ("wall", 0), "rough": ("rough", 64), "smooth, 16 facets": ("smooth", 16), "smooth, 64 facets": ("smooth", 64)}


def funnel(facets: int) -> trimesh.Trimesh:
    """A funnel about z whose hole is at the origin; facets slender along the wall."""
    angles = 2.0 * np.pi * np.arange(facets) / facets
    profile = ((HOLE, 0.0), (RIM, HEIGHT), (RIM + WALL, HEIGHT), (HOLE + WALL, 0.0))
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(facets, z)]) for r, z in profile]
    at, after = np.arange(facets), np.roll(np.arange(facets), -1)
    faces = []
    for k in range(4):
        low, high = facets * k, facets * ((k + 1) % 4)
        faces += [np.column_stack([low + at, high + at, low + after]), np.column_stack([low + after, high + at, high + after])]
    mesh = trimesh.Trimesh(np.concatenate(rings), np.concatenate(faces))
    if mesh.volume < 0.0:
        mesh.invert()
    return mesh


def make_world(kind: str, facets: int, folder: Path, threads: int) -> World:
    """The funnel with grains at rest in it, its hole closed."""
    steel = {"material": "steel"}
    plug = {"type": "plane", "name": "plug", "point": [0.0, 0.0, 0.002], "normal": [0.0, 0.0, 1.0]} | steel
    wall = {"type": "cone", "name": "funnel", "point": [0.0] * 3, "axis": [0.0, 0.0, 1.0]} | steel
    wall |= {"hole_radius": HOLE, "radius": RIM, "height": HEIGHT}
    region = {"low": [-0.025, -0.025, 0.012], "high": [0.025, 0.025, 0.16]}
    parsed = {
        "materials": {
            "glass": {"density": 2500.0, "young": 5e6, "poisson": 0.25},
            "steel": {"density": 7800.0, "young": 5e7, "poisson": 0.3},
        },
        "pairs": [{"between": ["glass", other], "restitution": 0.5, "friction": 0.5} for other in ("glass", "steel")],
        "fills": [{"material": "glass", "radius": 0.002, "count": GRAINS, "seed": 1, "region": region}],
        "boundaries": [plug, wall] if kind == "wall" else [plug],
        "settle": {"time": 0.6},
        "domain": {"low": [-0.1, -0.1, -0.05], "high": [0.1, 0.1, 0.3]},
        "solver": {"threads": threads},
    }
    if kind != "wall":
        funnel(facets).export(folder / f"{facets}.stl")
        parsed["tools"] = {"funnel": {"mesh": f"{facets}.stl", "particle_radius": 0.002, "contact": kind} | steel}
    return World(read_scene(parsed, folder))


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--threads", type=int, default=1, help="cores (default: 1)")
    threads = parser.parse_args().threads
    with tempfile.TemporaryDirectory() as folder:
        worlds = {name: make_world(kind, facets, Path(folder), threads) for name, (kind, facets) in CASES.items()}
    spent = {name: [] for name in CASES}
    for _ in range(ROUNDS):
        for name, world in worlds.items():
            begin = time.perf_counter()
            world.step(STEPS)
            spent[name].append(1e6 * (time.perf_counter() - begin) / STEPS)
    for name, world in worlds.items():
        ratio = np.median(np.divide(spent[name], spent["wall"]))
        row = {"benchmark": "funnel", "case": name, "grains": GRAINS, "contacts": world.observe().health.contacts}
        row |= {"median_us_per_step": round(float(np.median(spent[name])), 1), "over_wall": round(float(ratio), 3)}
        print(json.dumps(row | provenance(threads)), flush=True)


if __name__ == "__main__":
    main()
