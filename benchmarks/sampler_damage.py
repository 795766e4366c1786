"""Signs and masses of damaged meshes against those of the sound ones.

``python -m benchmarks.sampler_damage MESH_OR_FOLDER... [--faces 200 2500] [--most 160]`` takes watertight meshes, no two alike,
damages each in every way at two random places and prints a JSON line for each way; meshes beyond what is meant are named on the
way. Signs are judged by the solid angles of the sound mesh, at 10,648 places of a grid and 3000 near the surface.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.provenance import provenance
from sampler import MeshError, ParticleBody, SignedDistance, read_mesh, sample_body
from sampler.quiet import start_warp

ENDINGS = ".stl", ".obj", ".ply", ".dae", ".glb"
NODES, NEAR, SCATTER = 22, 3000, 5e-3  # of the grid along an axis, places near the surface, and how near, of the diagonal
UNSURE = 1.1e-5  # of the diagonal: nearer to the surface a sign means nothing
RADIUS, PARTICLES = 1e-3, 200  # of the body that tells the mass, of the diagonal
MEASURES = "grid", "near", "volume", "centre", "inertia"  # shares of wrong signs, and how far off, the centre of the diagonal
HARMLESS = 1e-4, 1e-3, 1e-3, 1e-3, 1e-3
MEANT = {  # at most
    **dict.fromkeys(("flipped", "doubled", "doubled with backs", "cracked"), HARMLESS),
    "missing": (1e-4, 1e-3, 0.015, 0.003, 0.01),
    "hole": (5e-3, 0.03, 0.06, 0.015, 0.08),
}


def damaged(mesh: trimesh.Trimesh, how: str, seed: int = 0) -> trimesh.Trimesh:
    """A copy with a tenth of the faces flipped, all doubled, 1 % missing, cracks or a hole of 5 %; vertices are not merged."""
    random = np.random.default_rng(seed)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces).copy()
    if how == "flipped":
        turned = random.random(len(faces)) < 0.1
        faces[turned] = faces[turned][:, ::-1]
    elif how == "doubled":
        faces = np.concatenate([faces, faces])
    elif how == "doubled with backs":
        faces = np.concatenate([faces, faces[:, ::-1]])
    elif how == "missing":
        faces = faces[random.random(len(faces)) >= 0.01]
    elif how == "cracked":
        size = np.linalg.norm(mesh.extents)
        vertices = vertices[faces].reshape(-1, 3) + random.uniform(-5e-6, 5e-6, (3 * len(faces), 3)) * size
        faces = np.arange(len(vertices)).reshape(-1, 3)
    elif how == "hole":
        middle = mesh.triangles_center
        order = np.argsort(np.linalg.norm(middle - middle[random.integers(len(middle))], axis=1))
        faces = faces[order[np.cumsum(mesh.area_faces[order]) > 0.05 * mesh.area]]
    return trimesh.Trimesh(vertices, faces, process=False)


def solid_angle_inside(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether points are inside, by the exact solid angles of all triangles (Van Oosterom & Strackee 1983), in NumPy."""
    total = np.zeros(len(points))
    for block in np.array_split(np.arange(len(points)), max(1, len(points) * len(triangles) // 1_000_000)):
        a, b, c = (triangles[None, :, k] - points[block, None] for k in range(3))
        la, lb, lc = (np.sqrt(np.einsum("ijk,ijk->ij", x, x)) for x in (a, b, c))
        top = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
        bottom = la * lb * lc
        for x, y, length in ((a, b, lc), (b, c, la), (c, a, lb)):
            bottom += np.einsum("ijk,ijk->ij", x, y) * length
        total[block] = 2.0 * np.arctan2(top, bottom).sum(axis=1)
    return total > 2.0 * np.pi


def far_from_surface(distance: SignedDistance, points: np.ndarray, share: float = 1e-5) -> np.ndarray:
    """Points farther from a surface than a share of its diagonal, within which a sign means nothing."""
    return np.abs(distance.query(points)[0]) > share * distance.surface.unit


def grid_around(mesh: trimesh.Trimesh, nodes: int) -> np.ndarray:
    """Nodes of a grid a little larger than the bounding box."""
    low, high = mesh.bounds
    margin = 0.05 * np.linalg.norm(high - low)
    axes = [np.linspace(a - margin, b + margin, nodes) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


class Sound:
    """A sound mesh, places around it, and what is true there."""

    def __init__(self, mesh: trimesh.Trimesh):
        self.diagonal = float(np.linalg.norm(mesh.extents))
        near, _ = trimesh.sample.sample_surface(mesh, NEAR, seed=1)
        near = near + np.random.default_rng(1).normal(size=near.shape) * SCATTER * self.diagonal
        distance = SignedDistance(mesh)
        self.places = [x[far_from_surface(distance, x, UNSURE)] for x in (grid_around(mesh, NODES), near)]
        self.inside = [solid_angle_inside(np.asarray(mesh.triangles), x) for x in self.places]
        self.body = self.body_of(mesh)

    def judge(self, mesh: trimesh.Trimesh) -> list[float]:
        """How far off a damaged copy is, by ``MEASURES``; the body of particles made of it tells the mass."""
        distance = SignedDistance(mesh)
        signs = [np.mean((distance.query(x)[0] < 0.0) != true) for x, true in zip(self.places, self.inside, strict=True)]
        body = self.body_of(mesh)
        masses = abs(body.volume / self.body.volume - 1.0), np.linalg.norm(body.centre - self.body.centre) / self.diagonal
        inertia = np.abs(body.inertia - self.body.inertia).max() / np.abs(self.body.inertia).max()
        return [float(x) for x in (*signs, *masses, inertia)]

    def body_of(self, mesh: trimesh.Trimesh) -> ParticleBody:
        """A body of few particles."""
        return sample_body(mesh, radius=RADIUS * self.diagonal, count=PARTICLES)


def mesh_files(paths: list[Path], seed: int = 0) -> list[Path]:
    """Files, and those of folders, in random order."""
    found = [file for path in paths for file in (sorted(path.rglob("*")) if path.is_dir() else [path])]
    found = [file for file in found if file.suffix.lower() in ENDINGS]
    return [found[k] for k in np.random.default_rng(seed).permutation(len(found))]


def sound_meshes(paths: list[Path], faces: list[int]):
    """Yield the path and the mesh of those that are sound, no two alike."""
    seen = set()
    for path in mesh_files(paths):
        try:
            mesh = read_mesh(path)
        except MeshError:
            continue
        mesh.merge_vertices(merge_norm=True, merge_tex=True)
        looks = len(mesh.faces), round(float(mesh.area / np.sum(mesh.extents**2)), 6)
        if faces[0] <= len(mesh.faces) <= faces[1] and mesh.is_volume and looks not in seen:
            seen.add(looks)
            yield path, mesh


def main(arguments: list[str] | None = None) -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path, help="files or folders")
    parser.add_argument("--faces", nargs=2, type=int, default=(200, 2500), metavar=("LEAST", "MOST"), help="of a mesh")
    parser.add_argument("--most", type=int, default=160, help="meshes")
    options = parser.parse_args(arguments)
    start_warp()
    found: dict[str, list[list[float]]] = {how: [] for how in MEANT}
    for number, (path, mesh) in enumerate(sound_meshes(options.meshes, options.faces)):
        if number == options.most:
            break
        sound = Sound(mesh)
        for how, meant in MEANT.items():
            for seed in (0, 1):
                found[how].append(off := sound.judge(damaged(mesh, how, seed)))
                beyond = [f"{name} {x:.2%}" for name, x, most in zip(MEASURES, off, meant, strict=True) if not x <= most]
                if beyond:
                    print(f"{path}, {how}, place {seed}: {', '.join(beyond)}", file=sys.stderr, flush=True)
    source = provenance()
    for how, rows in found.items():
        if not rows:
            parser.error(f"none of these is a sound mesh of {options.faces[0]} to {options.faces[1]} triangles")
        off = np.array(rows)
        counts = dict(zip(MEASURES, np.count_nonzero(~(off <= MEANT[how]), axis=0).tolist(), strict=True))
        worst = dict(zip(MEASURES, off.max(axis=0).tolist(), strict=True))
        median = dict(zip(MEASURES, np.median(off, axis=0).tolist(), strict=True))
        line = {"benchmark": "sampler_damage", "case": how, "damaged": len(rows), "beyond": counts, "median": median}
        print(json.dumps(line | {"worst": worst} | source), flush=True)


if __name__ == "__main__":
    main()
