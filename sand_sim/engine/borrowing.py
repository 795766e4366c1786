"""Scratch that lies in an array which is idle while it is in use, so that it costs no memory."""

import warp as wp

_ALIGNMENT = 16  # bytes


class Lender:
    """Gives away the memory of an idle array piece by piece, and new memory where it is too small.

    Args:
        array: whose contents nobody needs while the borrowed ones are in use; None if the scene has left it out.
        device: Warp device.
    """

    def __init__(self, array: wp.array | None, device: str):
        self.device = device
        self._next, self._end = (array.ptr, array.ptr + array.capacity) if array is not None else (0, 0)

    def lend(self, dtype: type, number: int) -> wp.array:
        """An array of a shape (number,), with anything in it."""
        begin = -(-self._next // _ALIGNMENT) * _ALIGNMENT
        end = begin + number * wp.types.type_size_in_bytes(dtype)
        if end > self._end:
            return wp.zeros(number, dtype=dtype, device=self.device)
        self._next = end
        return wp.array(ptr=begin, dtype=dtype, shape=(number,), device=self.device, copy=False)
