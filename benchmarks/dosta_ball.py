"""A steel ball shot into 25,000 grains, against the figures on which eight DEM codes agree; prints one JSON line.

Case and figures: Dosta et al. 2024, Comparing open-source DEM frameworks for simulations of common bulk processes,
Computer Physics Communications 296:109066, https://doi.org/10.1016/j.cpc.2023.109066. The initial state is their data set,
https://doi.org/10.5281/zenodo.8252892: one line per grain with radius and position, in a box whose inner faces are read from the
triangles of the walls. The ball starts at a height of 0.06 m with 5 m/s downwards and reaches the bed just before 20 ms, when
free fall alone gives -101.96 mm. Where it is deepest the gap to the floor is 1.4 mm, so that it squeezes single grains of 2 mm,
far beyond the overlaps that Hertz's law is for, and the run is marked as doubtful. Its way back up is chaotic and not compared.

Run from the root of the source tree: ``python -m benchmarks.dosta_ball --data FOLDER --out out``.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from sand_sim import Scene, SceneError, World, read_scene

GRAINS, WALLS = "Penetration_25KParticles.txt", "Penetration_walls.txt"
REPORTED = {20: -102.1, 25: -124.0, 30: -138.2}  # displacement of the ball [mm] at a time [ms]
DEEPEST = -138.5  # [mm], codes differ by 1
HEIGHT, SPEED, RADIUS = 0.06, 5.0, 0.01  # of the ball [m], [m/s], [m]
TIME_STEP = 0.5e-6  # [s] as the case prescribes
FRAME = 0.25e-3  # [s]
LAST = 34e-3  # [s]; the ball is deepest shortly after 30 ms


def read_case(data: Path, folder: Path) -> dict:
    """The scene of the case, with its grains written to npz files.

    Args:
        data: folder of the data set.
        folder: where the npz files go.

    Raises:
        SceneError: if the data are not there.
    """
    try:
        lines = (data / GRAINS).read_text().splitlines()[1:]
        walls = np.loadtxt(data / WALLS, skiprows=1).reshape(-1, 3)
    except OSError as error:
        raise SceneError(f"--data: {error.filename} cannot be read: {error.strerror}") from None
    rows = np.array([line.split() for line in lines if len(line.split()) == 4], float)  # the ball's own line is longer
    np.savez(folder / "bed.npz", radius=rows[:, 0], position=rows[:, 1:])
    np.savez(folder / "ball.npz", radius=[RADIUS], position=[[0.0, 0.0, HEIGHT]], velocity=[[0.0, 0.0, -SPEED]])
    # The walls are plates of steel; the faces turned to the grains are the inner ones of the two on each side.
    low = [max(v for v in walls[:, k] if v < rows[:, 1 + k].min()) for k in range(3)]
    high = [min(v for v in walls[:, k] if v > rows[:, 1 + k].max()) for k in range(3)]
    return {
        "name": "dosta_ball",
        "materials": {
            "steel": {"density": 7200.0, "young": 210e9, "poisson": 0.2},
            "M1": {"density": 2500.0, "young": 1e9, "poisson": 0.2},
        },
        "pairs": [
            {"between": ["M1", "M1"], "restitution": 0.5, "friction": 0.3},
            {"between": ["M1", "steel"], "restitution": 0.4, "friction": 0.2},
            {"between": ["steel", "steel"], "restitution": 0.4, "friction": 0.2},
        ],
        "fills": [
            {"name": "bed", "material": "M1", "file": "bed.npz"},
            {"name": "ball", "material": "steel", "file": "ball.npz"},
        ],
        "boundaries": [{"name": "box", "type": "box", "material": "steel", "low": low, "high": high, "open": ["top"]}],
        "domain": {"low": [-0.15, -0.15, -0.1], "high": [0.15, 0.15, 0.3]},
        "solver": {"time_step": TIME_STEP},
        "frame_rate": 1.0 / FRAME,
    }


def drop(scene: Scene) -> tuple[dict, np.ndarray, np.ndarray]:
    """Run the case and follow the ball.

    Returns:
        The report, times [s] and displacements of the ball [m], both of shape (frames,).
    """
    world = World(scene)
    ball = world.assembly.fill_numbers[0]  # its identity follows those of the bed
    times, heights, spent = [0.0], [HEIGHT], 0.0
    while world.time < LAST - 0.5 * FRAME:
        begin = time.perf_counter()
        world.step(world.frame_steps)
        spent += time.perf_counter() - begin
        seen = world.observe()
        times.append(seen.time)
        heights.append(float(seen.grains.position[np.searchsorted(seen.grains.identity, ball), 2]))
        print(f"\rt {1e3 * seen.time:5.2f} ms, ball at {1e3 * heights[-1]:7.2f} mm, {spent:4.0f} s", end="", file=sys.stderr)
    print(file=sys.stderr)
    times, shift = np.array(times), np.array(heights) - HEIGHT
    report = {f"displacement_{ms}ms_mm": round(1e3 * float(np.interp(1e-3 * ms, times, shift)), 3) for ms in REPORTED}
    report |= {
        "deepest_mm": round(1e3 * float(shift.min()), 3),
        "deepest_at_ms": round(1e3 * float(times[shift.argmin()]), 2),
        "grains": len(seen.grains),
        "retired": seen.health.retired,
        "steps": seen.steps,
        "wall_s": round(spent, 1),
        "largest_overlap_over_radius": round(seen.health.deepest, 5),
        "doubts": list(seen.health.doubts),
    }
    return report, times, shift


def draw(times: np.ndarray, shift: np.ndarray, path: Path) -> None:
    """Displacement against time with the reported points, as a PNG. Needs matplotlib."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(7.0, 4.6), layout="constrained")
    axis.plot(1e3 * times, 1e3 * shift, color="tab:blue", label="sand_sim")
    axis.plot(list(REPORTED), list(REPORTED.values()), "o", color="tab:red", label="Dosta et al. 2024")
    axis.axhspan(DEEPEST - 1.0, DEEPEST + 1.0, color="tab:red", alpha=0.2, lw=0.0, label="deepest, Dosta et al. 2024")
    axis.set_xlabel("time [ms]")
    axis.set_ylabel("displacement of the ball [mm]")
    axis.grid(alpha=0.3)
    axis.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark and print its JSON line.

    Returns:
        0, or 1 where the data are missing.
    """
    parser = argparse.ArgumentParser(prog="dosta_ball", description=__doc__.split("\n", 1)[0])
    parser.add_argument("--data", type=Path, required=True, help=f"folder with {GRAINS} and {WALLS}")
    parser.add_argument("--out", type=Path, help="folder for dosta_ball.png and dosta_ball.npz")
    parser.add_argument("--threads", type=int, help="cores to use; all if left out")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        try:
            case = read_case(options.data, Path(folder))
            case["solver"] |= {"threads": options.threads} if options.threads else {}
            scene = read_scene(case, Path(folder))
            report, times, shift = drop(scene)
        except SceneError as error:
            print(f"dosta_ball: {error}", file=sys.stderr)
            return 1
    report |= provenance(options.threads)
    print(json.dumps(report))
    if options.out:
        draw(times, shift, options.out / "dosta_ball.png")
        np.savez(options.out / "dosta_ball.npz", time=times, displacement=shift)
    return 0


if __name__ == "__main__":
    sys.exit(main())
