"""Border 2, Command and Observation: all that passes between a world and ROS, Rerun, tests and the command line.

Positions and directions are in the world frame (z up, REP-103) unless said otherwise; orientations are unit quaternions x y z w.
"""

from dataclasses import dataclass

import numpy as np

from sand_sim.showing import shown

_LONGEST_MESSAGE = 400  # letters: whatever a stranger sends ends up in logs and diagnostics


class CommandError(ValueError):
    """A command that was rejected; the world goes on as before.

    Args:
        reason: a short word for counting rejections.
        message: what is wrong; cut where it is long, and with a question mark for what cannot be printed.
    """

    def __init__(self, reason: str, message: str):
        super().__init__(shown(message, _LONGEST_MESSAGE))
        self.reason = reason


@dataclass(frozen=True)
class ToolPose:
    """Command: a tool shall have reached a pose at a time, moving there evenly from where it is then.

    Attributes:
        tool: name.
        position: of the tool frame's origin, shape (3,) [m].
        orientation: tool frame to world frame, shape (4,).
        time: when it is reached [s] of simulated time; None leaves it to the pacing (see ``simulation.py``).
    """

    tool: str
    position: np.ndarray
    orientation: np.ndarray
    time: float | None = None


@dataclass(frozen=True)
class ToolVelocity:
    """Command: a tool shall move with a velocity for a while.

    Attributes:
        tool: name.
        linear: of the tool frame's origin, shape (3,) [m/s].
        angular: shape (3,) [rad/s].
        in_tool_frame: whether both are given in the tool frame as it is when the command begins, else in the world frame.
        time: until when [s] of simulated time in lockstep; otherwise only for the order of commands (``courses.py``).
    """

    tool: str
    linear: np.ndarray
    angular: np.ndarray
    in_tool_frame: bool = False
    time: float | None = None


@dataclass(frozen=True)
class Frame:
    """A coordinate frame in another one, as TF tells it.

    Attributes:
        name: of the frame.
        parent: name of the frame it is given in.
        position: of its origin, parent frame, shape (3,) [m].
        orientation: frame to parent frame, shape (4,).
        time: when it was there [s]; None if it always is.
    """

    name: str
    parent: str
    position: np.ndarray
    orientation: np.ndarray
    time: float | None = None


@dataclass(frozen=True)
class GrainCloud:
    """All grains that are in the domain, in the order of their identities.

    Attributes:
        identity: number of the grain in the scene, shape (n,), int.
        position: shape (n, 3) [m], double.
        velocity: shape (n, 3) [m/s].
        spin: shape (n, 3) [rad/s]; zeros where grains do not turn.
        radius: shape (n,) [m]; of a rigid body, of the sphere about its centre of mass that holds it.
        mass: shape (n,) [kg].
        orientation: frame of a clump's file, or principal frame of a body, to world frame, shape (n, 4); for spheres none.
    """

    identity: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    radius: np.ndarray
    mass: np.ndarray
    orientation: np.ndarray

    def __len__(self) -> int:
        return len(self.identity)

    @property
    def speed(self) -> np.ndarray:
        """Speeds, shape (n,) [m/s]."""
        return np.linalg.norm(self.velocity, axis=1)


@dataclass(frozen=True)
class HeightMap:
    """Heights of the bed over the middles of level, square cells.

    Attributes:
        low: lower corner of the grid, x and y, shape (2,) [m]; the first cell's middle is half a cell further.
        cell: edge of a cell [m].
        heights: rows along y, columns along x, float32, shape (rows, columns) [m]; NaN where nothing is known.
    """

    low: np.ndarray
    cell: float
    heights: np.ndarray


@dataclass(frozen=True)
class ToolReport:
    """What a tool does and feels.

    Attributes:
        name: of the tool.
        position: of its frame's origin now, shape (3,) [m].
        orientation: tool frame to world frame, shape (4,).
        velocity: of the origin over the last step, shape (3,) [m/s].
        spin: over the last step, shape (3,) [rad/s].
        force, torque: of the sand about its frame's origin, means over the frame in axes that turn with it, (3,) [N], [N m].
        world_force, world_torque: the same in the axes of the world, shape (3,) [N], [N m].
        work: of the tool on the sand since the start [J].
        carried: mass of the grains whose centres are inside the tool's bounding box [kg].
        swept: ground below the bed's first surface that it has passed through since the start, in cells a grain wide [m^3].
    """

    name: str
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    world_force: np.ndarray
    world_torque: np.ndarray
    work: float
    carried: float
    swept: float = 0.0


