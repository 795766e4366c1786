"""Warp's entry points for CUDA, served by a GPU that is not there. They are those of Warp 1.19, less their ``wp_``."""

import ctypes
import hashlib
import os
import threading
from collections.abc import Callable
from itertools import count
from pathlib import Path

import warp as wp

from paper_gpu.gpu import Gpu, PaperGpuError, play
from paper_gpu.ptx import translate

_ARCHITECTURE = 90
_SIGNATURE = ctypes.CFUNCTYPE(
    None, ctypes.POINTER(ctypes.c_uint64), ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_uint64
)
_SURFACE_AREA, _LINEAR = 0, 2  # ways of growing a tree
_DONE, _NOT_READY = 0, 600  # what CUDA answers to queries
_ANSWERS = {
    "is_cuda_enabled": 1, "cuda_driver_is_initialized": 1, "cuda_driver_version": 13000, "cuda_device_get_count": 1,
    "cuda_device_get_name": b"paper GPU", "cuda_device_get_arch": _ARCHITECTURE, "cuda_device_get_sm_count": 1,
    "cuda_device_get_max_shared_memory": 48 << 10, "cuda_device_is_uva": 1, "cuda_device_get_pageable_memory_access": 0,
    "cuda_device_get_direct_managed_mem_access_from_host": 0, "cuda_device_get_host_native_atomic_supported": 0,
    "cuda_device_get_managed_memory_supported": 0, "cuda_device_get_concurrent_managed_access_supported": 0,
    "cuda_device_is_mempool_supported": 1, "cuda_device_set_mempool_release_threshold": 1, "cuda_device_is_ipc_supported": 0,
    "cuda_device_get_pci_domain_id": 0, "cuda_device_get_pci_bus_id": 0, "cuda_device_get_pci_device_id": 0,
    "cuda_device_get_uuid": None, "cuda_device_get_primary_context": 1, "cuda_context_is_primary": 1,
    "cuda_context_get_device_ordinal": 0, "cuda_context_check": 0, "cuda_context_set_stream": None,
    "cuda_context_push_current": None, "cuda_context_pop_current": None, "cuda_stream_create": 1, "cuda_stream_destroy": None,
    "cuda_stream_register": None, "cuda_stream_unregister": None, "cuda_stream_wait_event": None, "cuda_stream_wait_stream": None,
    "cuda_event_create": 1, "cuda_event_record": None, "cuda_event_destroy": None, "cuda_configure_kernel_shared_memory": 1,
    "cuda_get_kernel_static_shared_memory": 0, "cuda_unload_module": None, "cuda_graph_check_conditional_body": 1,
    "cuda_graph_destroy": 1, "cuda_graph_exec_destroy": 1,
}  # fmt: skip
_REAL = {"wp_cuda_toolkit_version", "wp_cuda_compile_program"}  # which need no GPU


