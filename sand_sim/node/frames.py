"""Frames by name and how they lie in each other: a table of fixed ones, and what TF tells."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sand_sim import rotation
from sand_sim.border import CommandError, Frame

_MOST = 10_000


class FrameTree:
    """Frames below a root.

    Args:
        root: name of the world frame.
    """

    def __init__(self, root: str):
        self.root = root
        self._frames: dict[str, Frame] = {}

    @property
    def names(self) -> set[str]:
        """Of all frames below the root."""
        return {*self._frames}

    def put(self, frame: Frame) -> None:
        """Add or replace a frame.

        Raises:
            CommandError: if it has no name, or the same as its parent or the root, is not finite, has the zero quaternion, or is
                one too many.
        """
        name = frame.name
        if not name or not frame.parent or name in (frame.parent, self.root):
            raise CommandError("bad_frame", f"frame '{name}' in '{frame.parent}': needs two different names")
        if not np.all(np.isfinite(np.concatenate([frame.position, frame.orientation]))):
            raise CommandError("not_finite", f"frame '{name}' in '{frame.parent}': position and orientation must be finite")
        try:
            orientation = rotation.unit(frame.orientation)
        except ValueError as error:
            raise CommandError("zero_quaternion", f"frame '{name}' in '{frame.parent}': orientation is {error}") from None
        if name not in self._frames and len(self._frames) >= _MOST:
            raise CommandError("flooded", f"frame '{name}': {_MOST} frames are known already")
        self._frames[name] = replace(frame, orientation=orientation)

    def chain(self, name: str) -> Iterator[Frame]:
        """The frames from one up to, and without, the root.

        Raises:
            CommandError: if it does not hang on the root.
        """
        start, seen = name, 0
        while name != self.root:
            frame, seen = self._frames.get(name), seen + 1
            if frame is None or seen > len(self._frames):
                known = ", ".join(sorted([self.root, *self._frames])[:20])
                bare = start.lstrip("/") or self.root
                hint = f"; say '{bare}'" if bare != start and bare in (self.root, *self._frames) else ""
                if frame is None and name != start:
                    hint = f": nothing tells where '{name}' is"
                raise CommandError("unknown_frame", f"frame '{start}' does not hang on '{self.root}'{hint}; known are {known}")
            yield frame
            name = frame.parent

    def in_root(self, name: str, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A pose in a frame as a pose in the root frame: position, shape (3,) [m], and orientation, shape (4,).

        Raises:
            CommandError: as ``chain``.
        """
        for frame in self.chain(name):
            position = frame.position + rotation.rotate(frame.orientation, position)
            orientation = rotation.multiply(frame.orientation, orientation)
        return position, orientation
