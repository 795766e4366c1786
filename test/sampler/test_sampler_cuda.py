"""The sampler on an NVIDIA GPU; that its kernels compile for one is seen without."""

import importlib
import pkgutil

import numpy as np
import pytest
import trimesh
import warp as wp
from cuda_compiling import compile_all

import sampler
from sampler import SignedDistance, sample_body
from sampler.field import make_field
from sampler.geometry.surface import Surface

GPU = pytest.mark.skipif(not wp.is_cuda_available(), reason="needs an NVIDIA GPU")


def test_all_kernels_compile(tmp_path):
    names = [found.name for found in pkgutil.walk_packages(sampler.__path__, "sampler.")]
    modules = [importlib.import_module(name) for name in names if name != "sampler.__main__"]
    found = [thing for module in modules for thing in vars(module).values() if isinstance(thing, wp.Kernel)]
    kernels = {kernel.module.name: kernel for kernel in found}  # one compiles all of its module
    assert kernels.keys() > {"sampler_rays", "sampler_spreading", "sampler_surface"}
    compile_all(kernels.values(), (90,), tmp_path)


def overlapping_parts():
    return trimesh.util.concatenate([trimesh.creation.box((1.0, 0.8, 0.6)), trimesh.creation.cylinder(0.2, 2.0)])


@GPU
def test_distances_are_those_of_the_cpu():
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (20_000, 3))
    wanted, found = (SignedDistance(overlapping_parts(), device).query(points)[0] for device in ("cpu", "cuda"))
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12)


@GPU
@pytest.mark.parametrize("rough", [False, True])
@pytest.mark.parametrize("kept", [slice(40, None), slice(None, None, 2)], ids=["hole", "ragged"])
def test_winding_of_open_surfaces_is_that_of_the_cpu(kept, rough):
    """Where solid angles are asked for; of what is far away they are sums over boxes, which each device makes its own."""
    triangles = trimesh.creation.icosphere(3).triangles[kept]
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (5000, 3))
    wanted, found = (Surface(triangles, device).winding(points, rough) for device in ("cpu", "cuda"))
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=0.1 if rough else 0.01)


@GPU
def test_field_is_that_of_the_cpu():
    wanted, found = (make_field(SignedDistance(overlapping_parts(), device), 0.05) for device in ("cpu", "cuda"))
    np.testing.assert_array_equal(found.block, wanted.block)
    np.testing.assert_allclose(found.values, wanted.values, rtol=0.0, atol=1e-6)


@GPU
def test_particles_are_as_even_as_those_of_the_cpu():
    body = sample_body(overlapping_parts(), radius=0.02, count=1500, device="cuda")
    assert len(body) == pytest.approx(1500, rel=0.01)
    assert body.evenness.variation < 0.05
    assert body.evenness.coverage < 0.8
    assert np.abs(SignedDistance(overlapping_parts()).query(body.points)[0]).max() < 1e-3 * 0.02
