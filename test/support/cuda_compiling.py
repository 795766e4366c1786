"""Compiling kernels for NVIDIA GPUs, which needs none: the compiler comes with Warp."""

import warp as wp

ARCHITECTURES = (80, 90)


def compile_all(kernels, architectures, folder):
    assert kernels
    for kernel in kernels:
        paths = wp.compile_aot_module(kernel.module, arch=architectures, module_dir=folder)
        assert len(paths) == len(architectures)
        assert all(path.stat().st_size > 1000 for path in paths), kernel.key
