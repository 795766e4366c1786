"""From a checked Scene to the arrays of a solver: the only place that knows both."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sampler.cores import available_cores
from sand_sim.assembly.body_model import BodyModel, lighten, model_body
from sand_sim.assembly.domain import make_lattice
from sand_sim.assembly.surfacing import kinds_of, make_plungers, make_surfaces
from sand_sim.assembly.terrain import Ground, model_ground
from sand_sim.assembly.tool_model import Progress, ToolModel, model_tool
from sand_sim.engine.arrays import DemArrays, Setting
from sand_sim.engine.device import open_device
from sand_sim.engine.explicit_dem import ExplicitDem
from sand_sim.engine.lattice import Lattice
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.tool_body import ToolBody
from sand_sim.grain_table import GrainTable
from sand_sim.precision import PRECISIONS, Precision
from sand_sim.scene.checking import check_scene, odd_numbers, unused_numbers
from sand_sim.scene.filling import fill_grains, own_frames, smallest_of_materials, smallest_sphere
from sand_sim.scene.pairing import pair_numbers
from sand_sim.scene.stable_step import DEEP
from sand_sim.scene.time_step import TimeStep, choose_time_step, fastest_speed, loses_digits
from sand_sim.scene.types import Scene, SceneError
from sand_sim.scene.walls import Wall, walls_of
from sand_sim.tool_motion.playing import check_trajectory, pose_times

_SKIN = 0.25  # of the mean grain radius
_SPHERES_PER_THREAD = 1000
_CROWDED = 2  # threads per core at most, enough to try whether results depend on their number
_FLOOR = 0.05  # a plane whose normal points up by at least this much is a floor


@dataclass(frozen=True)
class Assembly:
    """A scene ready to run.

    Attributes:
        scene: what it was made from.
        light: the same as the time step must see it, see ``body_model.lighten``.
        fill_numbers: grains of each fill; their identities follow one another, those of the bodies come last.
        table: grains and bodies as the scene places them.
        own_frames: of the clumps' files, to their principal frames, shape (bodies, 4); no rotation for the scene's bodies.
        walls: analytic surfaces.
        tools: in the order of the scene.
        bodies: in the order of the scene.
        grounds: terrains, which the solver has as bodies after the tools.
        smallest: smallest sphere that each grain material has, or could have had by chance [m].
        finest: smallest sphere that the fills can bring, none of which passes tools or gets into bodies [m]; None without any.
        time_step: chosen, with its reasons.
        frame_steps: steps per frame.
        lattice: the domain.
        recipe: static choices.
        pair_table: ``MaterialPair`` structs, one row per material.
        plungers: how the walls that move are driven.
        solver: holds the device arrays.
    """

    scene: Scene
    light: Scene
    fill_numbers: list[int]
    table: GrainTable
    own_frames: np.ndarray
    walls: list[Wall]
    tools: list[ToolModel]
    bodies: list[BodyModel]
    grounds: list[Ground]
    smallest: dict[str, float]
    finest: float | None
    time_step: TimeStep
    frame_steps: int
    lattice: Lattice
    recipe: Recipe
    pair_table: list[list]
    plungers: list
    solver: ExplicitDem

    @cached_property
    def grain_of_sphere(self) -> np.ndarray:
        """Grain of each sphere of the table, shape (n,), int."""
        return self.table.grain

    @cached_property
    def lone_grain(self) -> np.ndarray:
        """Whether a grain is a single sphere, shape (grains,)."""
        alone = np.zeros(self.table.grains, bool)
        alone[self.grain_of_sphere[self.table.lone]] = True
        return alone

    @cached_property
    def grain_of_body(self) -> np.ndarray:
        """Grain that each body is, shape (bodies,), int."""
        return np.flatnonzero(~self.lone_grain)

    @cached_property
    def body_extent(self) -> np.ndarray:
        """Farthest a body reaches from its centre of mass, shape (bodies,) [m]."""
        table, extent = self.table, np.zeros(len(self.table.bodies))
        np.maximum.at(extent, table.body[~table.lone], (np.linalg.norm(table.offset, axis=1) + table.radius)[~table.lone])
        return extent

    @property
    def mesh_warnings(self) -> dict[str, tuple[str, ...]]:
        """What the sampler had to mend or guess, by the labels of the meshes; without those of which all was well.

        Doubts about a mass are left out for tools and terrains, which have none that counts.
        """
        told = {one.label: one.body.warnings for one in (*self.tools, *self.grounds)}
        told |= {one.label: one.warnings for one in self.bodies}
        return {label: warnings for label, warnings in told.items() if warnings}

    @property
    def warnings(self) -> list[str]:
        """What the user should know before the run."""
        meshes = [f"{label}: {text}" for label, texts in self.mesh_warnings.items() for text in texts]
        threads, cores = self.scene.solver.threads or 0, available_cores()
        waiting = f"solver.threads: {threads} on {cores} cores wait for one another; ask for at most {cores}"
        told = [self.time_step.warning, waiting if threads > cores else ""]
        return [*filter(None, told), *odd_numbers(self.scene), *unused_numbers(self.scene), *meshes]

    def safe_step(self, speed: float, depth: float) -> float:
        """The step [s] that would be safe at a top speed [m/s] and an overlap over radius [1]."""
        free = replace(self.light, solver=replace(self.light.solver, time_step=None))
        spacings, speed = _rough_spacings(self.tools, self.grounds), max(speed, self.time_step.speed)
        return choose_time_step(free, self.smallest, speed, spacings, self.table.total_mass, max(depth, DEEP)).safe


def assemble(scene: Scene, progress: Progress = lambda stage, share: None) -> Assembly:
    """Make grains, walls, tools and the solver of a scene.

    Args:
        scene: from a file or made in Python.
        progress: called with the name of a stage and the share of it that is done, 0 to 1.

    Raises:
        SceneError: if parts do not fit together, or a mesh, a fill or the time step cannot be used; the message names the field.
    """
    check_scene(scene)  # again: ``dataclasses.replace`` may have changed it since it was read
    finest = smallest_sphere(scene.fills) if scene.tools or scene.bodies else None
    tools = [model_tool(tool, scene, finest, progress) for tool in scene.tools]
    for model in tools:
        check_trajectory(model.tool, model.reach, pose_times(scene, 0.0, 1.0 / scene.frame_rate)[0])
    grounds = [
        model_ground(one, scene.folder, lambda share, name=one.name: progress(f"sampling {name}", share))
        for one in scene.boundaries
        if one.terrain
    ]
    walls = [wall for boundary in scene.boundaries for wall in walls_of(boundary)]
    order = material_order(scene)
    bodies = [model_body(body, scene, finest, progress) for body in scene.bodies]
    solids = [*walls, *tools, *grounds, *bodies]
    fills: list[GrainTable] = []
    for fill in scene.fills:
        material = scene.materials[scene.material_index(fill.material)]
        others = [(one.name, table) for one, table in zip(scene.fills, fills, strict=False)]
        fills.append(fill_grains(fill, material, order.index(fill.material), solids, others))
    table = GrainTable.join([*fills, *(body.table(order.index(body.body.material)) for body in bodies)])
    device = _open_device(scene, len(table))
    smallest = smallest_of_materials(scene.fills, table, order)
    light = lighten(scene, table, order)
    time_step, frame_steps = _time_step(light, table, smallest, walls, tools, grounds)
    precision = PRECISIONS[scene.solver.precision]
    lattice = make_lattice(scene, table, walls, tools, grounds, precision)
    recipe = Recipe(
        contact=scene.contact,
        precision=precision,
        integrator=scene.solver.integrator,
        materials=len(_loose_materials(scene)) > 1,
        bodies=len(table.bodies) > 0,
        pushed=len(bodies) > 0,
        smooth_tools=any(one.smooth for one in (*tools, *grounds)),
        surfaces=kinds_of(walls),
        carry=loses_digits(scene, time_step, precision, smallest, _fastest_rim(table)),
    )
    mean = float(table.radius.mean())
    skin, radius = (scene.solver.skin, 0.0) if scene.solver.skin else (_SKIN * mean, mean)
    setting = Setting(np.asarray(scene.gravity), time_step.value, skin, radius)
    assembly = Assembly(
        scene,
        light,
        [fill.grains for fill in fills],
        table,
        own_frames(scene.fills, fills, len(table.bodies)),
        walls,
        tools,
        bodies,
        grounds,
        smallest,
        finest,
        time_step,
        frame_steps,
        lattice,
        recipe,
        _pair_table(scene, order, precision),
        make_plungers(walls, table.total_mass),
        solver=None,
    )
    return replace(assembly, solver=build_solver(assembly, setting, device, progress))


def build_solver(assembly: Assembly, setting: Setting, device, progress: Progress = lambda stage, share: None) -> ExplicitDem:
    """A solver for an assembly that is complete but for its own.

    Args:
        assembly: what it runs; its grains start where the table has them.
        setting: its numbers; the reach is found here.
        device: from ``open_device``.
        progress: called with the name of a stage of the preparation and the share of it that is done, 0 to 1.

    Raises:
        SceneError: if the walls cannot hold the grains.
    """
    scene, table, order = assembly.scene, assembly.table, material_order(assembly.scene)
    arrays = DemArrays(
        assembly.recipe,
        replace(setting, reach=_reach(scene, order)),
        assembly.lattice,
        table,
        make_surfaces(assembly.walls, order, assembly.lattice, min(assembly.smallest.values()), assembly.plungers),
        [_tool_body(tool, tool.tool.material, order) for tool in assembly.tools]
        + [_tool_body(ground, ground.material, order) for ground in assembly.grounds],
        assembly.pair_table,
        device,
        assembly.plungers,
        [model.lever for model in assembly.bodies],
    )
    return ExplicitDem(arrays, device, progress)


def _open_device(scene: Scene, spheres: int):
    """The scene's device. A small scene gets few threads: more would wait for each other longer than they work.

    However many the user asks for, they are bounded by the cores: far more threads than cores all but stand still.
    """
    cores = available_cores()
    threads = min(scene.solver.threads or min(cores, 1 + spheres // _SPHERES_PER_THREAD), _CROWDED * cores)
    try:
        return open_device(scene.solver.device, threads)
    except ValueError as error:
        raise SceneError(f"solver.device: {error}") from None


def _rough_spacings(tools: list[ToolModel], grounds: list[Ground]) -> list[float]:
    return [one.body.spacing for one in (*tools, *grounds) if not one.smooth]


def _tool_body(model: ToolModel | Ground, material: str, order: list[str]) -> ToolBody:
    return ToolBody(model.body.points, model.body.radius, order.index(material), model.surface)


def _loose_materials(scene: Scene) -> set[str]:
    """Names of the materials of everything that moves freely."""
    return {one.material for one in (*scene.fills, *scene.bodies)}


def material_order(scene: Scene) -> list[str]:
    """Names of the materials, those of grains first, so that with one grain material its index is zero."""
    grains = _loose_materials(scene)
    return sorted((m.name for m in scene.materials), key=lambda name: name not in grains)


def _fastest_rim(table: GrainTable) -> float:
    """Fastest that a sphere turns at the start, at its rim [m/s]."""
    return float((np.linalg.norm(table.spin, axis=1) * table.radius).max())


def _time_step(
    scene: Scene,
    table: GrainTable,
    smallest: dict[str, float],
    walls: list[Wall],
    tools: list[ToolModel],
    grounds: list[Ground],
) -> tuple[TimeStep, int]:
    """The step, shortened so that a whole number of steps makes a frame unless the scene gives it, and that number."""
    given = float(np.linalg.norm(table.velocity, axis=1).max())
    speed = fastest_speed(scene, fall_height(scene, table, walls, grounds), given)
    chosen = choose_time_step(scene, smallest, speed, _rough_spacings(tools, grounds), table.total_mass)
    frame = 1.0 / scene.frame_rate
    if scene.solver.time_step is not None:
        return chosen, max(1, round(frame / chosen.value))
    steps = int(np.ceil(frame / chosen.value))
    return replace(chosen, value=frame / steps), steps


def fall_height(scene: Scene, table: GrainTable, walls: list[Wall], grounds: list[Ground]) -> float:
    """How far a grain can fall at most, past the lowest grain or on to a floor [m]."""
    down = np.asarray(scene.gravity) / (np.linalg.norm(scene.gravity) or 1.0)
    heights = [float(np.ptp(table.position @ down))]
    for wall in walls:
        steepness = -float(wall.direction @ down)
        if wall.kind == "plane" and steepness > _FLOOR:
            heights.append(float((wall.distance(table.position) - table.radius).max()) / steepness)
    highest = float((table.position @ down).min())
    boxes = [wall.corners for wall in walls] + [ground.mesh.bounds + ground.place for ground in grounds]
    heights += [float(np.maximum(*(box * down)).sum()) - highest for box in boxes if box is not None]
    return max(heights)


def _pair_table(scene: Scene, order: list[str], precision: Precision) -> list[list]:
    """One ``MaterialPair`` per pair of materials; pairs that never meet stay empty."""
    struct = scene.contact.types(precision).pair
    table = []
    for a in order:
        row = []
        for b in order:
            pair, numbers = struct(), pair_numbers(scene, a, b)
            if numbers:
                for law in scene.contact.laws.values():
                    for name, value in law.prepare(numbers).items():
                        setattr(pair, name, value)
            row.append(pair)
        table.append(row)
    return table


def _reach(scene: Scene, order: list[str]) -> Callable[[float], float]:
    """Widest gap [m] across which any contact acts of which the smaller sphere has at most a radius [m]."""
    law = scene.contact.law("cohesion")
    if scene.contact.cohesion == "none":
        return lambda radius: 0.0
    pairs = [numbers for a in order for b in order if (numbers := pair_numbers(scene, a, b))]
    # The effective radius is half of that where two are alike, and all of it at a wall.
    return lambda radius: max(law.reach(pair, radius, share * radius) for pair in pairs for share in (0.5, 1.0))
