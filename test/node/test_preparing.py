"""What a node says while it prepares itself."""

import pytest

from sand_sim.node import preparing
from sand_sim.node.preparing import Preparation


def test_a_long_start_tells_how_far_it_is(monkeypatch):
    now, lines = [100.0], []
    monkeypatch.setattr(preparing.time, "monotonic", lambda: now[0])
    prepare = Preparation(lambda: None, lines.append)
    for stage, share, later in (("sampling", 1.0, 0.1), ("compiling", 0.2, 2.5), ("compiling", 0.3, 0.1), ("settling", 0.5, 2.5)):
        now[0] += later
        prepare(stage, share)
    assert lines == ["compiling, 20%", "settling, 50%"]


def test_the_start_ends_where_the_user_wants_to_stop():
    def check():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Preparation(check, print)("compiling", 0.5)
