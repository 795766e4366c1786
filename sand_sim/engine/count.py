"""How many of something there are, kept on the device and shared out over the lanes that work on it."""

import warp as wp

_ALIGNMENT = 16  # items per shared cache line, so that two cores never write to the same line
GROUP = 64  # shares that are summed up together first: a GPU has thousands, and a thread walks through them one after another


class Count:
    """A number of items that kernels may change, with room for ``capacity`` of them.

    Attributes:
        capacity: items that the arrays of this population can hold.
        spans: int array, shape (lanes + 1,); lane k works on items ``spans[k]`` to ``spans[k + 1]``, the last is the number.
    """

    def __init__(self, capacity: int, lanes: int, device: str):
        self.capacity = capacity
        self.lanes = lanes
        self.spans = wp.zeros(lanes + 1, dtype=int, device=device)

    def set(self, number: int) -> None:
        """Set the number of items from the host."""
        share = -(-max(number, 1) // self.lanes)
        share = -(-share // _ALIGNMENT) * _ALIGNMENT
        self.spans.assign([min(k * share, number) for k in range(self.lanes + 1)])

    def get(self) -> int:
        """Read the number of items on the host; waits for the device."""
        return int(self.spans.numpy()[self.lanes])


@wp.func
def share_start(number: int, own: int, shares: int) -> int:
    """First item of one of so many equal shares; the same as ``spans`` where there are as many shares as lanes."""
    share = (wp.max(number, 1) + shares - 1) // shares
    share = (share + wp.static(_ALIGNMENT) - 1) // wp.static(_ALIGNMENT) * wp.static(_ALIGNMENT)
    return wp.min(own * share, number)


@wp.func
def part_start(number: int, own: int, parts: int) -> int:
    """First item of one of so many parts that are as equal as can be; a product of 32 bits would be too small on a large GPU."""
    return int(wp.int64(number) * wp.int64(own) // wp.int64(parts))


@wp.func
def share_out(spans: wp.array(dtype=int), number: int):
    """Device side of ``Count.set``."""
    for lane in range(spans.shape[0]):
        spans[lane] = share_start(number, lane, spans.shape[0] - 1)


@wp.func
def count_of(spans: wp.array(dtype=int)) -> int:
    """Device side of ``Count.get``."""
    return spans[spans.shape[0] - 1]
