"""Border 1, the Scene: everything that never changes while a world runs. SI units, REP-103 axes (x forward, z up)."""

from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import numpy as np

from sand_sim.contact.model import ContactModel
from sand_sim.integrator import VERLET
from sand_sim.scene.motion import Motion

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w as in geometry_msgs
ROUGH, SMOOTH = "rough", "smooth"  # whether grains touch a tool's particles or its true surface
SHEETS = "auto", "never", "always"  # whether open parts of a mesh are sheets, as the sampler takes it; others are closed


class SceneError(ValueError):
    """A scene that cannot be simulated; the message names the field and how to mend it."""


@dataclass(frozen=True)
class Material:
    """What a body is made of."""

    name: str
    density: float  # [kg/m^3]
    young: float  # [Pa]
    poisson: float  # [1]


@dataclass(frozen=True)
class PairRule:
    """How two materials meet; valid both ways round."""

    between: tuple[str, str]
    numbers: dict[str, float]  # [units in ``contact.law.ASKS``] by name, those that the contact laws ask for and perhaps more


@dataclass(frozen=True)
class SizeDistribution:
    """Grain radii, by number.

    ``kind`` is ``constant`` (radius = mean), ``uniform`` (low to high), ``normal`` (mean and deviation, cut off at low and
    high) or ``table`` (radii drawn with the given weights).
    """

    kind: str
    mean: float = 0.0  # [m]
    deviation: float = 0.0  # [m]
    low: float = 0.0  # [m]
    high: float = 0.0  # [m]
    radii: tuple[float, ...] = ()  # [m]
    weights: tuple[float, ...] = ()  # [1]


@dataclass(frozen=True)
class Fill:
    """Grains put into a box-shaped region, or read from a file.

    By ``count``, by ``height`` (of the bed above the region's floor once it has settled), or from ``file``. The ``shape`` is
    ``sphere``, ``tetrahedron`` (four spheres) or the path of a clump file; sizes are those of spheres of the same volume.
    """

    name: str
    material: str
    shape: str | Path = "sphere"
    size: SizeDistribution | None = None
    low: Vector | None = None  # [m]
    high: Vector | None = None  # [m]
    count: int | None = None
    height: float | None = None  # [m]
    file: Path | None = None
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s]
    seed: int = 0


@dataclass(frozen=True)
class Pose:
    """Position [m] and orientation (unit quaternion, x y z w) of a frame in the world frame."""

    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Rough:
    """Virtual spheres that make a boundary rough; their centres lie on its surface."""

    radius: float  # [m]
    spacing: float  # [m] of neighbours in a row
    lattice: str = "triangular"  # or square; on surfaces of revolution the rows are rings


@dataclass(frozen=True)
class Drive:
    """How a plunger moves along its normal from time zero on: at a velocity, or as a mass that is pressed by a force."""

    velocity: float = 0.0  # [m/s] towards the grains if positive; not used with a force
    force: float | None = None  # [N] towards the grains, all but that of the grains themselves
    mass: float | None = None  # [kg] that the force moves; None means that of all grains
    max_speed: float = 0.0  # [m/s] of the mass, either way
    travel: float = inf  # [m] farthest from where it starts, either way; there it stops


@dataclass(frozen=True)
class Terrain:
    """Ground made from a mesh or from a grid of heights, in the frame of ``pose``."""

    particle_radius: float  # [m]
    mesh: str = ""
    heights: Path | None = None
    spacing: float = 0.0  # [m] of the grid
    contact: str = ROUGH  # or SMOOTH
    scale: float = 1.0  # [m per unit] of the mesh, or of the heights
    thickness: float | None = None  # [m] of sheets in the mesh; None: two particle radii
    sheets: str = "auto"  # of the mesh, which open components are sheets
    pose: Pose = Pose()


@dataclass(frozen=True)
class Boundary:
    """A wall.

    ``plane`` (half space), ``box`` (grains inside, sides may be open), ``bin`` (a box whose sides end at its edges, solid both
    ways), ``cylinder`` (grains inside if it has no end, solid both ways if it has a height), ``cone`` and ``hole_plate`` (with a
    hole about the axis, solid both ways), ``plunger`` (a plane or disc that moves along its normal) or ``terrain``.
    """

    kind: str
    material: str
    name: str
    point: Vector = (0.0, 0.0, 0.0)  # [m] of the plane, or on the axis: foot of the cylinder, middle of the hole or disc
    direction: Vector = (0.0, 0.0, 1.0)  # [1] plane normal towards the grains, or axis; that of a cone points to its wide end
    radius: float = 0.0  # [m] of the cylinder, of the wide end, of the plate; zero for a plunger without edge
    hole_radius: float = 0.0  # [m]
    height: float = 0.0  # [m] along the axis; zero for a cylinder without end
    around: bool = False  # whether fills go around a cylinder or cone, as of a pillar or a roof, not into it
    low: Vector | None = None  # [m]
    high: Vector | None = None  # [m]
    open_sides: tuple[str, ...] = ()
    rough: Rough | None = None
    drive: Drive | None = None
    terrain: Terrain | None = None


