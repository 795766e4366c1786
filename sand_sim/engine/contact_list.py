"""Which spheres may touch what: lists with a skin, one each for grain pairs, grains at walls and grains at tools.

A list holds, grain after grain, the partners within reach. It stays valid until something has moved as far as it may, see
``skin.py``. When it is rebuilt, the history of contacts that go on is carried over, also when the grains have been renumbered.
"""

from functools import cache

import warp as wp

from sand_sim.contact.response import memory_type
from sand_sim.engine.borrowing import Lender
from sand_sim.engine.count import Count, count_of, share_out
from sand_sim.engine.flags import FAULT_ROOM, Flags
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.sorting import record_running_totals, totals_of


class ContactList:
    """Contacts of one kind, with what the forces leave in them.

    Attributes:
        pairs: number of listed contacts and the room for them.
        starts: contacts of grain i are ``starts[i]`` to ``starts[i + 1]``, int, shape (grains + 1,).
        owner: the grain, int, shape (room,).
        partner: the other grain, the wall or the tool particle, int, shape (room,).
        force: on the owner, and nothing last, because four numbers are read at once, vec4, shape (room + 1,) [N].
        couple: tangential torque per lever arm (vec3 [N]) and half the overlap [m], vec4, shape (room + 1,); None without
            rotation.
        moment: rolling and twisting resistance on the owner, and nothing last, vec4, shape (room + 1,) [N m]; None without.
            Behind the last of each of the three lies a contact that is always zero.
        memory: what the contact laws remember, shape (room,); None without history.
        drawer: memory of the last list while a new one is made; None without history.
        wanted: contacts found by the last search, int, shape (1,).
        counts, new_starts, old_starts: scratch while lists are made, int, shape (grains + 1,); given by ``DemArrays``.
    """

    def __init__(self, room: int, grains: int, recipe: Recipe, on):
        self.recipe, self.device = recipe, on.name
        device = on.name
        self.pairs = Count(0, on.lanes, device)
        self.totals, self.starts = totals_of(on), wp.zeros(grains + 1, dtype=int, device=device)
        self.counts = self.new_starts = self.old_starts = None
        self.wanted = wp.zeros(1, dtype=int, device=device)
        self.partner = self.memory = None
        self.make_room(room)

    def make_room(self, room: int) -> None:
        """Enlarge the list; its contents stay."""
        recipe = self.recipe
        vec4, memory = recipe.precision.vec4, memory_type(recipe.contact, recipe.precision)
        self.pairs.capacity, kept = room, self.memory
        self.owner = wp.zeros(room, dtype=int, device=self.device)
        self.partner = self._enlarged(self.partner, int)
        self.old_partner = wp.zeros(room, dtype=int, device=self.device)
        self.force = wp.zeros(room + 1, dtype=vec4, device=self.device)
        self.couple = wp.zeros(room + 1, dtype=vec4, device=self.device) if recipe.rotation else None
        self.moment = wp.zeros(room + 1, dtype=vec4, device=self.device) if recipe.contact.couples else None
        self.memory = self.drawer = None
        if recipe.history:
            self.memory = self._enlarged(kept, memory)
            # Forces are idle while lists are made.
            self.drawer = Lender(self.force[:room], self.device).lend(memory, room)

    def _enlarged(self, old: wp.array | None, dtype: type) -> wp.array:
        new = wp.zeros(self.pairs.capacity, dtype=dtype, device=self.device)
        if old is not None:
            wp.copy(new, old, count=old.shape[0])
        return new


@wp.func
def listed_at(starts: wp.array(dtype=int), partner: wp.array(dtype=int), grain: int, other: int) -> int:
    """Index of the contact of a grain with a partner, or -1 if it is not listed."""
    found = int(-1)
    for contact in range(starts[grain], starts[sure(grain + 1)]):
        if partner[sure(contact)] == other:
            found = contact
    return found


@cache
def build_note(recipe: Recipe, filling: bool) -> wp.Function:
    """Warp function that counts or, ``filling``, lists a contact of a grain, with what the last list remembers of it."""
    history, memory_vector = recipe.history, memory_type(recipe.contact, recipe.precision)

    @wp.func
    def note(
        found: int,
        grain: int,
        number: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        memory: wp.array(dtype=memory_vector),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_memory: wp.array(dtype=memory_vector),
    ) -> int:
        if wp.static(filling):
            owner[found] = grain
            partner[found] = number
            if wp.static(history):
                kept = memory_vector()
                old = listed_at(old_starts, old_partner, came_from[grain], number)
                if old >= 0:
                    kept = old_memory[old]
                memory[found] = kept
        return found + 1

    return note


@kernel
def check_room(
    starts: wp.array(dtype=int),
    grain_spans: wp.array(dtype=int),
    room: int,
    wanted: wp.array(dtype=int),
    proceed: wp.array(dtype=int),
    stepping: wp.array(dtype=int),
    running: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Stop before anything is written if the contacts found do not fit; nothing is ever dropped."""
    number = starts[count_of(grain_spans)]
    wanted[0] = number
    if number > room:
        proceed[0] = 0
        stepping[0] = 0
        running[0] = 0
        wp.atomic_or(fault, 0, wp.static(FAULT_ROOM))


@kernel
def set_pairs(pair_spans: wp.array(dtype=int), wanted: wp.array(dtype=int)):
    """Share the contacts found out over the lanes."""
    share_out(pair_spans, wanted[0])


@kernel
def keep_starts(
    lane: int,
    spans: wp.array(dtype=int),
    stride: int,
    found: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    old: wp.array(dtype=int),
):
    """Put the starts of the last list aside and the new ones in place."""
    for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
        old[i] = starts[i]
        starts[i] = found[i]


@cache
def build_keep_contacts(memory: type) -> wp.Kernel:
    """Kernel that puts partners and memories of the last list aside."""

    @kernel
    def keep_contacts(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        partner: wp.array(dtype=int),
        kept: wp.array(dtype=memory),
        old_partner: wp.array(dtype=int),
        drawer: wp.array(dtype=memory),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            old_partner[i] = partner[i]
            drawer[i] = kept[i]

    return keep_contacts


def record_count(recorder, contacts: ContactList, grains: Count, counting, flags: Flags) -> None:
    """Count the contacts of each grain with ``counting()``, a launch that writes ``contacts.counts``, and see that they fit."""
    counting()
    record_running_totals(recorder, contacts.counts, grains, contacts.totals, contacts.new_starts)
    steering = [flags.proceed, flags.stepping, flags.running, flags.fault]
    recorder.once(check_room, [contacts.new_starts, grains.spans, contacts.pairs.capacity, contacts.wanted, *steering])


def record_fill(recorder, contacts: ContactList, grain_starts: Count, filling) -> None:
    """Write the contacts counted before with ``filling()``, which finds the last list in ``old_*`` and ``drawer``.

    Args:
        recorder: where the launches go.
        contacts: the list.
        grain_starts: as many items as the list has starts, retired grains of the last list included.
        filling: launch that writes owner, partner and memory.
    """
    recorder.each(keep_starts, grain_starts, [contacts.new_starts, contacts.starts, contacts.old_starts], wait=False)
    if contacts.memory is not None:
        recorder.each(
            build_keep_contacts(contacts.memory.dtype),
            contacts.pairs,
            [contacts.partner, contacts.memory, contacts.old_partner, contacts.drawer],
        )
    else:
        recorder.wait()
    recorder.once(set_pairs, [contacts.pairs.spans, contacts.wanted])
    filling()
