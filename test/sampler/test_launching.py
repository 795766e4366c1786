"""Kernels in shares, one on each core at a time."""

import os
import threading
from types import SimpleNamespace

import pytest

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
