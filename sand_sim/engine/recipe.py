"""What a scene needs from the kernels. Choices here are static: another choice is another kernel, compiled without the rest."""

from dataclasses import dataclass, field

from sand_sim.contact.model import ContactModel
from sand_sim.integrator import VERLET
from sand_sim.precision import SINGLE, Precision

PLANE, CYLINDER, SHELL, PANEL = "plane", "cylinder", "shell", "panel"
ROUGH, PLUNGER = "rough", "plunger"


@dataclass(frozen=True)
class Recipe:
    """Static choices of a world.

    Attributes:
        contact: one law per slot.
        precision: number types.
        materials: grains are of more than one material.
        bodies: some grains are rigid bodies of several spheres.
        pushed: some of them may be pushed from outside.
        integrator: one of ``integrator.INTEGRATORS``.
        smooth_tools: grains touch the true surfaces of some tools, not their particles.
        surfaces: kinds of walls: ``plane``, ``cylinder``, ``shell``, ``panel``; and whether some are ``rough`` or a ``plunger``.
        carry: steps are so short that what rounding takes off velocities must be carried over to the next step.
    """

    contact: ContactModel = field(default_factory=ContactModel)
    precision: Precision = SINGLE
    materials: bool = False
    bodies: bool = False
    pushed: bool = False
    integrator: str = VERLET
    smooth_tools: bool = False
    surfaces: frozenset[str] = frozenset()
    carry: bool = False

    @property
    def rotation(self) -> bool:
        """Whether grains turn."""
        return self.bodies or self.contact.rotation

    @property
    def springs(self) -> bool:
        """Whether contacts have springs that grow by how grains move and turn."""
        return self.contact.springs

    @property
    def halves(self) -> bool:
        """Whether springs grow by velocities of half steps that are kept beside those of now."""
        return self.springs and self.integrator == VERLET

    @property
    def history(self) -> bool:
        """Whether contacts remember."""
        return self.contact.history
