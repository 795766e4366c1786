"""The explicit DEM solver: runs its recorded stages, makes room where lists grow, and gives away its whole state."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.energy import blocks_for
from sand_sim.engine.flags import FAULT_NOT_FINITE, FAULT_ROOM, FAULT_TOO_FAST
from sand_sim.engine.measuring import record_measurement
from sand_sim.engine.stages import choose_stages, record_run
from sand_sim.engine.state import put_state, take_state
from sand_sim.engine.survey import list_kernels


class UnstableError(RuntimeError):
    """A run has blown up; the message says what happened."""


@dataclass(frozen=True)
class Sums:
    """Sums over all grains and contacts now.

    Attributes:
        translation, rotation: kinetic energies [J].
        height: potential energy against the middle of the domain [J].
        elastic: energy stored in contacts [J].
        touching: contacts under load.
        fastest: largest speed of a sphere, members of clumps and bodies included [m/s].
        deepest: largest overlap over the smaller radius since the start [1].
        carried_off: kinetic and potential energy of all that has left the domain [J].
    """

    translation: float
    rotation: float
    height: float
    elastic: float
    touching: int
    fastest: float
    deepest: float
    carried_off: float


class ExplicitDem:
    """Grains, walls and tools under explicit time integration.

    Attributes:
        steps_done: steps since time zero; known on the host, because other threads ask for it, who must not ask a GPU: Warp
            changes the stream of all threads while it reads an array.

    Args:
        arrays: state and scratch.
        device: the arrays', from ``device.open_device``.
        progress: called with the name of a stage of the preparation and the share of it that is done, 0 to 1.
    """

    def __init__(self, arrays: DemArrays, device, progress: Callable[[str, float], None] = lambda stage, share: None):
        self.arrays, self.device = arrays, device
        self.stages = choose_stages(arrays)
        self._programs = {}
        self.steps_done = 0
        device.load(list_kernels(arrays, self.stages, device), progress)
        arrays.flags.starting.fill_(1)
        self.expect_moves()

    def expect_moves(self) -> None:
        """Renew all contact lists before the next step: something has been moved from outside."""
        self.arrays.flags.grains_moved.fill_(1)
        self.arrays.flags.tools_moved.fill_(1 if self.arrays.tools else 0)

    def run(self, steps: int) -> None:
        """Advance by a number of steps.

        Raises:
            UnstableError: if a velocity is no longer finite, or a grain moves more than half its radius in one step.
        """
        left = self.arrays.flags.steps_left
        while steps > 0:
            portion = min(steps, self.device.portion)
            left.fill_(portion)
            while int(left.numpy()[0]) > 0:
                self._play(stepping=True)
            steps -= portion

    def begin(self) -> None:
        """Make this moment time zero: renew the lists and forget what has been counted and summed up."""
        arrays = self.arrays
        self.renew_lists()
        arrays.flags.steps_done.zero_()
        self.steps_done = 0
        arrays.deepest.zero_()
        arrays.carried_off.zero_()
        if arrays.tools:
            for sum_so_far in (arrays.tools.wrench, arrays.tools.impulse, arrays.tools.work):
                sum_so_far.zero_()

    def engage_plungers(self) -> None:
        """Let plungers move from now on."""
        if self.arrays.plungers:
            self.arrays.plungers.engage()

    def renew_lists(self) -> None:
        """Make the contact lists anew where they are no longer valid, as the next step would."""
        flags = self.arrays.flags
        while int(flags.grains_moved.numpy()[0]) or int(flags.tools_moved.numpy()[0]):
            self._play(stepping=False)

    def remove(self, identities: np.ndarray) -> None:
        """Retire spheres by their identities, shape (n,); of a rigid body all must be given."""
        grains = self.arrays.grains
        active = grains.active.get()
        place = grains.place.numpy().copy()
        gone = np.flatnonzero(np.isin(grains.identity.numpy()[:active], identities))
        place[gone] = [self.arrays.lattice.end] * 3 + [0]
        grains.place.assign(place)
        if self.arrays.bodies:
            bodies, members = self.arrays.bodies, grains.member.numpy()[gone]
            alive = bodies.place.numpy().copy()
            alive[bodies.body_of.numpy()[members[members >= 0]], 3] = 0
            bodies.place.assign(alive)
        self.expect_moves()

    def measure(self) -> Sums:
        """Bring forces, wrenches and the velocities ``seen_*`` up to now, and sum energies and contacts."""
        arrays = self.arrays
        self.renew_lists()
        self._program(record_measurement)()
        grains = arrays.grain_blocks.numpy()[: blocks_for(arrays.grains.active.get())]
        energies = grains.sum(axis=0)
        if arrays.bodies:
            energies = energies + arrays.body_energy.numpy().sum(axis=0)
        translation, rotation, height = energies
        contacts = np.zeros(2)
        for name, listed in arrays.lists.items():
            contacts += arrays.energy_blocks[name].numpy()[: blocks_for(listed.pairs.get())].sum(axis=0)
        return Sums(
            float(translation),
            float(rotation),
            float(height),
            float(contacts[0]),
            int(contacts[1]),
            float(arrays.fastest.numpy().max()),
            float(arrays.deepest.numpy().max()),
            float(arrays.carried_off.numpy().sum()),
        )

    def take_state(self) -> dict[str, np.ndarray]:
        """Copy the whole state to the host."""
        return take_state(self.arrays)

    def put_state(self, state: dict[str, np.ndarray]) -> None:
        """Put a state of the same scene back."""
        if put_state(self.arrays, state):
            self._programs.clear()
        self.steps_done = int(state["flags.steps_done"][0])

    def _play(self, stepping: bool) -> None:
        """Renew the lists and, if ``stepping``, step; stops early where a list had no room, with room when played again."""
        flags = self.arrays.flags
        flags.running.fill_(1)
        flags.proceed.fill_(1)
        flags.stepping.fill_(int(stepping))
        try:
            self._program(record_run)()
        finally:  # also where it has been broken off
            self.steps_done = int(flags.steps_done.numpy()[0])
        fault = int(flags.fault.numpy()[0])
        flags.fault.zero_()
        if fault & (FAULT_NOT_FINITE | FAULT_TOO_FAST):
            raise UnstableError(self._describe_fault())
        if fault & FAULT_ROOM:
            self.arrays.make_room()
            self._programs.clear()

    def _describe_fault(self) -> str:
        """The worst grain after a fault."""
        grains, dt = self.arrays.grains, self.arrays.setting.dt
        active = grains.active.get()
        radius = grains.place.numpy()[:active, 3] * self.arrays.lattice.quantum
        speed = np.linalg.norm(grains.motion.numpy()[:active, :3].astype(float), axis=1)
        share = np.where(radius > 0.0, speed * dt / np.maximum(radius, self.arrays.lattice.quantum), 0.0)
        worst = int(np.argmax(np.where(np.isfinite(share), share, np.inf)))
        name = f"grain {grains.identity.numpy()[worst]}"
        if not np.isfinite(share[worst]):
            return f"the velocity of {name} is not finite"
        return f"{name} moves by {share[worst]:.2g} of its radius in one step, at {speed[worst]:.3g} m/s; half is the limit"

    def _program(self, record):
        """The recorded program, recorded at its first use since the arrays were last replaced."""
        if record not in self._programs:
            arrays, stages = self.arrays, self.stages  # the program must not hold the solver, which holds it
            steps = arrays.flags.steps_done
            self._programs[record] = self.device.record(lambda recorder: record(arrays, stages, recorder), steps)
        return self._programs[record]
