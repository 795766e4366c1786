"""The few numbers by which recorded stages steer themselves, so that the host is not asked inside a frame."""

import warp as wp

# Bits of ``Flags.fault``: why stepping stopped before the asked number of steps.
FAULT_ROOM = 1  # a list found more contacts than it can hold; the host makes room and goes on
FAULT_NOT_FINITE = 2  # a grain's velocity is no longer a number
FAULT_TOO_FAST = 4  # a grain moves more than half its radius in one step, so that it may pass through others unseen


class Flags:
    """One-element int arrays on the device.

    Attributes:
        running: the frame's loop goes on.
        proceed: there was room for all contacts so far, so lists may be filled.
        stepping: once the lists are complete a step follows, else the loop ends.
        grains_moved: some grain may have met a neighbour that is not on its list.
        tools_moved: the same for tools.
        fault: bits FAULT_*.
        starting: no step has been done since velocities were set.
        steps_left: steps still to do in this frame.
        steps_done: steps since the world began (int64).
    """

    def __init__(self, device: str):
        for name in ("running", "proceed", "stepping", "grains_moved", "tools_moved", "fault", "starting", "steps_left"):
            setattr(self, name, wp.zeros(1, dtype=int, device=device))
        self.steps_done = wp.zeros(1, dtype=wp.int64, device=device)
