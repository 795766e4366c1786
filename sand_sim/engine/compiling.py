"""Compile kernels side by side, and say how far that is."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed

import warp as wp


def compile_kernels(
    kernels: Iterable[wp.Kernel], device: str, threads: int, progress: Callable[[str, float], None], **options
) -> None:
    """Compile what is not in Warp's cache, and load it all.

    Args:
        kernels: modules are compiled as a whole.
        device: name.
        threads: how many modules are compiled at a time.
        progress: called with the name of the stage and the share of it that is done, 0 to 1; may raise to give up.
        options: of ``wp.force_load``.
    """
    modules = dict.fromkeys(kernel.module for kernel in kernels)
    with ThreadPoolExecutor(threads) as compilers:
        compiling = [compilers.submit(wp.force_load, device, [module], max_workers=0, **options) for module in modules]
        try:
            for done, one in enumerate(as_completed(compiling), start=1):
                one.result()
                progress("compiling kernels", done / len(compiling))
        finally:
            compilers.shutdown(wait=False, cancel_futures=True)
