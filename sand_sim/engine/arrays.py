"""All arrays of an explicit DEM world, and only those that its scene needs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from sand_sim.engine import energy, tool_contacts
from sand_sim.engine.bodies import Bodies
from sand_sim.engine.borrowing import Lender
from sand_sim.engine.cells import prepare_cells
from sand_sim.engine.chunks import CHUNK
from sand_sim.engine.contact_list import ContactList
from sand_sim.engine.count import Count
from sand_sim.engine.flags import Flags
from sand_sim.engine.grains import Grains
from sand_sim.engine.lattice import Lattice
from sand_sim.engine.neighbours import HITS
from sand_sim.engine.plungers import SUM_BLOCK, Plungers
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.skin import Skin
from sand_sim.engine.smooth_tools import Standing
from sand_sim.engine.sorting import SortedItems
from sand_sim.engine.surfaces import Surface
from sand_sim.engine.tool_body import ToolBody, Tools
from sand_sim.engine.triangle_tree import IN_ROW
from sand_sim.grain_table import GrainTable
from sand_sim.integrator import VERLET

_ROOM_TO_SPARE = 1.1
_FIRST_PAIRS = 3  # room for contacts per grain to begin with
_FACES = {"walls": 4, "tools": 2}  # the same: how many faces of a cube of grains they may lie at


@dataclass(frozen=True)
class Setting:
    """The numbers of a world; another value never recompiles.

    Attributes:
        gravity: shape (3,) [m/s^2].
        dt: time step [s].
        skin: how far two grains may approach each other before the lists are made anew, at most [m].
        radius: of a grain, on the mean [m]; 0 to keep the skin at its widest.
        reach: widest gap across which a contact acts, from the radius of its smaller sphere, with which it grows [m].
    """

    gravity: np.ndarray
    dt: float
    skin: float
    radius: float = 0.0
    reach: Callable[[float], float] = lambda radius: 0.0


class DemArrays:
    """State and scratch of a world on its device.

    Args:
        recipe: static choices.
        setting: numbers.
        lattice: the domain.
        table: the grains.
        walls: ``Surface`` structs.
        tools: driven ones, then rough terrain.
        pairs: ``MaterialPair`` structs, one row per material.
        on: the device, from ``device.open_device``.
        drives: ``Plunger`` structs of the walls that move, in their order.
        levers: of the last bodies, which may be pushed, see ``pushes.Push``.
    """

    def __init__(
        self,
        recipe: Recipe,
        setting: Setting,
        lattice: Lattice,
        table: GrainTable,
        walls: list,
        tools: list[ToolBody],
        pairs: list,
        on,
        drives: Sequence = (),
        levers: Sequence[np.ndarray] = (),
    ):
        self.recipe, self.setting, self.lattice, self.on = recipe, setting, lattice, on
        self.device = device = on.name
        lanes, shares = on.lanes, on.shares
        precision, number = recipe.precision, len(table)
        self.flags = Flags(device)
        self.skin = Skin(setting.skin / lattice.quantum, setting.radius / lattice.quantum, device)
        self.grains = Grains(table, lattice, recipe, lanes, device)
        self.bodies = Bodies(table, lattice, recipe, lanes, device, levers) if recipe.bodies else None
        self.felt_force = self.felt_torque = None
        if self.bodies:
            self.felt_force, self.felt_torque = (wp.zeros(number, dtype=precision.vec3, device=device) for _ in range(2))
            self.body_energy = wp.zeros(energy.blocks_for(self.bodies.count.capacity), dtype=wp.vec3d, device=device)
        self.kinds = len(pairs)
        rows = [pair for row in pairs for pair in row]
        self.pairs = wp.array(rows, dtype=recipe.contact.types(precision).pair, device=device)
        self.deepest = wp.zeros(lanes, dtype=precision.real, device=device)
        self.carried_off = wp.zeros(lanes, dtype=wp.float64, device=device)
        self.fastest = wp.zeros(shares, dtype=precision.real, device=device)

        self.cells = prepare_cells(table.radius, setting.skin, setting.reach, lattice, on)
        self.in_cells = SortedItems.allocate(self.cells.bins.capacity, 0, on)
        own = {array.dtype: wp.zeros_like(array) for array in (self.grains.motion, self.grains.remainder)}
        others = {array.dtype for array in self.grains.sorted_arrays} - set(own)
        self.spare = own | {dtype: Lender(own[precision.vec4], device).lend(dtype, number) for dtype in others}
        # What grains are allowed is asked for only while lists are made, when all that is idle.
        self.allowed = Lender(own[precision.vec4], device).lend(precision.whole, number)
        # What an observer sees lies in scratch that is idle between neighbour searches.
        self.seen_motion, self.seen_spin = self.grains.motion, self.grains.spin
        if recipe.integrator == VERLET:
            self.seen_motion = self.spare[precision.vec4]
            self.seen_spin = self.spare[precision.vec3] if recipe.rotation else None
        self.every_start = Count(number + 1, lanes, device)
        self.every_start.set(number + 1)
        self.met = SortedItems.allocate(number, 0, on)

        face = int(number ** (2.0 / 3.0)) + 16
        self.pair_list = self._contact_list(_FIRST_PAIRS * number + 64)
        self.walls = wp.array(walls, dtype=Surface, device=device) if walls else None
        self.wall_list = self._contact_list(_FACES["walls"] * face) if walls else None
        self.plungers = Plungers(list(drives), device) if drives else None
        self.plunger_states = self.plungers.states if drives else None
        largest = float(table.radius.max())
        self.widest_reach = setting.reach(largest)
        farthest = largest + setting.skin + self.widest_reach
        self.tools = Tools(tools, farthest, precision, device) if tools else None
        self.tool_list = self._contact_list(_FACES["tools"] * face) if tools else None
        self.touch = self.old_touch = self.standing = self.near = None
        self.grain_blocks = wp.zeros(energy.blocks_for(number), dtype=wp.vec3d, device=device)
        self.make_room()

    @property
    def lists(self) -> dict[str, ContactList]:
        """The contact lists that the scene needs, by name."""
        named = {"pair": self.pair_list, "wall": self.wall_list, "tool": self.tool_list}
        return {name: contacts for name, contacts in named.items() if contacts is not None}

    def make_room(self) -> None:
        """Enlarge the lists that want more room than they have. Recorded programs speak of the old arrays afterwards."""
        for contacts in self.lists.values():
            wanted = int(contacts.wanted.numpy()[0])
            if wanted > contacts.pairs.capacity:
                contacts.make_room(int(_ROOM_TO_SPARE * wanted))
        if self.met.order.shape[0] != self.pair_list.pairs.capacity:  # else it holds what a pair list still in use needs
            self.met = SortedItems.allocate(self.grains.capacity, self.pair_list.pairs.capacity, self.on)
        precision = self.recipe.precision
        # Nobody looks at old lists or at forces while the others are in use. Not so while lists are filled: memories of contacts
        # may lie in the forces then, so what is needed for that comes from the couples.
        self.energy = {
            name: Lender(c.old_partner, self.device).lend(precision.real, c.pairs.capacity) for name, c in self.lists.items()
        }
        number = self.grains.capacity
        pairs, room = self.pair_list, self.pair_list.pairs.capacity
        sorting = Lender(pairs.force[:room], self.device)
        self.keys, order = sorting.lend(int, number), sorting.lend(int, number)
        self.in_cells = replace(self.in_cells, order=order, cursor=sorting.lend(int, self.cells.bins.capacity))
        filling = Lender(pairs.couple and pairs.couple[:room], self.device)
        counts, old_starts, met_cursor = (filling.lend(int, number + 1) for _ in range(3))
        self.met = replace(self.met, cursor=met_cursor)
        self.hits = filling.lend(int, HITS * number + CHUNK * self.on.lanes)
        for contacts in self.lists.values():
            contacts.counts, contacts.old_starts, contacts.new_starts = counts, old_starts, filling.lend(int, number + 1)
        self.energy_blocks = {
            name: wp.zeros(energy.blocks_for(c.pairs.capacity), dtype=wp.vec2d, device=self.device)
            for name, c in self.lists.items()
        }
        if self.plungers:
            blocks = -(-self.wall_list.pairs.capacity // SUM_BLOCK)
            self.plunger_blocks = wp.zeros(blocks * self.plungers.number, dtype=wp.float64, device=self.device)
        if self.tools:
            room = self.tool_list.pairs.capacity
            blocks = -(-room // tool_contacts.SUM_BLOCK)
            self.lever = wp.zeros(room, dtype=precision.vec3, device=self.device)
            if self.tools.smooth:
                self._make_room_to_touch(room)
            self.wrench_blocks = wp.zeros((blocks * self.tools.number, 2), dtype=wp.vec3d, device=self.device)

    def _make_room_to_touch(self, room: int) -> None:
        kept, vec4 = self.touch, self.recipe.precision.vec4
        if kept is None or kept.shape[0] < room:
            self.touch = wp.zeros(room, dtype=vec4, device=self.device)
            self.standing = wp.zeros(room, dtype=Standing, device=self.device)
            self.near = wp.zeros((room, IN_ROW), dtype=int, device=self.device)
            if kept is not None:
                wp.copy(self.touch, kept, count=kept.shape[0])
            self.old_touch = wp.zeros(room, dtype=vec4, device=self.device) if self.recipe.history else None

    def _contact_list(self, room: int) -> ContactList:
        return ContactList(room, self.grains.capacity, self.recipe, self.on)
