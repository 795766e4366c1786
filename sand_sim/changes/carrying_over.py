"""From a running world to one with more grains or another tool: everything else goes on where it was, to the bit."""

from dataclasses import replace

import numpy as np

from sand_sim.assembly.assemble import Assembly, build_solver
from sand_sim.assembly.mesh_roots import allowed_mesh, mesh_roots
from sand_sim.assembly.tool_model import ToolModel, model_tool, with_mesh
from sand_sim.engine.state import set_back_half_a_step
from sand_sim.grain_table import GrainTable

_SPARE = 1.05  # of a tool's reach
_ADDED = ("radius", "density", "material")  # columns of a table that a state cannot tell


def rebuild(assembly: Assembly, table: GrainTable, tools: list[ToolModel], reserve: float | None = None) -> Assembly:
    """The same world with other grains or tools, on the same device; its state is that of the start.

    Args:
        assembly: the world's.
        table: of its grains.
        tools: of its tools.
        reserve: room around the domain [m]; as it is, or made wider where a tool reaches farther, if None.
    """
    lattice, old = assembly.lattice, assembly.solver
    if reserve is None:
        farthest = max((tool.extent for tool in tools), default=0.0)
        reserve = lattice.reserve if farthest <= lattice.room else _SPARE * farthest
    bare = replace(assembly, table=table, tools=tools, lattice=replace(lattice, reserve=reserve))
    return replace(bare, solver=build_solver(bare, old.arrays.setting, old.device))


def carry_over(old: Assembly, new: Assembly, replaced: int | None = None) -> None:
    """Put the state of one world into another that has more grains at the end of its table, or another tool.

    Places, velocities and all that contacts remember stay as they are; only what the grains have felt of a replaced tool is
    forgotten. New grains begin as the table has them. Where the lattice has become wider, places are rounded anew.

    Args:
        old: measured, so that its contact lists are up to date.
        new: from ``rebuild``.
        replaced: number of the tool that is another one now.
    """
    state, fresh = old.solver.take_state(), new.solver.take_state()
    grains, room = int(state["grains.number"]), len(state["grains.place"])
    added = len(fresh["grains.place"]) - room
    for name, rows in state.items():
        if name.endswith(".starts"):  # those who come behind the last grain have had no contacts
            state[name] = np.concatenate([rows[: grains + 1], np.full(added, rows[grains], rows.dtype), rows[grains + 1 :]])
        elif name.startswith("grains.") and name != "grains.number":
            state[name] = np.concatenate([rows[:grains], fresh[name][room:], rows[grains:]])
    if new.lattice.quantum != old.lattice.quantum:
        _rescale(state, old.lattice.quantum / new.lattice.quantum, grains)
    newcomers = slice(grains, grains + added)
    state["grains.number"] = np.array(grains + added)
    state["grains.came_from"][newcomers] = np.arange(grains, grains + added)
    set_back_half_a_step(old.solver.arrays, state, "grains", newcomers)
    if "tool.partner" in state:
        numbers = _particle_numbers(old.solver.arrays.tools, new.solver.arrays.tools, replaced)
        state["tool.partner"] = numbers[state["tool.partner"]]
    for name in {"tool.standing", "tool.near"} & state.keys():
        state[name] = np.zeros_like(state[name])  # found on surfaces that may be others now
    new.solver.put_state(state)
    new.solver.expect_moves()


def _rescale(state: dict[str, np.ndarray], share: float, grains: int) -> None:
    """Convert all lengths in quanta to new quanta, ``share`` of which make an old one; ``grains`` is how many there are."""
    for kind, number in (("grains", grains), ("bodies", len(state.get("bodies.place", ())))):
        if number:
            place, remainder = state[f"{kind}.place"][:number], state[f"{kind}.remainder"][:number]
            here = place[:, 3] > 0  # the others are parked at the end of the lattice
            exact = (place[here, :3].astype(float) + remainder[here]) * share
            place[here, :3], remainder[here] = np.rint(exact), exact - np.rint(exact)
            if kind == "grains":
                place[here, 3] = np.maximum(np.rint(place[here, 3] * share), 1)
    if "plungers.states" in state:
        state["plungers.states"]["shift"] *= share


def describe_changes(assembly: Assembly, loaded: Assembly) -> dict[str, np.ndarray]:
    """What has been changed in a world since it was loaded, as plain arrays that belong to its state.

    A tool with the mesh it was loaded with has no path, so that states do not depend on where a scene's files are.
    """
    added = {f"added.{name}": getattr(assembly.table, name)[len(loaded.table) :] for name in _ADDED}
    pairs = [(model.tool, first.tool) for model, first in zip(assembly.tools, loaded.tools, strict=True)]
    paths = ["" if (now.mesh, now.scale) == (first.mesh, first.scale) else now.mesh for now, first in pairs]
    added["lattice.reserve"] = np.array(float(assembly.lattice.reserve))
    return added | {"mesh.path": np.array(paths, str), "mesh.scale": np.array([now.scale for now, _ in pairs], float)}


