"""Kernels in shares, one on each core at a time."""

import os
import re
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

import sampler.sampling  # which declares all kernels
from sampler import cores, launching


def test_what_is_broken_off_leaves_no_share_running(monkeypatch):
    """Ctrl-C let go of arrays that other shares still wrote to, which was a segmentation fault."""
    begun, told, ended = threading.Event(), threading.Event(), []

    def launch(kernel, inputs, **_):
        if inputs[-1] == 0:
            begun.wait()
            raise KeyboardInterrupt
        begun.set()
        told.wait(0.5)  # nobody sets it: the first share's error is there long before this one has ended
        ended.append(inputs[-1])

    monkeypatch.setattr(launching.wp, "launch", launch)
    monkeypatch.setattr(launching.wp, "load_module", lambda *_: None)
    monkeypatch.setattr(launching, "available_cores", lambda: 2)
    with pytest.raises(KeyboardInterrupt):
        launching.launch_shares(SimpleNamespace(module=None), 8000, [], [], "cpu")
    assert 1000 in ended, "the share that had begun"


@pytest.mark.parametrize(("quota", "number"), [("max 100000", 4), ("250000 100000", 2), ("20000 100000", 1), (None, 4), ("", 4)])
def test_a_container_has_the_cores_that_its_share_is_worth(tmp_path, monkeypatch, quota, number):
    if quota is not None:
        (tmp_path / "cpu.max").write_text(quota)
    monkeypatch.setattr(cores, "_QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: range(4))
    assert cores.available_cores() == number


def test_cores_are_counted_where_a_process_may_use_all(tmp_path, monkeypatch):
    """As on macOS, which does not know of others."""
    monkeypatch.setattr(cores, "_QUOTA", tmp_path / "none")
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert cores.available_cores() == 6


def test_kernels_that_all_bodies_need_are_made_ready_together(monkeypatch):
    """All there are but those for cracks; once for a device, and not at all if that is given up."""
    sources = Path(sampler.__file__).parent.rglob("*.py")
    declared = {name for path in sources for name in re.findall(r'(?:module|MODULE) ?= ?"sampler_(\w+)"', path.read_text())}
    assert declared == {*launching._MODULES, "welding"}
    made = []
    monkeypatch.setattr(launching, "compile_modules", lambda modules, device, *_: made.append((modules, device)))
    monkeypatch.setattr(launching, "_loaded", set())
    for device in ("cpu", "cpu", "cuda"):
        launching.load_kernels(device, lambda: None)
    assert [device for _, device in made] == ["cpu", "cuda"]
    assert {module.name for module in made[0][0]} == {f"sampler_{name}" for name in launching._MODULES}


def test_making_kernels_ready_can_be_given_up(monkeypatch):
    monkeypatch.setattr(launching, "_loaded", set())

    def give_up():
        raise InterruptedError

    with pytest.raises(InterruptedError):
        launching.load_kernels("cpu", give_up)
    assert not launching._loaded
    launching.load_kernels("cpu", lambda: None)
    assert launching._loaded == {"cpu"}