class EntryPoints:
    """What stands in for Warp's library.

    Args:
        library: the real one, asked for all that needs no GPU.
        gpu: does the rest.
    """

    def __init__(self, library: ctypes.CDLL, gpu: Gpu):
        self._library, self._gpu = library, gpu
        self._handles, self._numbers = {}, count(1)
        self._pinned: dict[int, int] = {}
        self._current = threading.local()

    def __getattr__(self, name: str):
        bare = name.removeprefix("wp_")
        own = getattr(type(self), bare, None) if bare != name else None
        if own:
            return _Named(own, self)
        if bare in _ANSWERS:
            return _Named(lambda *_: _ANSWERS[bare])
        if (bare.startswith("cuda_") or bare.endswith(("_device", "_async"))) and name not in _REAL:
            return _Named(_missing(name))
        return getattr(self._library, name)

    def _handle(self, thing) -> int:
        number = next(self._numbers)
        self._handles[number] = thing
        return number

    def _thing(self, handle):
        return self._handles[_address(handle)]

    # contexts and waiting

    def cuda_context_get_current(self):
        return getattr(self._current, "context", None)

    def cuda_context_set_current(self, context):
        self._current.context = context

    def cuda_device_get_memory_info(self, ordinal, free, total):
        for told in (free, total):
            if told is not None:
                told._obj.value = 8 << 30

    def cuda_context_synchronize(self, context):
        self._gpu.wait()
        return True

    def cuda_stream_synchronize(self, stream):
        self._gpu.wait()
        return True

    def cuda_event_synchronize(self, event):
        self._gpu.wait()
        return True

    def cuda_event_query(self, event):
        return _DONE if self._gpu.idle else _NOT_READY

    def cuda_stream_query(self, stream):
        return _DONE if self._gpu.idle else _NOT_READY

    # memory

    def alloc_device_async(self, context, size, stream, tag):
        return self._gpu.take(size)

    def free_device_async(self, context, place, stream):
        self._gpu.give_back(_address(place))

    def alloc_pinned(self, size, tag):
        place = self._library.wp_alloc_host(size, tag)
        self._pinned[place] = size
        return place

    def free_pinned(self, place):
        self._gpu.wait()
        del self._pinned[place]
        self._library.wp_free_host(place)

    def memset_device(self, context, place, value, size, stream):
        place = self._array(place, size)
        self._gpu.later(lambda: ctypes.memset(place, value, size))
        return True

    def memtile_device(self, context, place, source, size, times):
        place, told = self._array(place, size * times), ctypes.string_at(_address(source), size) * times
        self._gpu.later(lambda: ctypes.memmove(place, told, len(told)))

    def memcpy_h2d(self, context, place, source, size, stream):
        self._gpu.forbid_while_capturing("memory of the host is copied")
        place, source = self._array(place, size), _address(source)
        told = source if self._is_pinned(source) else ctypes.string_at(source, size)
        self._gpu.later(lambda: ctypes.memmove(place, told, size))
        return True

    def memcpy_d2h(self, context, place, source, size, stream):
        self._gpu.forbid_while_capturing("memory is copied to the host")
        place, source = _address(place), self._array(source, size)
        self._gpu.later(lambda: ctypes.memmove(place, source, size))
        if not self._is_pinned(place):
            self._gpu.wait()
        return True

    def memcpy_d2d(self, context, place, source, size, stream):
        place, source = self._array(place, size), self._array(source, size)
        self._gpu.later(lambda: ctypes.memmove(place, source, size))
        return True

    def _array(self, place, size: int) -> int:
        place = _address(place)
        self._gpu.memory.check(place, size)
        return place

    def _is_pinned(self, place: int) -> bool:
        return any(start <= place < start + size for start, size in self._pinned.items())

    def mesh_create_device(self, context, points, velocities, indices, vertices, triangles, winding, constructor, *rest):
        """By the CPU's code, whose trees are laid out alike, but which has one way of growing them fewer."""
        self._gpu.wait()
        if constructor == _LINEAR:
            constructor = _SURFACE_AREA
        with self._gpu.memory.opened():
            create = self._library.wp_mesh_create_host
            return create(points, velocities, indices, vertices, triangles, winding, constructor, *rest)

    def mesh_destroy_device(self, mesh):
        self._gpu.clean_up(lambda: self._library.wp_mesh_destroy_host(mesh))

    # kernels

    def cuda_load_module(self, context, path):
        self._gpu.forbid_while_capturing("a module is loaded")
        return self._handle(_load(Path(path.decode())))

    def cuda_get_kernel(self, context, module, name):
        kernel = self._thing(module).get(name.decode())
        return self._handle((name.decode(), *kernel)) if kernel else None

    def cuda_launch_kernel(
        self, context, kernel, number, most_blocks, threads, strides, cluster, shared, arguments, stream, apic
    ):
        name, function, sizes = self._thing(kernel)
        blocks = -(-number // threads)
        if most_blocks > 0:
            blocks = min(blocks, most_blocks)
        told = [ctypes.string_at(arguments[k], size) for k, size in enumerate(sizes)]
        if blocks:
            self._gpu.launch(name, function, told, blocks, threads)
        return 0

    # graphs

    def cuda_stream_is_capturing(self, stream):
        return int(self._gpu.capturing)

    def cuda_stream_get_capture_id(self, stream):
        return self._gpu.captures

    def cuda_graph_begin_capture(self, context, stream, external, mode):
        self._gpu.capture([])
        return True

    def cuda_graph_pause_capture(self, context, stream, graph):
        graph._obj.value = self._handle(self._gpu.end_capture())
        return True

    def cuda_graph_resume_capture(self, context, stream, graph):
        self._gpu.capture(self._thing(graph))
        return True

    def cuda_graph_end_capture(self, context, stream, graph):
        self._gpu.graphs += 1
        return self.cuda_graph_pause_capture(context, stream, graph)

    def cuda_graph_insert_if_else(self, context, stream, architecture, ptx, condition, then, otherwise):
        place, bodies = self._array(condition, 4), ([], [])
        for graph, body in ((then, bodies[0]), (otherwise, bodies[1])):
            if graph is not None:
                graph._obj.value = self._handle(body)
        self._gpu.later(lambda: play(bodies[0] if _flag(place) else bodies[1]))
        return True

    def cuda_graph_insert_while(self, context, stream, architecture, ptx, condition, body, handle):
        """The loop looks at its handle only, which is set before it and where its body says so."""
        place, graph, goes_on = self._array(condition, 4), [], [0]
        body._obj.value, handle._obj.value = self._handle(graph), self._handle(goes_on)

        def loop():
            goes_on[0] = _flag(place)
            while goes_on[0]:
                play(graph)

        self._gpu.later(loop)
        return True

    def cuda_graph_set_condition(self, context, stream, architecture, ptx, condition, handle):
        place, goes_on = self._array(condition, 4), self._thing(handle)
        self._gpu.later(lambda: goes_on.__setitem__(0, _flag(place)))
        return True

    def cuda_graph_create_exec(self, context, stream, graph, made):
        made._obj.value = _address(graph)
        return True

    def cuda_graph_launch(self, graph, stream):
        graph = self._thing(graph)
        self._gpu.later(lambda: play(graph))
        return True


class _Named:
    """A function that lets its types be told as those of ctypes do."""

    def __init__(self, function: Callable, *bound):
        self._function, self._bound = function, bound

    def __call__(self, *arguments):
        return self._function(*self._bound, *arguments)


def _missing(name: str) -> Callable:
    def fail(*_):
        raise PaperGpuError(f"{name} is not served")

    return fail


_building, _loads = threading.Lock(), count()


def _load(path: Path) -> dict[str, tuple[Callable, list[int]]]:
    """Kernels of a file of PTX, and the bytes of their arguments; compiled by Warp's own compiler, beside the file."""
    from warp._src.build import build_cpu
    from warp._src.context import runtime

    program = translate(path.read_text(errors="replace"))
    name = hashlib.sha256(program.source.encode()).hexdigest()
    compiled = path.with_name(f"{name[:16]}.paper.o")
    with _building:
        if not compiled.exists():
            source = compiled.with_suffix(f".{os.getpid()}.cpp")  # another process may be at it, too
            source.write_text(program.source)
            build_cpu(str(source.with_suffix(".o")), str(source), fuse_fp=False, optimization_level=1)
            source.with_suffix(".o").replace(compiled)
            source.unlink()
        unique = f"{name}_{next(_loads)}"
        if runtime.llvm.wp_load_obj(str(compiled).encode(), unique.encode(), wp.config.legacy_cpu_linker):
            raise PaperGpuError(f"{compiled} cannot be loaded")
        found = {entry: runtime.llvm.wp_lookup(unique.encode(), entry.encode()) for entry in program.entries}
    return {entry: (_SIGNATURE(found[entry]), sizes) for entry, sizes in program.entries.items()}


def _address(value) -> int:
    """An address or a handle, however it was told."""
    if isinstance(value, (int, type(None))):
        return value or 0
    return (value.value if hasattr(value, "value") else ctypes.cast(value, ctypes.c_void_p).value) or 0


def _flag(place: int) -> int:
    return ctypes.c_int32.from_address(place).value
