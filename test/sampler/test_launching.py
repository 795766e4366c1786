"""Kernels in shares, one on each core at a time."""

import os
import threading
from types import SimpleNamespace

import pytest

from sampler import launching


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
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    with pytest.raises(KeyboardInterrupt):
        launching.launch_shares(SimpleNamespace(module=None), 8000, [], [], "cpu")
    assert 1000 in ended, "the share that had begun"
