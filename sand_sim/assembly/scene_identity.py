"""What of a scene decides where its grains go, as plain values that can be kept and compared.

Paths count by what is in the files, mappings whatever the order of their keys. Left out is what a run may change and still go on
from the same state: trajectories, duration, frame rate, threads, device.
"""

import hashlib
import json
import math
from dataclasses import asdict, is_dataclass
from pathlib import Path

import numpy as np
import trimesh

from sampler import locate_mesh, read_mesh
from sand_sim.assembly.assemble import Assembly
from sand_sim.scene.types import Boundary, Fill, Scene


def describe_scene(assembly: Assembly) -> dict:
    """The physics of a world as nested mappings, lists, texts and numbers.

    Raises:
        OSError: if a file that the scene was made from has gone.
        MeshError: the same of a mesh.
    """
    scene, lattice, solver = assembly.scene, assembly.lattice, assembly.scene.solver
    tools = {
        model.tool.name: _named(model.tool, mesh=_mesh_digest(model.mesh), urdf=None, link=None, trajectory=None)
        for model in assembly.tools
    }
    bodies = {
        model.body.name: _named(
            model.body,
            mesh=_mesh_digest(model.mesh) if model.mesh else None,
            spheres=_file_digest(model.body.spheres) if isinstance(model.body.spheres, Path) else model.body.spheres,
        )
        for model in assembly.bodies
    }
    return _plain(
        {
            "materials": {material.name: _named(material) for material in scene.materials},
            "pairs": {" and ".join(sorted(rule.between)): rule.numbers for rule in scene.pairs},
            "fills": [_fill(fill) for fill in scene.fills],
            "boundaries": [_boundary(boundary, scene) for boundary in scene.boundaries],
            "tools": tools,
            "bodies": bodies,
            "gravity": scene.gravity,
            "domain": [lattice.low, lattice.high, lattice.quantum],
            "contact": scene.contact,
            "liquid": scene.liquid,
            "solver": {"skin": solver.skin, "integrator": solver.integrator},
            "settle": scene.settle,
            "particles": {tool.tool.name: len(tool.body) for tool in assembly.tools}
            | {f"terrain {ground.name}": len(ground.body) for ground in assembly.grounds},
        }
    )


def digest(description: dict) -> np.ndarray:
    """What tells one description from others, shape (32,), uint8."""
    return np.frombuffer(hashlib.sha256(json.dumps(description, sort_keys=True).encode()).digest(), np.uint8)


def find_difference(before: object, now: object, where: str = "") -> str:
    """The first place where two descriptions differ and what is there; empty if nowhere."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*before, *(key for key in now if key not in before)]:
            if key not in before or key not in now:
                return f"{where}{key} is in one of them only"
            if found := find_difference(before[key], now[key], f"{where}{key}."):
                return found
        return ""
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return next(
            (found for k, pair in enumerate(zip(before, now, strict=True)) if (found := find_difference(*pair, f"{where}{k}."))),
            "",
        )
    return "" if before == now else f"{where.rstrip('.')} is {_short(before)} there and {_short(now)} here"


def _named(one, **changes) -> dict:
    """The fields of a dataclass but its name, some of them changed."""
    fields = asdict(one) | changes
    fields.pop("name")
    return fields


def _fill(fill: Fill) -> dict:
    digests = {name: _file_digest(path) for name in ("file", "shape") if isinstance(path := getattr(fill, name), Path)}
    return _named(fill, **digests)


def _boundary(boundary: Boundary, scene: Scene) -> dict:
    fields = _named(boundary)
    if terrain := boundary.terrain:
        if terrain.mesh:
            fields["terrain"]["mesh"] = _mesh_digest(read_mesh(locate_mesh(terrain.mesh, scene.folder)))
        else:
            fields["terrain"]["heights"] = _file_digest(terrain.heights)
    return fields


def _mesh_digest(mesh: trimesh.Trimesh) -> str:
    corners, faces = np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int64)
    return "sha256 " + hashlib.sha256(corners.tobytes() + faces.tobytes()).hexdigest()


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return "sha256 " + hashlib.file_digest(file, "sha256").hexdigest()


def _plain(value: object) -> object:
    """The same in the types that JSON gives back."""
    if is_dataclass(value):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {str(key): _plain(value[key]) for key in sorted(value, key=str)}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 30 else f"{text[:27]}..."
