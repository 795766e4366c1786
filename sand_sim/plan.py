"""What a scene keeps and leaves out: stages, arrays, kernels, time step and what a run will cost, before it runs."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
import warp as wp

from sand_sim.assembly.assemble import Assembly
from sand_sim.engine.arrays import DemArrays
from sand_sim.engine.device import CpuDevice, CudaDevice, open_device
from sand_sim.engine.explicit_dem import ExplicitDem
from sand_sim.engine.lattice import Lattice
from sand_sim.engine.recipe import Recipe
from sand_sim.engine.survey import list_kernels
from sand_sim.grain_table import GrainTable
from sand_sim.integrator import VERLET
from sand_sim.scene.checking import odd_numbers, unused_numbers
from sand_sim.scene.clumps import place_clumps
from sand_sim.scene.shapes import tetrahedron

_SAMPLE_EDGE = 13  # grains at most along each edge of the packed sample that a cost is measured on
_SAMPLE_STEPS, _SAMPLE_ROUNDS = 12, 10
_OVERLAP = 0.01  # of the diameter, between neighbours in the sample


@dataclass(frozen=True)
class Plan:
    """What a scene comes down to.

    Attributes:
        grains, spheres: numbers.
        kept: stages with when they run.
        tools, terrains: by name, whether grains touch their particles (``rough``) or their true surfaces (``smooth``).
        boxes: lowest and highest corner of each tool's mesh in the tool's frame [m].
        meshes: what the sampler had to mend or guess in the meshes of tools, terrains and bodies, where it had to.
        unused: what the scene gives for contact laws that it has not chosen.
        odd: numbers that are more likely in another unit.
        left_out: what is neither compiled nor allocated, with the reason.
        kernels: names of the compiled kernels.
        arrays: bytes by array.
        bytes_per_sphere: of all of them [B].
        time_step: value and limits [s], and what decides.
        steps: of the scene's duration.
        sphere_step: measured on a packed sample of this scene's recipe on this machine [s]; None if not measured.
        duration: predicted run time of the scene without settling [s]; None if not measured.
    """

    grains: int
    spheres: int
    kept: dict[str, str]
    tools: dict[str, str]
    terrains: dict[str, str]
    boxes: dict[str, list[list[float]]]
    meshes: dict[str, tuple[str, ...]]
    unused: list[str]
    odd: list[str]
    left_out: dict[str, str]
    kernels: list[str]
    arrays: dict[str, int]
    bytes_per_sphere: float
    time_step: dict
    steps: int
    sphere_step: float | None
    duration: float | None


def make_plan(assembly: Assembly, measure: bool = True, check: Callable[[], None] = lambda: None) -> Plan:
    """Plan a scene.

    Args:
        assembly: from ``assemble``, before anything runs.
        measure: run a packed sample of grains for a moment to predict the cost.
        check: called meanwhile; may raise to give up.
    """
    arrays, scene, solver = assembly.solver.arrays, assembly.scene, assembly.solver
    sizes = array_sizes(arrays)
    steps = round(scene.duration / assembly.time_step.value)
    spheres = len(assembly.table)
    cost = measure_cost(assembly, check) if measure else None
    stages = solver.stages
    kept = {s.name: "when a grain has moved as far as its skin allows" for s in stages.listing}
    kept |= {s.name: "when a tool has moved as far as its skin allows" for s in stages.tool_listing}
    kept |= {s.name: "every step" for s in stages.step}
    return Plan(
        grains=assembly.table.grains,
        spheres=spheres,
        kept=kept,
        tools={tool.name: tool.contact for tool in scene.tools},
        terrains={wall.name: wall.terrain.contact for wall in scene.boundaries if wall.terrain},
        boxes={tool.tool.name: tool.mesh.bounds.tolist() for tool in assembly.tools},
        meshes=assembly.mesh_warnings,
        unused=unused_numbers(scene),
        odd=odd_numbers(scene),
        left_out=left_out(assembly),
        kernels=sorted(one.key.rsplit("__", 1)[-1] for one in list_kernels(arrays, solver.stages, solver.device)),
        arrays=sizes,
        bytes_per_sphere=sum(sizes.values()) / spheres,
        time_step=asdict(assembly.time_step),
        steps=steps,
        sphere_step=cost,
        duration=None if cost is None else cost * spheres * steps,
    )


def left_out(assembly: Assembly) -> dict[str, str]:
    """What the scene does not need, with the reason."""
    scene, recipe = assembly.scene, assembly.recipe
    contact = recipe.contact
    reasons = {
        "contact history": None if recipe.history else f"contact.tangential '{contact.tangential}' remembers nothing",
        "rotation": None if recipe.rotation else "no contact law turns a sphere",
        "rolling and twisting moments": None if contact.couples else "contact.rolling and contact.twisting are 'none'",
        "cohesion and its reach": None if contact.cohesive else "contact.cohesion is 'none'",
        "rigid bodies": None if recipe.bodies else "all grains are single spheres",
        "material of each grain": None if recipe.materials else "all grains are of one material",
        "half-step velocities": None if recipe.integrator == VERLET else f"solver.integrator is '{recipe.integrator}'",
        "digits lost by velocities": None if recipe.carry else "what gravity and friction change in a step is large enough",
        "walls": None if assembly.walls else "the scene has no boundaries",
        "tools": None if scene.tools else "the scene has no tools",
        "true surfaces of tools": None if recipe.smooth_tools else "no tool or terrain has contact 'smooth'",
        "settling": None if scene.settle.time > 0.0 else "settle.time is 0",
    }
    return {what: why for what, why in reasons.items() if why}


def array_sizes(arrays: DemArrays) -> dict[str, int]:
    """Bytes of all device arrays by name; arrays that share memory count once."""
    found = {}

    def walk(name: str, value) -> None:
        if isinstance(value, wp.array):
            found[name] = value
        elif isinstance(value, dict):
            for key, entry in value.items():
                walk(f"{name}.{getattr(key, '__name__', key)}", entry)
        elif type(value).__module__.startswith("sand_sim.engine"):
            for key, entry in vars(value).items():
                if key != "on":  # the device has nothing that grows with the scene
                    walk(f"{name}.{key}".lstrip("."), entry)

    walk("", arrays)
    sizes, end = {}, 0
    for name, array in sorted(found.items(), key=lambda item: (item[1].ptr or 0, -item[1].capacity)):
        if array.ptr and array.ptr + array.capacity > end:
            sizes[name], end = array.capacity, array.ptr + array.capacity
    return sizes


def measure_cost(assembly: Assembly, check: Callable[[], None] = lambda: None) -> float:
    """Time of one sphere and step [s] in a packed sample with this scene's kernels, on this machine.

    On all threads of its device, or on fewer where they are quicker: a run finds that out for itself (``engine/crew.py``), but
    takes longer for it than a sample lasts.
    """
    own = assembly.solver.device
    fewer = {-(-own.lanes // 2**k) for k in range(1, own.lanes.bit_length() + 1)} - {own.lanes}
    devices = [own, *(open_device(assembly.scene.solver.device, threads) for threads in sorted(fewer))]
    return min(sample_cost(assembly, device, check) for device in devices)


def sample_cost(assembly: Assembly, device: CpuDevice | CudaDevice, check: Callable[[], None] = lambda: None) -> float:
    """The same on a device, on all of its threads."""
    table = _packed_sample(assembly)
    lattice = Lattice(table.position.min(axis=0) - 1.0, table.position.max(axis=0) + 1.0, assembly.recipe.precision)
    setting = assembly.solver.arrays.setting
    recipe: Recipe = replace(assembly.recipe, materials=False)
    sample = DemArrays(recipe, replace(setting, gravity=np.zeros(3)), lattice, table, [], [], assembly.pair_table, device)
    solver = ExplicitDem(sample, device, lambda stage, share: check())
    solver.run(1)  # compiles
    # A call takes time, too, which the steps of a run do not feel; where few grains make them short there must be more of them.
    steps = _SAMPLE_STEPS if len(table) >= _SAMPLE_EDGE**3 else 4 * _SAMPLE_STEPS
    state, best = solver.take_state(), np.inf
    for _ in range(_SAMPLE_ROUNDS):
        check()
        solver.put_state(state)  # before the sample, which nothing holds together, has come apart
        begin = time.perf_counter()
        solver.run(steps)
        best = min(best, time.perf_counter() - begin)
    return best / (steps * len(table))


def _packed_sample(assembly: Assembly) -> GrainTable:
    """A cube of grains that just touch their six neighbours, about as many as the scene has if those are few.

    What a step takes however few grains there are is then shared by as many.
    """
    shape, radius = tetrahedron(), float(np.median(assembly.table.radius))
    grains = len(assembly.table) / (len(shape.radii) if assembly.recipe.bodies else 1)
    edge = min(max(round(np.cbrt(grains)), 1), _SAMPLE_EDGE)
    number, corner = edge**3, np.stack(np.meshgrid(*[range(edge)] * 3, indexing="ij"), -1).reshape(-1, 3).astype(float)
    still, density = np.zeros((number, 3)), float(assembly.table.density[0])
    if not assembly.recipe.bodies:
        position = corner * 2.0 * radius * (1.0 - _OVERLAP)
        columns = (np.full(number, radius), np.full(number, density), np.zeros(number, int))
        return GrainTable.of_spheres(position, still, still.copy(), *columns)
    equal = radius * shape.equal_radius
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (number, 1))
    position = corner * 2.0 * radius * (1.0 + 0.4)
    return place_clumps(shape, position, turns, np.full(number, equal), still, still.copy(), density, 0)