def fit(assembly: Assembly, loaded: Assembly, models: dict, state: dict[str, np.ndarray]) -> Assembly:
    """A world that a state fits into: the one there is, or one with the grains and tools that the state speaks of.

    Args:
        assembly: the world's.
        loaded: the same as the scene made it.
        models: tools that others have been exchanged for, by number, mesh and scale; completed here.
        state: from ``World.save``.

    Raises:
        ValueError: if the state is of another scene.
        SceneError: if a mesh that it asks for may not be read, or can no longer be used.
    """
    table, tools = assembly.table, list(assembly.tools)
    wanted = [np.asarray(state.get(f"added.{name}", np.zeros(0))) for name in _ADDED]
    if not all(
        np.array_equal(getattr(table, name)[len(loaded.table) :], rows) for name, rows in zip(_ADDED, wanted, strict=True)
    ):
        table = GrainTable.join([loaded.table, _added_rows(assembly, *wanted)])
    spheres = len(state.get("grains.place", ()))
    if spheres != len(table) or len(state.get("mesh.path", tools)) != len(tools):
        raise ValueError(
            f"state: is of another scene: it has {spheres} spheres and {len(state.get('mesh.path', tools))} "
            f"tools, this scene {len(loaded.table)} spheres, {len(table) - len(loaded.table)} added later, and {len(tools)} tools"
        )
    for index, (path, scale) in enumerate(zip(state.get("mesh.path", ()), state.get("mesh.scale", ()), strict=True)):
        key = (index, str(path), float(scale))
        if path and key not in models:
            scene, tool = assembly.scene, tools[index].tool
            file = allowed_mesh(key[1], *mesh_roots(scene.mesh_roots, scene.folder))
            model = model_tool(with_mesh(tool, str(file), key[2]), scene, assembly.finest)
            models[key] = replace(model, tool=with_mesh(tool, key[1], key[2]))
        tools[index] = models[key] if path else loaded.tools[index]
    reserve = float(state.get("lattice.reserve", assembly.lattice.reserve))
    same = (
        table is assembly.table
        and reserve == assembly.lattice.reserve
        and all(one is other for one, other in zip(tools, assembly.tools, strict=True))
    )
    return assembly if same else rebuild(assembly, table, tools, reserve)


def expect_layout(loaded: dict[str, np.ndarray], state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays as long as those of a state must be if it has the grains and tools that it says.

    Args:
        loaded: state of the world as it was loaded.
        state: of any moment; only what ``describe_changes`` wrote is looked at.
    """
    added, like = len(state.get("added.radius", ())), dict(loaded)
    if "scene" not in state:  # older states do not tell of what scene they are
        del like["scene"]
    for name, rows in loaded.items():
        if name.startswith("added."):
            like[name] = np.zeros(added, rows.dtype)
        elif name.endswith(".starts") or (name.startswith("grains.") and rows.ndim):
            like[name] = np.zeros((len(rows) + added, *rows.shape[1:]), rows.dtype)
    paths = state.get("mesh.path", np.zeros(0))
    if paths.dtype.kind == "U" and paths.shape == loaded["mesh.path"].shape:
        like["mesh.path"] = paths  # as wide as its longest name
    return like


def _added_rows(assembly: Assembly, radius: np.ndarray, density: np.ndarray, material: np.ndarray) -> GrainTable:
    """Rows for the grains that a state has added; their places come from the state later."""
    shapes = {rows.shape for rows in (radius, density, material)}
    sound = len(shapes) == 1 and radius.ndim == 1 and np.isfinite(radius).all() and np.isfinite(density).all()
    if not (sound and (radius > 0.0).all() and (density > 0.0).all() and np.isin(material, assembly.table.material).all()):
        raise ValueError("state: what it says of added grains ('added.*') makes no sense")
    middle, still = np.tile(assembly.lattice.centre, (len(radius), 1)), np.zeros((len(radius), 3))
    return GrainTable.of_spheres(middle, still, still.copy(), radius, density, material.astype(int))


def _particle_numbers(old, new, replaced: int | None) -> np.ndarray:
    """New number of each old tool particle, shape (particles,), -1 for those of a replaced tool.

    Particles are numbered by cells, whose width depends on the largest grain.
    """
    numbers = np.full(old.particles.shape[0], -1, np.int32)
    of_old, of_new = old.tool_of.numpy(), new.tool_of.numpy()
    for tool in range(old.number):
        if tool != replaced:
            was, is_now = np.flatnonzero(of_old == tool), np.flatnonzero(of_new == tool)
            numbers[was[_by_place(old.particles.numpy()[was])]] = is_now[_by_place(new.particles.numpy()[is_now])]
    return numbers


def _by_place(points: np.ndarray) -> np.ndarray:
    return np.lexsort(points.T)
