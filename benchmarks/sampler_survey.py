"""Particles on many meshes against what is meant: evenness, coverage, count, CPU time.

``python -m benchmarks.sampler_survey MESH_OR_FOLDER... [--count 2000] [--most 1000] [--part 1/2] > survey.jsonl`` samples meshes
in random order and prints a JSON line for each, beyond what is meant or not; ``--table survey.jsonl...`` sums such lines up.
CPU seconds are those of all threads, reading left out, kernels compiled before.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.provenance import provenance
from benchmarks.sampler_damage import mesh_files
from sampler import MeshError, ParticleBody, read_mesh, sample_body
from sampler.quiet import start_warp

KINDS = "closed, walls above h", "thin walls or sheets, apart", "overlapping parts"
SOLID, THIN, OVERLAPPING = KINDS
EVENNESS = "variation", "nearest", "farthest", "coverage", "skin_coverage"
MOST = {"variation": 0.065, "farthest": 1.10, "skin_coverage": 1.0}
COVERAGE = 0.80  # at most, on solids; elsewhere that along skins counts
NEAREST, OFF = 0.35, 0.01  # at least, and share by which the number may differ from the wanted one
FACES, SECONDS = 10_000, 3.0  # CPU time that is meant for meshes up to so large


def kind_of(body: ParticleBody) -> str:
    """Whether a mesh is solid, thin, or of parts that overlap."""
    if any("buried in others" in warning for warning in body.mass_warnings):
        return OVERLAPPING
    return THIN if body.steps["sheets"] or body.thinnest_wall < body.spacing else SOLID


def survey(path: Path, count: int) -> dict:
    """What came of one mesh."""
    try:
        mesh = read_mesh(path)
        begin = time.process_time()
        body = sample_body(mesh, radius=0.01 * float(np.linalg.norm(mesh.extents)), count=count)
    except MeshError as error:
        return {"mesh": str(path), "refused": str(error)}
    seconds = time.process_time() - begin
    even = {name: getattr(body.evenness, name) for name in EVENNESS}
    row = {"mesh": str(path), "kind": kind_of(body), "triangles": len(mesh.faces), **even}
    row |= {"count_off": len(body) / count - 1.0, "cpu_s": seconds, "warnings": [*body.warnings, *body.mass_warnings]}
    return row | {"beyond": beyond(row)}


def beyond(row: dict) -> list[str]:
    """Names of the figures that are not as they are meant."""
    names = [name for name, most in MOST.items() if row[name] > most]
    names += ["coverage"] * (row["kind"] == SOLID and row["coverage"] > COVERAGE)
    names += ["nearest"] * (row["nearest"] < NEAREST) + ["count"] * (abs(row["count_off"]) > OFF)
    return names + ["time"] * (row["triangles"] <= FACES and row["cpu_s"] > SECONDS)


def table(rows: list[dict]) -> str:
    """Median and worst of each kind, in Markdown, and what is beyond what is meant."""
    sampled = [row for row in rows if "kind" in row]
    lines = [f"| | {' | '.join(KINDS)} |", "|---" * (1 + len(KINDS)) + "|"]
    groups = [[row for row in sampled if row["kind"] == kind] for kind in KINDS]
    lines.append(f"| meshes | {' | '.join(str(len(group)) for group in groups)} |")
    for name in (*EVENNESS, "cpu_s"):
        worst, digits = (min if name == "nearest" else max), 3 if name == "variation" else 2
        values = [[row[name] for row in group] for group in groups]
        cells = [f"{np.median(some):.{digits}f}, {worst(some):.{digits}f}" if some else "" for some in values]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    lines += ["", f"{len(rows) - len(sampled)} refused; beyond what is meant:"]
    for name in (*EVENNESS, "count", "time"):
        lines.append(f"{name}: {sum(name in row['beyond'] for row in sampled)}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Print the lines, or their table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path, help="meshes or folders, or files of lines for a table")
    parser.add_argument("--table", action="store_true", help="sum up lines of earlier runs")
    parser.add_argument("--count", type=int, default=2000, help="particles on each")
    parser.add_argument("--most", type=int, default=1000, help="meshes")
    parser.add_argument("--part", default="1/1", help="k/n: every n-th from the k-th, for several processes")
    options = parser.parse_args(arguments)
    if options.table:
        print(table([json.loads(line) for path in options.paths for line in path.read_text().splitlines()]))
        return
    start_warp()
    source = provenance()
    part, parts = map(int, options.part.split("/"))
    sample_body(trimesh.creation.icosphere(), radius=0.1, count=100)
    for path in mesh_files(options.paths)[: options.most][part - 1 :: parts]:
        row = survey(path, options.count)
        print(json.dumps(row | source), flush=True)
        if row.get("beyond"):
            print(f"{path}: {', '.join(row['beyond'])}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
