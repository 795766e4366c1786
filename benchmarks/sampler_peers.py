"""Our particles beside those of Open3D, point-cloud-utils and trimesh, on the same meshes, by the same measure, in one run.

The peers are no dependencies; make a venv for them::

    python3.12 -m venv peers && peers/bin/pip install . open3d point-cloud-utils scipy
    peers/bin/python -m benchmarks.sampler_peers MESH... --count 2000

Prints a table in Markdown. Times are CPU seconds of all threads, reading left out, kernels compiled before.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import trimesh

from sampler import MeshError, read_mesh, repair_mesh, sample_body
from sampler.geometry.surface import Surface
from sampler.measuring import measure_evenness
from sampler.mending.repair import SHEET
from sampler.particles.lattice import lattice_spacing
from sampler.particles.skin import Skin, free_triangles


def ours(mesh, count):
    """Particles of this package."""
    return sample_body(mesh, radius=0.01 * float(np.linalg.norm(mesh.extents)), count=count).points


def open3d_poisson(mesh, count):
    """Sample elimination (Yuksel 2015)."""
    return np.asarray(_open3d(mesh).sample_points_poisson_disk(count).points)


def open3d_farthest(mesh, count):
    """Farthest points of twenty times as many random ones."""
    return np.asarray(_open3d(mesh).sample_points_uniformly(20 * count).farthest_point_down_sample(count).points)


def cloud_utils_poisson(mesh, count):
    """Poisson disks."""
    import point_cloud_utils as pcu

    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32)
    face, share = pcu.sample_mesh_poisson_disk(vertices, faces, count)
    return pcu.interpolate_barycentric_coords(faces, face, share, vertices)


def cloud_utils_lloyd(mesh, count):
    """Lloyd relaxation."""
    import point_cloud_utils as pcu

    return pcu.sample_mesh_lloyd(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32), count)


def trimesh_even(mesh, count):
    """Rejection of random points that are too near."""
    return np.asarray(trimesh.sample.sample_surface_even(mesh, count, seed=0)[0])


def _open3d(mesh):
    import open3d

    vertices, faces = open3d.utility.Vector3dVector(mesh.vertices), open3d.utility.Vector3iVector(mesh.faces)
    return open3d.geometry.TriangleMesh(vertices, faces)


METHODS = {
    "this sampler": ours,
    "Open3D Poisson": open3d_poisson,
    "Open3D farthest": open3d_farthest,
    "pcu Poisson": cloud_utils_poisson,
    "pcu Lloyd": cloud_utils_lloyd,
    "trimesh even": trimesh_even,
}


def judge(mesh, method, count):
    """One row: count, evenness and coverage against the free surface after repair, whatever the method sampled."""
    repaired, h = repair_mesh(mesh), lattice_spacing(mesh.area, count)
    sheet, solid = (repaired.triangles[(repaired.kind == SHEET) == flat] for flat in (True, False))
    if len(solid):
        around = Surface(solid)
        sheet = free_triangles(sheet, around, h)[0] if len(sheet) else sheet
        solid = free_triangles(solid, around, h)[0]
    free = np.concatenate([solid, sheet])
    skin = Skin(free[Surface.areas_of(free) > 0.0])
    begin = time.process_time()
    points = np.asarray(method(mesh, count), float)
    seconds = time.process_time() - begin
    _, face = skin.closest(points)
    even = measure_evenness(skin, points, skin.normals[face])
    # In spacings of the wanted count, so that a method does not look better for having taken more.
    unit = lattice_spacing(float(skin.areas.sum()), len(points)) / lattice_spacing(float(skin.areas.sum()), count)
    row = [f"{100.0 * (len(points) / count - 1.0):+.1f} %", f"{even.variation:.3f}"]
    row += [f"{unit * x:.2f}" for x in (even.nearest, even.farthest, even.coverage, even.skin_coverage)]
    return [*row, f"{seconds:.2f}"]


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=2000)
    options = parser.parse_args()
    ours(trimesh.creation.icosphere(), 100)
    print("| mesh | method | count | CV | nearest | farthest | coverage | along skins | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for path in options.meshes:
        try:
            mesh = read_mesh(path)
            repair_mesh(mesh)
        except MeshError as error:
            print(f"| {path.stem} | refused | {error} | | | | | | |")
            continue
        mesh.merge_vertices()
        for name, method in METHODS.items():
            try:
                row = judge(mesh, method, options.count)
            except Exception as error:  # a peer may fail in any way; the others go on
                row = [type(error).__name__, *[""] * 6]
            print(f"| {path.stem} | {name} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
