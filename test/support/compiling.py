"""What the compiler of kernels for the CPU tells of its work."""

import os
import tempfile
from functools import partial

import warp as wp

from sand_sim.engine.kernel import kernel

_PLAIN = {key: value for key, value in kernel.keywords.items() if key != "module_options"}


def count_vector_loops(home, build, monkeypatch, folder) -> int:
    """Loops that the compiler says it has made vector loops, in a kernel compiled anew.

    Args:
        home: module of the builder.
        build: ``build()`` makes the kernel, past any cache.
        monkeypatch: of the test.
        folder: an empty one.
    """
    flags = f"{kernel.keywords['module_options']['cpu_compiler_flags']} -Rpass=loop-vectorize"
    monkeypatch.setattr(home, "kernel", partial(wp.kernel, module_options={"cpu_compiler_flags": flags}, **_PLAIN))
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    made = build()
    return _output(lambda: made.module.load("cpu")).count("remark: vectorized loop")


def _output(work) -> str:
    """What the compiler, which is no part of Python, writes to standard error meanwhile."""
    stderr = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            work()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        file.seek(0)
        return file.read().decode()
