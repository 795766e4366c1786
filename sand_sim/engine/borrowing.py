"""Scratch that lies in arrays which are idle while it is in use, so that it costs no memory."""

from collections.abc import Sequence

import warp as wp

_ALIGNMENT = 16  # bytes


class Lender:
    """Gives away the memory of idle arrays piece by piece, and new memory where they are too small.

    Args:
        arrays: whose contents nobody needs while the borrowed ones are in use; None where a scene has left one out.
        device: Warp device.
    """

    def __init__(self, arrays: Sequence[wp.array | None], device: str):
        self.device = device
        self._free = [[array.ptr, array.ptr + array.capacity] for array in arrays if array is not None]

    def lend(self, dtype: type, number: int) -> wp.array:
        """An array of a shape (number,), with anything in it."""
        size = number * wp.types.type_size_in_bytes(dtype)
        for piece in self._free:
            begin = -(-piece[0] // _ALIGNMENT) * _ALIGNMENT
            if begin + size <= piece[1]:
                piece[0] = begin + size
                return wp.array(ptr=begin, dtype=dtype, shape=(number,), device=self.device, copy=False)
        return wp.zeros(number, dtype=dtype, device=self.device)
