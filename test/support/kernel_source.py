"""The code that Warp compiles for a kernel."""

from warp._src.context import ModuleBuilder


def source(kernel) -> str:
    """C++ source of a kernel that has been launched or loaded."""
    module = kernel.module
    return ModuleBuilder(module, module.options, hasher=module.hashers[next(iter(module.hashers))]).codegen("cpu")