@dataclass(frozen=True)
class Waypoint:
    """A pose that a tool has at a time [s] of its trajectory, the name of the phase that ends there, and how it gets there."""

    time: float
    pose: Pose
    phase: str = ""
    motion: Motion | None = None  # None: evenly


@dataclass(frozen=True)
class Body:
    """A free rigid body: from a mesh, a clump file or a list of spheres, all given in the body's own frame.

    Mass and inertia are those of the solid at the material's density unless given; a given inertia is about the axes of the
    body's own frame, which then must be principal.
    """

    name: str
    material: str
    mesh: str | None = None
    particle_radius: float = 0.0  # [m] of the particles that make the mesh's skin
    scale: float = 1.0
    thickness: float | None = None  # [m] of sheets modelled as surfaces; None: two particle radii
    sheets: str = "auto"  # one of SHEETS
    spheres: Path | tuple[tuple[float, ...], ...] | None = None  # x y z radius [m]
    pose: Pose = field(default_factory=Pose)
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s] of the centre of mass
    spin: Vector = (0.0, 0.0, 0.0)  # [rad/s] world frame
    mass: float | None = None  # [kg]
    inertia: Vector | None = None  # [kg m^2] principal moments


@dataclass(frozen=True)
class Tool:
    """A driven rigid body: grains touch particles sampled from a mesh, or the mesh itself, which may be a link of a robot."""

    name: str
    mesh: str  # empty for a link
    material: str
    particle_radius: float  # [m]
    urdf: str = ""  # file of the link; empty: the description that the scene is given
    link: str = ""
    particle_spacing: float | None = None  # [m]; None: chosen from radius and grains
    contact: str = ROUGH  # or SMOOTH
    scale: float = 1.0  # [m per mesh unit]
    thickness: float | None = None  # [m] of sheets modelled as surfaces; None: two particle radii
    sheets: str = "auto"  # one of SHEETS
    pose: Pose = Pose()
    max_speed: float = 2.0  # [m/s] of any point of the tool; World.apply rejects faster poses, the node slows them
    trajectory: tuple[Waypoint, ...] = ()


@dataclass(frozen=True)
class Liquid:
    """What wets the grains."""

    saturation: float  # [1] share of the pore volume that is liquid
    surface_tension: float = 0.072  # [N/m]
    contact_angle: float = 0.0  # [rad]


@dataclass(frozen=True)
class Solver:
    """Numbers and choices of the time integration; None means chosen from the scene."""

    time_step: float | None = None  # [s]
    skin: float | None = None  # [m]
    integrator: str = VERLET
    precision: str = "single"
    device: str = "auto"
    threads: int | None = None
    force_time_step: bool = False  # run with the given time step however large it is


@dataclass(frozen=True)
class Settle:
    """Let the grains come to rest before time zero, with all tools at their initial poses."""

    time: float = 0.0  # [s] at most
    speed: float = 0.01  # [m/s] root mean square below which the bed counts as settled
    fall: float | None = None  # [m/s] fastest that grains fall meanwhile, as in a liquid; None: chosen; infinite: freely


@dataclass(frozen=True)
class Scene:
    """A whole scene, checked."""

    name: str
    materials: tuple[Material, ...]
    pairs: tuple[PairRule, ...]
    fills: tuple[Fill, ...]
    boundaries: tuple[Boundary, ...] = ()
    tools: tuple[Tool, ...] = ()
    bodies: tuple[Body, ...] = ()
    gravity: Vector = (0.0, 0.0, -9.81)  # [m/s^2]
    domain: tuple[Vector, Vector] | None = None  # [m] corners; grains that leave it are retired
    contact: ContactModel = field(default_factory=ContactModel)
    liquid: Liquid | None = None
    solver: Solver = Solver()
    settle: Settle = Settle()
    duration: float = 1.0  # [s] played by ``sand_sim run``
    frame_rate: float = 50.0  # [1/s] observations per simulated second
    folder: Path = field(default_factory=Path.cwd)  # relative paths start here
    robot_description: str = ""  # content of a URDF, of which tools are links
    mesh_roots: tuple[str, ...] = ("",)  # folders for meshes of robot descriptions, see ``sand_sim.assembly.mesh_roots``

    def material_index(self, name: str) -> int:
        """Index of a material in ``materials``."""
        return [m.name for m in self.materials].index(name)

    def pair(self, a: str, b: str) -> PairRule:
        """The rule for two materials, whichever way round it was given."""
        return next(rule for rule in self.pairs if set(rule.between) == {a, b})

    def tool(self, name: str) -> Tool:
        """A tool by its name."""
        return next(tool for tool in self.tools if tool.name == name)


def unit(vector: Vector) -> np.ndarray:
    """The vector at length one, shape (3,)."""
    array = np.asarray(vector, float)
    return array / np.linalg.norm(array)
