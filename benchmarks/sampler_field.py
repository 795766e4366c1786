"""The distance field beside direct queries: memory, building, time of a query, error on the grid. Prints a table in Markdown.

Run from the root of the source tree: ``python -m benchmarks.sampler_field MESH...``. All cores, queries near the surface.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from sampler import SignedDistance, make_field, read_mesh
from sampler.particles.skin import Skin

POINTS, ROUNDS = 50_000, 5
BAND = 0.02  # of the diagonal


def timed(work) -> tuple:
    """What it gives, and the median of its times [s]."""
    times = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - begin)
    return result, float(np.median(times))


def row(path: Path) -> str:
    """One line of the table."""
    mesh = read_mesh(path)
    distance = SignedDistance(mesh)
    begin = time.perf_counter()
    field = make_field(distance, BAND * float(np.linalg.norm(mesh.extents)))
    building = time.perf_counter() - begin
    random = np.random.default_rng(0)
    places, normals = Skin(distance.surface.triangles).sample(POINTS, random)
    points = places + random.uniform(-0.8, 0.8, (POINTS, 1)) * field.band * normals
    (sampled, _), on_grid = timed(lambda: field.sample(points))
    (exact, *_), direct = timed(lambda: distance.query(points))
    _, unsigned = timed(lambda: distance.surface.closest(points, field.band))
    error = float(np.abs(sampled - exact)[np.abs(sampled) < field.band].mean()) / field.cell
    walls = "" if field.resolves_walls else ", walls not resolved"
    times = " | ".join(f"{1e6 * one / POINTS:.2f} us" for one in (on_grid, direct, unsigned))
    memory = f"{field.memory / 2**20:.1f} MiB, {building:.1f} s{walls}"
    return f"| {path.stem} | {field.thinnest_wall:.2g} | {memory} | {times} | {error:.3f} cells |"


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="+", type=Path, help="mesh files")
    options = parser.parse_args(arguments)
    heads = "mesh", "thinnest wall", "grid, build", "grid, per query (NumPy)", "direct, signed"
    heads += "direct, unsigned", "mean error of the grid"
    print(f"| {' | '.join(heads)} |")
    print("|---" * len(heads) + "|")
    for path in options.mesh:
        print(row(path), flush=True)


if __name__ == "__main__":
    main()
