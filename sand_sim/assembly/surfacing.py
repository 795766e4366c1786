"""From the walls of a scene to the surfaces and plungers of the engine."""

from math import ceil, floor, pi, sqrt

import numpy as np

from sand_sim.engine.lattice import Lattice
from sand_sim.engine.plungers import Plunger
from sand_sim.engine.recipe import CYLINDER, PANEL, PLANE, PLUNGER, ROUGH, SHELL
from sand_sim.engine.surfaces import BOTH_SIDES, KINDS, NEAR_SIDE, NO_SIDE, Surface
from sand_sim.scene.types import SceneError
from sand_sim.scene.walls import Wall, tangents

_MOST_NUMBERS = 2**31 - 1
_SAME = 1e-6  # of a radius: rings nearer than that are one
_DEEPEST_GAP = 0.9  # of the sum of radii: half the width of the gaps between virtual spheres
_LIGHTEST = 0.05  # of the mass of all grains


def kinds_of(walls: list[Wall]) -> frozenset[str]:
    """What the kernels must know of the walls, for ``Recipe.surfaces``."""
    kinds = {wall.kind for wall in walls}
    kinds |= {ROUGH for wall in walls if wall.rough} | {PLUNGER for wall in walls if wall.drive}
    return frozenset(kinds)


def make_surfaces(
    walls: list[Wall], order: list[str], lattice: Lattice, smallest: float, plungers: list[Plunger]
) -> list[Surface]:
    """Surfaces in the order of the walls.

    Args:
        walls: of the scene.
        order: names of the materials.
        lattice: the domain.
        smallest: grain radius [m].
        plungers: from ``make_plungers``.

    Raises:
        SceneError: if the virtual spheres of a rough wall are too many, or leave gaps for grains to fall through.
    """
    surfaces, numbers, moving = [], 0, 0
    for index, wall in enumerate(walls):
        surface = Surface()
        surface.kind = KINDS[wall.kind]
        surface.material = order.index(wall.material)
        surface.plunger = moving if wall.drive else -1
        if wall.drive:
            surface.ease = plungers[moving].pressed / plungers[moving].mass
            moving += 1
        surface.first = numbers
        surface.anchor = np.rint((wall.point - lattice.centre) / lattice.quantum)
        surface.direction = wall.direction
        surface.across = tangents(wall.direction)[0]
        if wall.kind == CYLINDER:
            surface.begin = surface.end = np.array([wall.radius, 0.0]) / lattice.quantum
        if wall.kind == SHELL:
            surface.begin, surface.end = wall.begin / lattice.quantum, wall.end / lattice.quantum
            surface.beyond_begin, surface.answers_begin = _joint(walls, index, at_begin=True)
            surface.beyond_end, surface.answers_end = _joint(walls, index, at_begin=False)
        if wall.kind == PANEL:
            surface.begin, surface.end = wall.begin / lattice.quantum, wall.end / lattice.quantum
            surface.joined, surface.answers = wall.joined, wall.answers
        taken = 2 if wall.kind == SHELL else 1  # its sides
        if wall.rough:
            _check_gaps(wall, smallest)
            taken = _lay_spheres(surface, wall, lattice)
        numbers += taken
        if numbers > _MOST_NUMBERS:
            raise SceneError(f"boundaries: '{wall.name}' has too many virtual spheres; raise rough.spacing or narrow 'domain'")
        surfaces.append(surface)
    return surfaces


def make_plungers(walls: list[Wall], mass: float) -> list[Plunger]:
    """Plungers in the order of the walls that move.

    Args:
        walls: of the scene.
        mass: of all grains [kg].

    Raises:
        SceneError: if one is so light that the time step, made for the contacts of single grains, would not resolve its motion.
    """
    plungers = []
    for wall in walls:
        if not wall.drive:
            continue
        drive, one = wall.drive, Plunger()
        one.mass = mass if drive.mass is None else drive.mass
        if drive.force is not None and one.mass < _LIGHTEST * mass:
            raise SceneError(
                f"boundaries: mass of '{wall.name}', {one.mass:.3g} kg, is so small against that of the grains that they would "
                f"make it rattle; give at least {_LIGHTEST * mass:.3g} kg, or leave it out to take the grains', {mass:.3g} kg"
            )
        one.pressed, one.velocity, one.force = int(drive.force is not None), drive.velocity, drive.force or 0.0
        one.max_speed, one.travel = drive.max_speed, min(drive.travel, 1e30)
        plungers.append(one)
    return plungers


