"""What each feature costs when switched on: time of a sphere and step in a packed bed, relative to frictionless spheres.

Every case is the same cube of touching spheres, held in a box without gravity; what grains of several spheres cost W2 of
``sand_sim bench`` tells. All cases run in turn, round after round, so that a busy machine slows all of them alike. Prints one
JSON line per case. Run from the root of the source tree: ``python -m benchmarks.features``.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from sand_sim import World, read_scene

EDGE, RADIUS, STEPS = 16, 0.001, 150
NUMBERS = {"restitution": 0.5, "friction": 0.5, "rolling_friction": 0.1, "adhesion": 0.01, "stiffness": 1e4}
NUMBERS |= {"shear_stiffness": 5e3, "shear_viscosity": 0.1, "viscous_time": 1e-6}
FRICTIONLESS = {"tangential": "none"}
CASES = {
    "frictionless": {"contact": FRICTIONLESS},
    "linear normal": {"contact": FRICTIONLESS | {"normal": "linear"}},
    "viscous friction": {"contact": {"tangential": "viscous"}},
    "linear friction with history": {"contact": {"tangential": "linear"}},
    "mindlin (default)": {},
    "mindlin, rescaled": {"contact": {"tangential": "mindlin_rescaled"}},
    "mindlin + rolling spring": {"contact": {"rolling": "spring"}},
    "mindlin + twisting": {"contact": {"twisting": "marshall"}},
    "mindlin + capillary bridges": {"contact": {"cohesion": "capillary"}},
    "mindlin + JKR": {"contact": {"cohesion": "jkr"}},
    "mindlin, symplectic Euler": {"solver": {"integrator": "symplectic_euler"}},
    "mindlin, double precision": {"solver": {"precision": "double"}},
    "mindlin, several materials": {"two materials": True},
}


def make_world(case: dict, folder: Path) -> World:
    """A cube of grains that touch their neighbours."""
    spacing, reach = 2.0 * RADIUS * 0.99, RADIUS * 0.99
    corners = np.stack(np.meshgrid(*[range(EDGE)] * 3, indexing="ij"), -1).reshape(-1, 3) * spacing
    parts = np.array_split(corners, 2) if "two materials" in case else [corners]
    fills = []
    for k, part in enumerate(parts):
        np.savez(folder / f"{k}.npz", position=part, radius=np.full(len(part), RADIUS))
        fills.append({"material": "ab"[k], "file": f"{k}.npz"})
    material = {"density": 2500.0, "young": 1e8, "poisson": 0.25}
    between = [["a", "a"], ["a", "b"], ["b", "b"]]
    parsed = {
        "materials": {"a": material, "b": material},
        "pairs": [{"between": pair} | NUMBERS for pair in between],
        "fills": fills,
        "gravity": [0.0, 0.0, 0.0],
        "boundaries": [{"type": "box", "material": "a", "low": [-reach] * 3, "high": [(EDGE - 1) * spacing + reach] * 3}],
        "domain": {"low": [-0.05] * 3, "high": [0.1] * 3},
        "contact": case.get("contact", {}),
        "liquid": {"saturation": 0.05},
        "solver": {"time_step": 1e-6} | case.get("solver", {}),
    }
    return World(read_scene(parsed, folder))


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--rounds", type=int, default=7, help="how often all cases run in turn")
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as folder:
        worlds = {name: make_world(case, Path(folder)) for name, case in CASES.items()}
    spent = {name: [] for name in CASES}
    spheres_of = {name: len(world.assembly.table) for name, world in worlds.items()}
    for done in range(rounds + 1):
        for name, world in worlds.items():
            begin = time.perf_counter()
            world.step(STEPS)
            spheres = spheres_of[name]
            if done:  # the first round compiles and settles in
                spent[name].append((time.perf_counter() - begin) / STEPS / spheres)
        print(f"\rround {done} of {rounds}", end="", file=sys.stderr)
    print(file=sys.stderr)
    base = np.median(spent["frictionless"])
    for name, times in spent.items():
        ratio = np.median(np.array(times) / np.array(spent["frictionless"]))
        figures = {"median_ns": 1e9 * np.median(times), "least_ns": 1e9 * min(times), "most_ns": 1e9 * max(times)}
        row = {"benchmark": "features", "case": name} | {key: round(value, 2) for key, value in figures.items()}
        health = worlds[name].observe().health
        row |= {"ratio": round(float(ratio), 3), "contacts_per_sphere": round(health.contacts / spheres_of[name], 2)}
        print(json.dumps(row | {"doubts": list(health.doubts)} | provenance()))
    print(f"frictionless: {1e9 * base:.1f} ns per sphere and step", file=sys.stderr)


if __name__ == "__main__":
    main()
