"""Compile modules of kernels side by side."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed

import warp as wp


def compile_modules(modules: Iterable, device: str, threads: int, progress: Callable[[float], None], **options) -> None:
    """Compile what is not in Warp's cache, and load it all.

    Args:
        modules: of Warp, compiled as a whole, once however often they are given; best those first that take longest.
        device: name.
        threads: how many modules are compiled at a time.
        progress: called with the share of it that is done, 0 to 1; may raise to give up.
        options: of ``wp.force_load``.
    """
    with ThreadPoolExecutor(threads) as compilers:
        compiling = [
            compilers.submit(wp.force_load, device, [module], max_workers=0, **options) for module in dict.fromkeys(modules)
        ]
        try:
            for done, one in enumerate(as_completed(compiling), start=1):
                one.result()
                progress(done / len(compiling))
        finally:
            compilers.shutdown(wait=False, cancel_futures=True)
