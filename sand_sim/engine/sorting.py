"""Two primitives of every list: sort items by a small key, and running totals. Stable, and the same on any number of lanes."""

from dataclasses import dataclass

import warp as wp

from sand_sim.engine.count import Count
from sand_sim.engine.kernel import kernel


@dataclass(frozen=True)
class SortedItems:
    """Items grouped by key: those with key k are ``order[starts[k]]`` to ``order[starts[k + 1]]``, in their old order.

    Attributes:
        starts: int array, shape (keys + 1,).
        order: int array, shape (item capacity,).
        cursor: int scratch, shape (keys,).
        totals: int scratch, shape (lanes,).
    """

    starts: wp.array
    order: wp.array
    cursor: wp.array
    totals: wp.array

    @classmethod
    def allocate(cls, keys: int, items: int, lanes: int, device: str) -> "SortedItems":
        """Room for ``items`` items with keys below ``keys``."""
        return cls(*(wp.zeros(size, dtype=int, device=device) for size in (keys + 1, items, keys, lanes)))


@kernel
def count_own_keys(
    lane: int,
    lanes: int,
    keys: wp.array(dtype=int),
    spans: wp.array(dtype=int),
    bins_in_use: wp.array(dtype=int),
    counts: wp.array(dtype=int),
    totals: wp.array(dtype=int),
):
    """Each lane owns an interval of keys and counts the items that carry them."""
    bins = bins_in_use[bins_in_use.shape[0] - 1]
    first = int(wp.int64(bins) * wp.int64(lane) // wp.int64(lanes))
    last = int(wp.int64(bins) * wp.int64(lane + 1) // wp.int64(lanes))
    for key in range(first, last):
        counts[key] = 0
    total = int(0)
    for item in range(spans[lanes]):
        key = keys[item]
        if key >= first and key < last:
            counts[key] = counts[key] + 1
            total += 1
    totals[lane] = total


@kernel
def place_own_keys(
    lane: int,
    lanes: int,
    keys: wp.array(dtype=int),
    spans: wp.array(dtype=int),
    bins_in_use: wp.array(dtype=int),
    totals: wp.array(dtype=int),
    cursor: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    order: wp.array(dtype=int),
):
    """Turn the counts of the lane's keys into starts and put their items in order."""
    bins = bins_in_use[bins_in_use.shape[0] - 1]
    first = int(wp.int64(bins) * wp.int64(lane) // wp.int64(lanes))
    last = int(wp.int64(bins) * wp.int64(lane + 1) // wp.int64(lanes))
    start = int(0)
    for before in range(lane):
        start += totals[before]
    for key in range(first, last):
        number = cursor[key]
        starts[key] = start
        cursor[key] = start
        start += number
    if lane == lanes - 1:
        starts[bins] = start
    for item in range(spans[lanes]):
        key = keys[item]
        if key >= first and key < last:
            order[cursor[key]] = item
            cursor[key] = cursor[key] + 1


@kernel
def total_share(lane: int, lanes: int, counts: wp.array(dtype=int), spans: wp.array(dtype=int), totals: wp.array(dtype=int)):
    """Sum of the lane's share of the counts."""
    total = int(0)
    for item in range(spans[lane], spans[lane + 1]):
        total += counts[item]
    totals[lane] = total


@kernel
def running_totals(
    lane: int,
    lanes: int,
    counts: wp.array(dtype=int),
    spans: wp.array(dtype=int),
    totals: wp.array(dtype=int),
    starts: wp.array(dtype=int),
):
    """Exclusive running totals of the counts; one entry more than there are items."""
    start = int(0)
    for before in range(lane):
        start += totals[before]
    for item in range(spans[lane], spans[lane + 1]):
        number = counts[item]
        starts[item] = start
        start += number
    if lane == lanes - 1:
        starts[spans[lanes]] = start


def record_sort(recorder, keys: wp.array, bins: wp.array, items: Count, result: SortedItems) -> None:
    """Sort the items of a population by key.

    Args:
        recorder: where the launches go.
        keys: key of each item, int, shape (item capacity,); all in ``range(bins[0])``.
        bins: number of different keys, int, shape (1,) or the last entry of a longer array; at most the room of the result.
        items: the population.
        result: receives starts and order.
    """
    recorder.share(count_own_keys, [keys, items.spans, bins, result.cursor, result.totals])
    recorder.share(place_own_keys, [keys, items.spans, bins, result.totals, result.cursor, result.starts, result.order])


def record_running_totals(recorder, counts: wp.array, items: Count, totals: wp.array, starts: wp.array) -> None:
    """Exclusive running totals: ``starts[i] = counts[0] + ... + counts[i - 1]``, shape (items + 1,)."""
    recorder.share(total_share, [counts, items.spans, totals])
    recorder.share(running_totals, [counts, items.spans, totals, starts])
