"""That the paper GPU is as unkind as a real one, and computes what it is told; run by ``test_paper_gpu.py``."""

import ctypes
import signal
import subprocess
import sys

import numpy as np
import pytest
import warp as wp

from paper_gpu import GPU
from paper_gpu.gpu import PaperGpuError

DEVICE = "cuda"


@wp.kernel(enable_backward=False)
def double(values: wp.array(dtype=float)):
    i = wp.tid()
    values[i] = 2.0 * values[i]


@wp.kernel(enable_backward=False)
def pass_on(values: wp.array(dtype=int)):
    i = wp.tid()
    if i > 0:
        values[i] = values[i - 1] + 1


@wp.kernel(enable_backward=False)
def lower(flag: wp.array(dtype=int), seen: wp.array(dtype=int)):
    seen[0] += flag[0]
    flag[0] -= 1


@wp.kernel(enable_backward=False)
def compute(
    a: wp.array(dtype=wp.float64),
    n: wp.array(dtype=wp.int64),
    real: wp.array2d(dtype=wp.float64),
    whole: wp.array2d(dtype=wp.int64),
):
    i = wp.tid()
    x, k = a[i], n[i]
    real[0, i] = wp.sin(x)
    real[1, i] = wp.exp(wp.min(x, wp.float64(5.0)))
    real[2, i] = wp.sqrt(wp.abs(x))
    real[3, i] = wp.floor(x) + wp.float64(float(wp.round(x)))
    real[4, i] = wp.float64(wp.float32(x) * wp.float32(3.0))
    whole[0, i] = k / wp.int64(7)
    whole[1, i] = k % wp.int64(7)
    whole[2, i] = (k << wp.int64(3)) ^ (k >> wp.int64(2))
    whole[3, i] = wp.int64(wp.int32(k) * wp.int32(77777))
    whole[4, i] = wp.int64(x)


def test_it_computes_what_it_is_told():
    """Also sines of what is so large that they call a function of their own, and products that do not fit."""
    random = np.random.default_rng(0)
    a = np.concatenate([random.uniform(-9.0, 9.0, 300), 10.0 ** random.uniform(3.0, 12.0, 100)])
    n = random.integers(-(2**62), 2**62, len(a))
    real, whole = (wp.zeros((5, len(a)), dtype=kind, device=DEVICE) for kind in (wp.float64, wp.int64))
    arrays = [wp.array(a, dtype=wp.float64, device=DEVICE), wp.array(n, dtype=wp.int64, device=DEVICE)]
    wp.launch(compute, dim=len(a), inputs=[*arrays, real, whole], device=DEVICE)
    half = np.trunc(np.float32(a) + np.copysign(np.float32(0.5), np.float32(a)))
    wanted = [np.sin(a), np.exp(np.minimum(a, 5.0)), np.sqrt(abs(a)), None, np.float64(np.float32(a) * np.float32(3.0))]
    for row, found in zip(wanted, real.numpy(), strict=True):
        if row is not None:
            np.testing.assert_allclose(found, row, rtol=1e-14, atol=1e-15)
    small = abs(a) < 9.0
    np.testing.assert_array_equal(real.numpy()[3, small], (np.floor(a) + half)[small])
    remainder = np.fmod(n, 7)
    wanted = [(n - remainder) // 7, remainder, (n << 3) ^ (n >> 2), (n.astype(np.int32) * np.int32(77777)).astype(np.int64)]
    np.testing.assert_array_equal(whole.numpy(), [*wanted, np.trunc(a).astype(np.int64)])


def test_nothing_happens_before_the_host_waits():
    values = wp.array([1.0, 2.0], dtype=float, device=DEVICE)
    told = wp.zeros(2, dtype=float, device="cpu", pinned=True)
    wp.launch(double, dim=2, inputs=[values], device=DEVICE)
    wp.copy(told, values)
    assert list(told.numpy()) == [0.0, 0.0]
    wp.synchronize_device(DEVICE)
    assert list(told.numpy()) == [2.0, 4.0]


def test_the_host_cannot_read_its_memory():
    """As another process shows, which dies of it."""
    script = (
        "import paper_gpu, warp as wp, ctypes; a = wp.zeros(1, dtype=int, device='cuda'); a.numpy(); ctypes.string_at(a.ptr, 4)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert done.returncode == -signal.SIGSEGV


def test_fresh_memory_holds_rubbish():
    assert wp.empty(3, dtype=wp.uint8, device=DEVICE).numpy().all()


def test_threads_come_in_no_order():
    """What hangs on it comes out otherwise from time to time."""
    found = set()
    for _ in range(20):
        values = wp.zeros(50, dtype=int, device=DEVICE)
        wp.launch(pass_on, dim=50, inputs=[values], device=DEVICE)
        found.add(tuple(values.numpy()))
    assert len(found) > 5


def test_graphs_loop_as_long_as_their_flag_says():
    flag, seen = (wp.array([k], dtype=int, device=DEVICE) for k in (4, 0))
    wp.load_module(device=DEVICE)
    with wp.ScopedCapture(device=DEVICE) as capture:
        wp.capture_while(flag, lambda: wp.launch(lower, dim=1, inputs=[flag, seen], device=DEVICE))
        wp.capture_if(
            flag, on_true=lambda: seen.fill_(-1), on_false=lambda: wp.launch(lower, dim=1, inputs=[seen, flag], device=DEVICE)
        )
    assert list(seen.numpy()) == [0]
    wp.capture_launch(capture.graph)
    assert (list(seen.numpy()), list(flag.numpy())) == ([9], [10])


@pytest.mark.parametrize("forbidden", [wp.zeros_like, wp.array.numpy], ids=["memory", "waiting"])
def test_what_cannot_be_captured_is_refused(forbidden):
    values = wp.zeros(1, dtype=float, device=DEVICE)
    with pytest.raises(PaperGpuError, match="captured"), wp.ScopedCapture(device=DEVICE, force_module_load=False):
        forbidden(values)


def test_what_is_written_beside_an_array_is_seen():
    values = wp.zeros(5, dtype=float, device=DEVICE)
    longer = wp.array(ptr=values.ptr, dtype=float, shape=6, device=DEVICE)
    wp.launch(double, dim=6, inputs=[longer], device=DEVICE)
    with pytest.raises(PaperGpuError, match="behind the 20 bytes"):
        wp.synchronize_device(DEVICE)
    with GPU.memory.opened():
        GPU.memory.mark(values.ptr, 20)  # so that tests to come find it in order


def test_what_is_in_no_array_is_refused():
    held = wp.zeros(4, dtype=float, device=DEVICE)
    beyond = wp.array(ptr=held.ptr + 8, dtype=float, shape=4, device=DEVICE)
    with pytest.raises(PaperGpuError, match="in none of the arrays"):
        beyond.numpy()
    assert ctypes.sizeof(ctypes.c_float) * 4 == held.capacity
