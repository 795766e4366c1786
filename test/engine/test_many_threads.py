"""What the CUDA device does, on a CPU: every scene gives the same bits with one thread an item as with one lane a core."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from kinds import KINDS, flying_grains, same_state
from many_threads import ManyThreads, ShuffledThreads
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.engine import sorting
from sand_sim.engine.count import GROUP, Count, part_start
from sand_sim.engine.cuda import CudaRecorder
from sand_sim.engine.device import open_device
from sand_sim.engine.kernel import kernel
from sand_sim.engine.lanes import CpuDevice
from sand_sim.scene.types import SceneError


@pytest.mark.parametrize("eager", [False, True])
def test_same_bits_with_a_tool(with_device, tmp_path, eager):
    path = write_small_scene(tmp_path)
    worlds = [
        with_device(device, lambda: World(load_scene(path)))
        for device in (CpuDevice(1), ManyThreads(7, 5, eager), ManyThreads(1000, 300, eager))
    ]
    for world in worlds:
        world.assembly.solver.expect_moves()
        world.step(400)
    for world in worlds[1:]:
        same_state(worlds[0], world)


@pytest.mark.parametrize("case", KINDS)
def test_same_bits(with_device, make_world, case):
    devices = CpuDevice(1), ManyThreads()
    worlds = [with_device(device, lambda: flying_grains(make_world, case)) for device in devices]
    for world in worlds:
        world.step(300)
    same_state(*worlds)
    seen = [world.observe() for world in worlds]
    assert repr(seen[0].health) == repr(seen[1].health)
    np.testing.assert_array_equal(seen[0].grains.velocity, seen[1].grains.velocity)
    assert case != "grains that leave" or seen[0].health.retired > 20


def in_and_out_of_order(with_device, make):
    """A world on a device that takes threads in order, and one on a device that does not, after some steps and lists."""
    worlds = [with_device(device, make) for device in (ManyThreads(vectors=False), ShuffledThreads())]
    for world in worlds:
        for _ in range(3):
            world.step(20)
            world.assembly.solver.expect_moves()
        world.observe()
    return worlds


@pytest.mark.parametrize("case", KINDS)
def test_same_bits_whatever_the_order_of_threads(with_device, make_world, case):
    """Threads of a launch neither read what others of it write nor add up in the order in which they come."""
    same_state(*in_and_out_of_order(with_device, lambda: flying_grains(make_world, case)))


@pytest.mark.parametrize("contact", ["rough", "smooth"])
def test_same_bits_at_a_tool_whatever_the_order_of_threads(with_device, tmp_path, contact):
    scene = load_scene(write_small_scene(tmp_path))
    scene = replace(scene, tools=tuple(replace(tool, contact=contact) for tool in scene.tools))
    same_state(*in_and_out_of_order(with_device, lambda: World(scene)))


@pytest.mark.parametrize("keys", [1, 3, 500])
@pytest.mark.parametrize("reverse", [False, True])
def test_sort_is_stable_whatever_the_order_of_threads(keys, reverse):
    """Places are taken in any order on a GPU; here they are taken in two, and the items of each key end in their old order."""
    device, random = ManyThreads(threads=64, shares=9), np.random.default_rng(keys)
    number, room = 700, 800
    key = random.integers(0, keys, room).astype(np.int32)
    items, bins = Count(room, 1, "cpu"), Count(keys, 1, "cpu")
    items.set(number)
    bins.set(keys)
    result, recorder = sorting.SortedItems.allocate(keys, room, device), CudaRecorder(device)
    sorting.record_sort(recorder, wp.array(key, dtype=int, device="cpu"), bins, items, result)
    if reverse:
        order, starts = result.order.numpy(), result.starts.numpy()
        for k in range(keys):
            random.shuffle(order[starts[k] : starts[k + 1]])
        recorder.each(sorting.order_places, bins, [0, result.starts, result.order])
    np.testing.assert_array_equal(result.starts.numpy(), np.searchsorted(np.sort(key[:number]), np.arange(keys + 1)))
    np.testing.assert_array_equal(result.order.numpy()[:number], np.argsort(key[:number], kind="stable"))


@pytest.mark.parametrize("shares", [1, GROUP - 1, GROUP, GROUP + 1, 5 * GROUP + 3])
@pytest.mark.parametrize("number", [0, 40, 5000])
def test_running_totals_over_any_number_of_shares(shares, number):
    """Also where most shares are empty, and where groups of them are not full."""
    device, counts = ManyThreads(shares=shares), np.random.default_rng(shares).integers(0, 9, 6000).astype(np.int32)
    items, starts = Count(len(counts), 1, "cpu"), wp.zeros(len(counts) + 1, dtype=int, device="cpu")
    items.set(number)
    given = wp.array(counts, dtype=int, device="cpu")
    sorting.record_running_totals(CudaRecorder(device), given, items, sorting.totals_of(device), starts)
    np.testing.assert_array_equal(starts.numpy()[: number + 1], np.append(0, np.cumsum(counts[:number])))


@kernel
def cut(number: int, parts: int, starts: wp.array(dtype=int)):
    starts[wp.tid()] = part_start(number, wp.tid(), parts)


@pytest.mark.parametrize("number", [7, 600_000, 2**31 - 1])
def test_parts_of_as_many_items_as_a_large_gpu_holds(number):
    starts = wp.empty(4097, dtype=int, device="cpu")
    wp.launch(cut, 4097, [number, 4096, starts], device="cpu")
    np.testing.assert_array_equal(starts.numpy(), number * np.arange(4097) // 4096)


def test_a_driver_that_is_too_old_is_told(monkeypatch):
    """Warp finds no GPU then, which is there all the same."""
    monkeypatch.setattr(wp, "get_cuda_driver_version", lambda: (12, 8))
    monkeypatch.setattr(wp, "get_cuda_toolkit_version", lambda: (13, 4))
    with pytest.raises(ValueError, match=r"'cuda' needs an NVIDIA driver for CUDA 13 or newer, and this one is for 12\.8"):
        open_device("cuda", None)


def test_device_is_refused_by_name(tmp_path):
    if wp.is_cuda_available():
        pytest.skip("this machine has a GPU")
    for name, words in (("cuda", "needs an NVIDIA GPU"), ("cuda:1", "needs an NVIDIA GPU"), ("gpu", "unknown device 'gpu'")):
        with pytest.raises(SceneError, match=f"solver.device: .*{words}") as refused:
            World(load_scene(write_small_scene(tmp_path, solver={"device": name})))
        assert "cpu" in str(refused.value)
    assert open_device("auto", 1).name == "cpu"
