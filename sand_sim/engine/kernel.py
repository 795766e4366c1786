"""The one way kernels are declared, and Warp started: quietly, without backward passes, one small module for each kernel."""

from functools import cache, partial

import warp as wp

from sampler.quiet import start_warp

start_warp()

# Fused multiply-add makes the contact kernels a tenth faster; Warp's own flags leave it to the back end, which finds few.
_OPTIONS = {"cpu_compiler_flags": f"{wp.config.cpu_compiler_flags} -ffp-contract=fast"}

kernel = partial(wp.kernel, enable_backward=False, module="unique", module_options=_OPTIONS)


@cache
def _nothing(dtype: type, device: str) -> wp.array:
    return wp.empty(1, dtype=dtype, device=device)


def fill_gaps(launched: wp.Kernel, inputs: list, device: str) -> list:
    """Put a dummy in the place of arrays that a scene left out (None).

    Warp picks its fast path, with strides known when compiling, only if no array of a launch is null.
    """
    types = [argument.type for argument in launched.adj.args]
    return [_nothing(t.dtype, device) if value is None else value for t, value in zip(types, inputs, strict=True)]


@wp.func
def sure(index: int) -> int:
    """An index that is never negative. Told so, the compiler leaves out what Warp does for negative ones at each access."""
    return index & 0x7FFFFFFF