def _joint(walls: list[Wall], index: int, at_begin: bool) -> tuple[np.ndarray, int]:
    """How a shell's line goes on beyond one of its ends, and on which sides the shell answers there; see ``Surface``."""
    wall = walls[index]
    here, there = (wall.begin, wall.end) if at_begin else (wall.end, wall.begin)
    if here[0] == 0.0:  # the line ends on the axis, and goes on as its own mirror image
        beyond = np.array([here[0] - there[0], there[1] - here[1]])
        return beyond / np.linalg.norm(beyond), NEAR_SIDE
    for other_index, other in enumerate(walls):
        along = float(other.direction @ wall.direction)
        if other is wall or other.kind != SHELL or abs(along) < 1.0 - 1e-9 or other.rough != wall.rough:
            continue
        if other.drive or wall.drive:
            continue
        for meets, leads in ((other.begin, other.end), (other.end, other.begin)):
            middles = wall.point + here[1] * wall.direction - other.point - meets[1] * other.direction
            if np.linalg.norm(middles) + abs(here[0] - meets[0]) < _SAME * here[0]:
                beyond = (leads - meets) * np.array([1.0, np.sign(along)])
                return beyond / np.linalg.norm(beyond), BOTH_SIDES if index < other_index else NO_SIDE
    return np.zeros(2), BOTH_SIDES


def _check_gaps(wall: Wall, smallest: float) -> None:
    """See that no grain falls through: the middle of the widest gap must be well within reach of the spheres around it."""
    rough = wall.rough
    straight = rough.lattice == "triangular" and wall.kind == PLANE
    share = 1.0 / sqrt(3.0) if straight else 1.0 / sqrt(2.0)
    most = _DEEPEST_GAP * (smallest + rough.radius) / share
    if rough.spacing > most:
        raise SceneError(
            f"boundaries: rough.spacing of '{wall.name}', {rough.spacing:g} m, leaves gaps for grains of radius "
            f"{smallest:g} m to fall through; give at most {most:.3g} m"
        )


def _lay_spheres(surface: Surface, wall: Wall, lattice: Lattice) -> int:
    """Set the lattice of a rough surface, wide enough for the domain; returns how many numbers its spheres take."""
    rough, triangular = wall.rough, wall.rough.lattice == "triangular"
    spacing = rough.spacing / lattice.quantum
    row_spacing = spacing * sqrt(0.75) if triangular else spacing
    surface.ball, surface.spacing, surface.row_spacing = rough.radius / lattice.quantum, spacing, row_spacing
    surface.stagger = 0.5 if triangular else 0.0
    reach = 0.5 * (lattice.high - lattice.low) / lattice.quantum

    def span(axis: np.ndarray, step: float) -> tuple[int, int]:
        """First and last multiple of a step that matter along an axis through the anchor."""
        middle, half = -float(surface.anchor @ axis), float(reach @ np.abs(axis))
        return floor((middle - half) / step) - 2, ceil((middle + half) / step) + 2

    across, beside = tangents(wall.direction)
    if wall.kind == PLANE:
        surface.first_column, last_column = span(across, spacing)
        first_row, last_row = span(beside, row_spacing)
        first_row -= first_row % 2
        surface.first_row, surface.columns = first_row, last_column - surface.first_column + 1
        surface.rows = last_row - first_row + 1
        return surface.rows * surface.columns
    if wall.kind == CYLINDER:
        first_row, last_row = span(wall.direction, row_spacing)
        first_row -= first_row % 2
        surface.begin = np.array([wall.radius / lattice.quantum, first_row * row_spacing])
        surface.end = np.array([wall.radius / lattice.quantum, last_row * row_spacing])
        surface.rows = last_row - first_row + 1
        surface.answers_begin = surface.answers_end = BOTH_SIDES
    else:
        surface.rows = ceil(float(np.linalg.norm(wall.end - wall.begin)) / (row_spacing * lattice.quantum) - 1e-9) + 1
    widest = max(float(surface.begin[0]), float(surface.end[0]))
    surface.columns = ceil(2.0 * pi * widest / spacing) + 1
    return surface.rows * surface.columns
