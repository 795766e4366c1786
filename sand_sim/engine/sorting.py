"""Two primitives of every list: sort items by a small key, and running totals. Stable, and the same however work is shared out.

Few threads sort best if each owns some keys and looks at all items. On a device of many threads each takes some items: it counts
keys and takes places atomically, in whatever order, and the items of each key are put in order afterwards.
"""

from dataclasses import dataclass

import warp as wp

from sand_sim.engine.count import GROUP, Count, count_of, part_start, share_start
from sand_sim.engine.kernel import kernel


@dataclass(frozen=True)
class SortedItems:
    """Items grouped by key: those with key k are ``order[starts[k]]`` to ``order[starts[k + 1]]``, in their old order.

    Attributes:
        starts: int array, shape (keys + 1,).
        order: int array, shape (item capacity,).
        cursor: int scratch, shape (keys,).
        totals: scratch from ``totals_of``.
    """

    starts: wp.array
    order: wp.array
    cursor: wp.array
    totals: wp.array

    @classmethod
    def allocate(cls, keys: int, items: int, on) -> "SortedItems":
        """Room on a device for ``items`` items with keys below ``keys``."""
        return cls(*(wp.zeros(size, dtype=int, device=on.name) for size in (keys + 1, items, keys)), totals_of(on))


def totals_of(on) -> wp.array:
    """Scratch for totals of the shares of a device and, behind them, of their groups, int, shape (shares + groups,)."""
    return wp.zeros(on.shares + -(-on.shares // GROUP), dtype=int, device=on.name)


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
    bins = count_of(bins_in_use)
    first = part_start(bins, lane, lanes)
    last = part_start(bins, lane + 1, lanes)
    for key in range(first, last):
        counts[key] = 0
    total = int(0)
    for item in range(count_of(spans)):
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
    bins = count_of(bins_in_use)
    first = part_start(bins, lane, lanes)
    last = part_start(bins, lane + 1, lanes)
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
    for item in range(count_of(spans)):
        key = keys[item]
        if key >= first and key < last:
            order[cursor[key]] = item
            cursor[key] = cursor[key] + 1


@kernel
def clear_counts(lane: int, spans: wp.array(dtype=int), stride: int, counts: wp.array(dtype=int)):
    """No item has been counted yet."""
    for key in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        counts[key] = 0


@kernel
def count_keys(lane: int, spans: wp.array(dtype=int), stride: int, keys: wp.array(dtype=int), counts: wp.array(dtype=int)):
    """Count the items of each key."""
    for item in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        wp.atomic_add(counts, keys[item], 1)


@kernel
def take_places(
    lane: int,
    spans: wp.array(dtype=int),
    stride: int,
    keys: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    counts: wp.array(dtype=int),
    order: wp.array(dtype=int),
):
    """Let each item take the last free place of its key."""
    for item in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        key = keys[item]
        order[starts[key] + wp.atomic_sub(counts, key, 1) - 1] = item


@kernel
def order_places(
    lane: int,
    spans: wp.array(dtype=int),
    stride: int,
    unordered: int,
    starts: wp.array(dtype=int),
    order: wp.array(dtype=int),
):
    """Put the items of each key in their old order, by Shell's method; so many keys at the end are left as they are."""
    for key in range(spans[lane] + wp.tid(), wp.min(spans[lane + 1], count_of(spans) - unordered), stride):
        first = starts[key]
        last = starts[key + 1]
        gap = wp.max((last - first) * 5 // 11, 1)
        while gap > 0:
            for i in range(first + gap, last):
                moving = order[i]
                to = int(i)
                searching = bool(True)
                while searching:
                    searching = False
                    if to >= first + gap:
                        before = order[to - gap]
                        if before > moving:
                            order[to] = before
                            to -= gap
                            searching = True
                order[to] = moving
            if gap == 2:
                gap = 1
            else:
                gap = gap * 5 // 11


@kernel
def total_share(lane: int, shares: int, counts: wp.array(dtype=int), spans: wp.array(dtype=int), totals: wp.array(dtype=int)):
    """Sum of a share of the counts."""
    own = lane + wp.tid()
    items = count_of(spans)
    total = int(0)
    for item in range(share_start(items, own, shares), share_start(items, own + 1, shares)):
        total += counts[item]
    totals[own] = total


@kernel
def total_group(lane: int, shares: int, totals: wp.array(dtype=int)):
    """Sum of the totals of a group of shares."""
    own = lane + wp.tid()
    total = int(0)
    for share in range(wp.static(GROUP) * own, wp.min(wp.static(GROUP) * (own + 1), shares)):
        total += totals[share]
    if wp.static(GROUP) * own < shares:
        totals[shares + own] = total


@kernel
def running_totals(
    lane: int,
    shares: int,
    counts: wp.array(dtype=int),
    spans: wp.array(dtype=int),
    totals: wp.array(dtype=int),
    starts: wp.array(dtype=int),
):
    """Exclusive running totals of the counts; one entry more than there are items."""
    own = lane + wp.tid()
    items = count_of(spans)
    start = int(0)
    group = own / wp.static(GROUP)
    for before in range(group):
        start += totals[shares + before]
    for before in range(wp.static(GROUP) * group, own):
        start += totals[before]
    for item in range(share_start(items, own, shares), share_start(items, own + 1, shares)):
        number = counts[item]
        starts[item] = start
        start += number
    if own == shares - 1:
        starts[items] = start


def record_sort(recorder, keys: wp.array, bins: Count, items: Count, result: SortedItems, order_last: bool = True) -> None:
    """Sort the items of a population by key.

    Args:
        recorder: where the launches go.
        keys: key of each item, int, shape (item capacity,); all in ``range(bins)``.
        bins: how many different keys there are; at most the room of the result.
        items: the population.
        result: receives starts and order.
        order_last: whether the order within the last key matters; there may be too many of it for one thread.
    """
    if recorder.wide:
        recorder.each(clear_counts, bins, [result.cursor])
        recorder.each(count_keys, items, [keys, result.cursor])
        record_running_totals(recorder, result.cursor, bins, result.totals, result.starts)
        recorder.each(take_places, items, [keys, result.starts, result.cursor, result.order])
        recorder.each(order_places, bins, [0 if order_last else 1, result.starts, result.order])
        return
    recorder.share(count_own_keys, [keys, items.spans, bins.spans, result.cursor, result.totals])
    recorder.share(place_own_keys, [keys, items.spans, bins.spans, result.totals, result.cursor, result.starts, result.order])


def record_running_totals(recorder, counts: wp.array, items: Count, totals: wp.array, starts: wp.array) -> None:
    """Exclusive running totals: ``starts[i] = counts[0] + ... + counts[i - 1]``, shape (items + 1,)."""
    recorder.share(total_share, [counts, items.spans, totals])
    recorder.share(total_group, [totals])
    recorder.share(running_totals, [counts, items.spans, totals, starts])