@dataclass(frozen=True)
class ToolContacts:
    """All contacts that act on a tool now, one row each; the sums are the tool's force and torque at this moment.

    Attributes:
        tool: name.
        origin: of the tool's frame, about which torques are meant, shape (3,) [m].
        point: where the contact is, world frame, shape (n, 3) [m].
        normal: unit vector from the tool into the grain, world frame, shape (n, 3) [1].
        force: of the grain on the tool, world frame, shape (n, 3) [N].
        couple: of rolling and twisting resistance on the tool, world frame, zero without, shape (n, 3) [N m].
        overlap: negative where a liquid bridge acts across a gap, shape (n,) [m].
        identity: of the grain, as in ``GrainCloud``, shape (n,) [1].
    """

    tool: str
    origin: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    couple: np.ndarray
    overlap: np.ndarray
    identity: np.ndarray

    def __len__(self) -> int:
        return len(self.identity)

    @property
    def wrench(self) -> np.ndarray:
        """Sum of the forces, and torque about ``origin``, world frame, shape (2, 3) [N], [N m]."""
        torque = np.cross(self.point - self.origin, self.force) + self.couple
        return np.array([self.force.sum(axis=0), torque.sum(axis=0)])


@dataclass(frozen=True)
class GrainContacts:
    """All contacts between grains that act now, one row each, those between spheres of two clumps one by one.

    Attributes:
        first, second: the two grains, as in ``GrainCloud``, shape (n,) [1].
        point, normal, force, couple, overlap: as in ``ToolContacts``; normals into the first, forces and couples on it.
    """

    first: np.ndarray
    second: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray
    couple: np.ndarray
    overlap: np.ndarray

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True)
class BodyReport:
    """Where a free rigid body is and how it moves.

    Attributes:
        name: of the body.
        position: of its frame's origin, shape (3,) [m].
        orientation: body's own frame to world frame, shape (4,).
        velocity: of its centre of mass, shape (3,) [m/s].
        spin: world frame, shape (3,) [rad/s].
        mass: [kg].
    """

    name: str
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    mass: float


@dataclass(frozen=True)
class WallReport:
    """What a wall feels.

    Attributes:
        name: of the boundary, with the side of a box, as in ``bin/bottom``.
        force: of the grains on the wall at the last step, world frame, shape (3,) [N].
        position: of its point now, shape (3,) [m]; that of a terrain is its frame's origin.
        velocity: of a plunger, shape (3,) [m/s]; zero for all others.
    """

    name: str
    force: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class Health:
    """How far a run can be trusted.

    Attributes:
        time_step: [s].
        step_ratio: time step over the safe one [1].
        deepest: largest overlap over grain radius since the start [1].
        kinetic, potential, elastic: energies now [J]; potential against the start.
        tool_work: of all tools and plungers on the sand since the start [J].
        dissipated: what is missing from the balance of the above since the start [J]; negative means energy came from nowhere.
        momentum_residual: force on the grains that comes from no wall, tool or weight, over all their forces [1]; zero but for
            rounding as long as action equals reaction, NaN with an integrator that does not show it.
        fastest: largest speed of the centre of a grain, or of a sphere of a clump or body [m/s].
        contacts: contacts under load.
        retired: grains that have left the domain.
        doubts: why the run should not be trusted, empty if nothing speaks against it.
        gained: energy that appeared from nowhere since the start, by which ``dissipated`` has fallen from its peak [J].
    """

    time_step: float
    step_ratio: float
    deepest: float
    kinetic: float
    potential: float
    elastic: float
    tool_work: float
    dissipated: float
    momentum_residual: float
    fastest: float
    contacts: int
    retired: int
    doubts: tuple[str, ...]
    gained: float = 0.0


@dataclass(frozen=True)
class Observation:
    """What a world shows after a frame.

    Attributes:
        time: simulated [s].
        steps: since the start.
        grains: all grains.
        tools: one report per tool, in the order of their names.
        walls: one report per wall, in the order of the scene, terrains last.
        health: error indicators.
        bodies: one report per free rigid body of the scene that is in the domain.
        spheres: what is drawn: all spheres, those of one body with the same identity. The same as ``grains`` without bodies.
    """

    time: float
    steps: int
    grains: GrainCloud
    tools: tuple[ToolReport, ...]
    walls: tuple[WallReport, ...]
    health: Health
    bodies: tuple[BodyReport, ...]
    spheres: GrainCloud

    def body(self, name: str) -> BodyReport:
        """The report of a free rigid body by its name; ``KeyError`` if there is none in the domain."""
        return _named(name, self.bodies, "body")

    def tool(self, name: str) -> ToolReport:
        """The report of a tool by its name; ``KeyError`` if there is none."""
        return _named(name, self.tools, "tool")

    def wall(self, name: str) -> WallReport:
        """The report of a wall by its name; ``KeyError`` if there is none, or more than one."""
        return _named(name, self.walls, "wall")


def _named(name: str, reports: tuple, kind: str):
    if len(found := [report for report in reports if report.name == name]) == 1:
        return found[0]
    known, number = ", ".join(report.name for report in reports) or "none", "more than one" if found else "no"
    raise KeyError(f"there is {number} {kind} '{name}'; there are {known}")
