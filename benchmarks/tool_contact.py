"""What it changes that grains touch a tool's true surface and not its particles: normals, digging forces, carried mass, time.

First how far the normals of a grain's contacts with the particles of each mesh lean from the true surface, as a grain comes down
on it from everywhere; then the time of a step with the bucket at rest in the bed; then the digging scene with a rough bucket, one
of finer particles and a smooth one, in turn, frame by frame, so that a busy machine slows all of them alike. Prints JSON lines.
Run from the root of the source tree:
``python -m benchmarks.tool_contact [MESH ...]``.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.provenance import provenance
from sampler import ParticleBody, sample_file
from sampler.geometry.surface import Surface
from sampler.particles.skin import Skin
from sand_sim import World
from sand_sim.config_folder import find_scene
from sand_sim.scene.reading import load_scene
from sand_sim.scene.types import Settle
from sand_sim.sinks.run_log import RunLog
from sand_sim.tool_motion.playing import commands_at, frame_times
from sand_sim.tool_motion.track import phases_of

PLACES = 4000
STEPS, ROUNDS = 200, 25
GRAIN, PARTICLE = 0.0066, 0.004  # [m] mean grain and particles of the digging scene
CASES = {"rough": {}, "rough, half the particle radius": {"particle_radius": 0.002}, "smooth": {"contact": "smooth"}}


def leaning_normals(body: ParticleBody, grain: float) -> np.ndarray:
    """Angles between the normals of the first particles that a grain touches and the true surface's, shape (n,) [rad].

    The grain comes down along the normal on places spread evenly over the surface; hollows, where it does not reach the place it
    comes down on, are left out.
    """
    around = Surface(body.triangles)
    places, normals = Skin(body.triangles).sample(PLACES, np.random.default_rng(0))
    free = np.abs(around.winding(places + 1e-5 * around.unit * normals)) < 0.5
    reach, angles = body.radius + grain, []
    for place, normal in zip(places[free], normals[free], strict=True):
        away = body.points - place
        height = away @ normal
        across = np.einsum("ij,ij->i", away, away) - height**2
        height = np.where(across < reach**2, height + np.sqrt(np.maximum(reach**2 - across, 0.0)), -np.inf)
        first = int(np.argmax(height))
        if height[first] > 0.0:
            centre = place + height[first] * normal
            nearest, _ = around.closest(centre[None])
            if np.linalg.norm(nearest[0] - place) < 1e-4 * grain:
                angles.append(np.arccos(min(1.0, (centre - body.points[first]) @ normal / reach)))
    return np.array(angles)


def time_steps(threads: int) -> dict[str, dict]:
    """Time of a step with each bucket where it is in the middle of the cut, at rest; the worlds step in turn."""
    scene = load_scene(find_scene("dig"))
    pose, solver = scene.tools[0].trajectory[3].pose, replace(scene.solver, threads=threads)
    scene = replace(scene, settle=Settle(time=0.2), solver=solver)
    tools = {name: replace(scene.tools[0], pose=pose, trajectory=(), **fields) for name, fields in CASES.items()}
    worlds, spent = {name: World(replace(scene, tools=(tool,))) for name, tool in tools.items()}, {name: [] for name in CASES}
    for _ in range(ROUNDS):
        for name, world in worlds.items():
            begin = time.perf_counter()
            world.step(STEPS)
            spent[name].append(1e6 * (time.perf_counter() - begin) / STEPS)
    rows = {}
    for name, world in worlds.items():
        arrays = world.assembly.solver.arrays
        contacts = arrays.tool_list
        number = contacts.pairs.get()
        near = len(np.unique(contacts.owner.numpy()[:number]))
        rows[name] = {"least_us_per_step": min(spent[name]), "median_us_per_step": float(np.median(spent[name]))}
        rows[name] |= {"grains_near_the_tool": near, "contacts_with_the_tool": len(world.tool_contacts("bucket"))}
    return rows


def dig(seed: int, threads: int) -> dict[str, dict]:
    """The figures of one bed dug by each bucket."""
    scene = load_scene(find_scene("dig"))
    scene = replace(scene, fills=(replace(scene.fills[0], seed=seed),), solver=replace(scene.solver, threads=threads))
    worlds = {name: World(replace(scene, tools=(replace(scene.tools[0], **fields),))) for name, fields in CASES.items()}
    logs, spent = {name: RunLog(world.scene) for name, world in worlds.items()}, dict.fromkeys(CASES, 0.0)
    for moment in frame_times(scene):
        for name, world in worlds.items():
            for command in commands_at(world.scene, moment):
                world.apply(command)
            begin = time.perf_counter()
            world.step(round((moment - world.time) / world.time_step))
            spent[name] += time.perf_counter() - begin
            logs[name].write(world.observe())
        print(f"\rseed {seed}: {moment:.2f} s", end="", file=sys.stderr)
    print(file=sys.stderr)
    return {name: figures(logs[name], spent[name]) for name in CASES}


def figures(log: RunLog, spent: float) -> dict:
    """Draft, carried mass and time of a dig."""
    columns, summary, tool = log.columns(), log.summarise(), log.scene.tools[0]
    begin, end = phases_of(tool.trajectory)["cut"]
    during = (columns["time"] > begin) & (columns["time"] <= end + 1e-9)
    found = summary["tools"][tool.name]
    return {
        "peak_draft_N": found["peak_draft_N"],
        "mean_draft_in_cut_N": float(-columns[f"{tool.name}.force"][during, 0].mean()),
        "mean_lift_in_cut_N": float(-columns[f"{tool.name}.force"][during, 2].mean()),
        "carried_kg": found["carried_kg"],
        "largest_overlap_over_radius": summary["largest_overlap_over_radius"],
        "time_step_us": 1e6 * summary["time_step_s"],
        "us_per_step": 1e6 * spent / summary["steps"],
        "wall_s": spent,
        "doubts": summary["doubts"],
    }


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("meshes", nargs="*", type=Path, help="more meshes to measure normals on; ending in _mm: in millimetres")
    parser.add_argument("--seeds", type=int, default=3, help="beds to dig in (default: 3)")
    parser.add_argument("--threads", type=int, default=1, help="cores (default: 1)")
    options = parser.parse_args()
    bucket = find_scene("dig").parent / "meshes" / "bucket.stl"
    for path in (bucket, *options.meshes):
        body = sample_file(path, PARTICLE, 0.001 if path.stem.endswith("_mm") else 1.0, grain=0.006)
        angles = np.degrees(leaning_normals(body, GRAIN))
        row = {"benchmark": "tool_contact", "mesh": path.name, "particles": len(body), "places": len(angles)}
        row |= {"largest_degrees": round(float(angles.max()), 2), "rms_degrees": round(float(np.sqrt(np.mean(angles**2))), 2)}
        row |= {"bound_degrees": round(float(np.degrees(body.roughness(GRAIN))), 2)}
        print(json.dumps(row | provenance(options.threads)), flush=True)
    show({"pose": "in the cut, at rest"}, time_steps(options.threads), options.threads)
    for seed in range(1, options.seeds + 1):
        show({"seed": seed}, dig(seed, options.threads), options.threads)


def show(which: dict, rows: dict[str, dict], threads: int) -> None:
    """Print a JSON line for each case."""
    for name, row in rows.items():
        rounded = {key: float(f"{value:.4g}") if isinstance(value, float) else value for key, value in row.items()}
        print(json.dumps({"benchmark": "tool_contact"} | which | {"case": name} | rounded | provenance(threads)), flush=True)


if __name__ == "__main__":
    main()
