"""Another body for a tool while its world runs: what it must keep to."""

from dataclasses import replace

import numpy as np

from sampler import MeshError, locate_mesh, read_mesh
from sand_sim.assembly.assemble import Assembly
from sand_sim.assembly.tool_model import ToolModel, model_tool, with_mesh
from sand_sim.border import CommandError, GrainCloud
from sand_sim.changes.clearance import find_cut
from sand_sim.scene.types import SceneError, Tool


def read_tool(assembly: Assembly, tool: Tool, mesh: str, scale: float) -> ToolModel:
    """Sample another mesh for a tool, as the scene would.

    Raises:
        CommandError: if mesh or scale cannot be used, or it is larger than the domain.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        raise CommandError("bad_mesh", f"tool '{tool.name}': scale must be positive, not {scale}")
    lattice, other = assembly.lattice, with_mesh(tool, str(mesh), scale)
    widest = float(np.max(lattice.high - lattice.low))
    try:
        corners = read_mesh(locate_mesh(other.mesh, assembly.scene.folder), other.scale).vertices
        reach = float(np.linalg.norm(corners, axis=1).max())
        if reach > widest:  # and would take long to sample
            raise CommandError(
                "too_large",
                f"tool '{tool.name}': the new mesh reaches {reach:.4g} m from the tool frame's origin, the domain is only "
                f"{widest:.4g} m wide; scale it down",
            )
        return model_tool(other, assembly.scene, assembly.finest)
    except MeshError as error:
        raise CommandError("bad_mesh", f"tools.{tool.name}.mesh: {error}") from None
    except SceneError as error:
        raise CommandError("bad_mesh", str(error)) from None


def check_tool(assembly: Assembly, tools: list[ToolModel], index: int, pose: tuple, spheres: GrainCloud) -> None:
    """See that a tool can take the place of another.

    Args:
        assembly: the world's.
        tools: all of them, with the new one.
        index: which of them is new.
        pose: position [m] and orientation of the tool now.
        spheres: from ``observe_spheres``.

    Raises:
        CommandError: if it cuts deeper into a grain by more than ``DEEP`` of its radius, or asks for a smaller time step.
    """
    model, step = tools[index], assembly.time_step
    name = f"tool '{model.tool.name}'"
    safe = replace(assembly, tools=tools).safe_step(0.0, 0.0)
    if step.value > 1.0001 * safe and safe < 0.9999 * assembly.safe_step(0.0, 0.0):
        raise CommandError(
            "too_fine",
            f"{name}: the new mesh has particles {model.body.spacing:.3g} m apart, which ask for a time step of {safe:.3g} s; "
            f"it is {step.value:.3g} s. Load the scene with it",
        )
    fault = find_cut((assembly.tools[index], *pose), (model, *pose), spheres)
    if fault:
        raise CommandError("blocked", f"{name}: the new mesh {fault}; move the tool away first")
