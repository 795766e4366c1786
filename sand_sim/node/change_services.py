"""Services that change the world between two frames: states, grains, meshes, places of tools and bodies, and pushes."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from sand_sim.assembly.mesh_roots import allowed_mesh, mesh_roots
from sand_sim.node.arguments import ArgumentError, read_arguments
from sand_sim.node.connections import Connections
from sand_sim.node.services import Services
from sand_sim.scene.types import SceneError
from sand_sim.simulation import Simulation

_TEXT, _NUMBER = Parameter.Type.STRING, Parameter.Type.DOUBLE
_NUMBERS, _WHOLE = Parameter.Type.DOUBLE_ARRAY, Parameter.Type.INTEGER_ARRAY
_OF_BODY = ("orientation", "velocity", "spin")  # that may be left out
_MOST_GRAINS = 1_000_000  # that one request may add
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


class ChangeServices:
    """Answers ``save_state``, ``load_state``, ``spawn_grains`` and all else that changes the world.

    Args:
        connections: where services are made.
        services: that wait for the stepping thread.
        simulation: whose world is changed.
        states: folder of the states.
    """

    def __init__(self, connections: Connections, services: Services, simulation: Simulation, states: Path):
        self._services, self._simulation, self._world = services, simulation, simulation.world
        self._states = states
        for name, needed, optional, ask in (
            ("save_state", {}, {"name": _TEXT}, self._save),
            ("load_state", {}, {"name": _TEXT}, self._load),
            ("spawn_grains", {"position": _NUMBERS, "radius": _NUMBER}, {"material": _TEXT, "velocity": _NUMBERS}, self._spawn),
            ("remove_grains", {}, {"id": _WHOLE, "low": _NUMBERS, "high": _NUMBERS}, self._remove),
            ("set_tool_mesh", {"tool": _TEXT, "mesh": _TEXT}, {"scale": _NUMBER}, self._set_mesh),
            ("place_tool", {"tool": _TEXT, "position": _NUMBERS}, {"orientation": _NUMBERS}, self._place),
            ("place_body", {"body": _TEXT, "position": _NUMBERS}, dict.fromkeys(_OF_BODY, _NUMBERS), self._put),
            ("drive_plunger", {"plunger": _TEXT}, dict.fromkeys(("force", "velocity", "max_speed"), _NUMBER), self._drive),
            ("push_body", {"body": _TEXT}, dict.fromkeys(("force", "torque"), _NUMBERS), self._push),
        ):
            connections.service(SetParametersAtomically, f"~/{name}", self._answering(needed, optional, ask))

    def _answering(self, needed: dict, optional: dict, ask: Callable) -> Callable:
        async def answer(request, response):
            result = response.result
            try:
                arguments = read_arguments(request, needed, optional)
                result.successful, result.reason = await self._services.outcome(lambda: ask(**arguments))
            except ArgumentError as error:
                result.successful, result.reason = False, str(error)
            return response

        return answer

    def _save(self, name: str | None = None):
        return self._simulation.save_state(self._state_file(name))

    def _load(self, name: str | None = None):
        return self._simulation.load_state(self._state_file(name))

    def _state_file(self, name: str | None) -> Path:
        if name is None:
            name = self._world.scene.name  # which may be that of a file
        elif not _NAME.fullmatch(name):
            raise ArgumentError(f"argument 'name': '{name[:50]}' must be of letters, digits, '_', '-' and '.', and no path")
        return self._states / f"{name}.state"

    def _spawn(self, position: list, radius: float, material: str | None = None, velocity: list | None = None):
        points = _triples("position", position)
        if len(points) > _MOST_GRAINS:
            raise ArgumentError(f"argument 'position': {len(points)} grains are more than {_MOST_GRAINS} at once")
        speeds = 0.0 if velocity is None else _triples("velocity", velocity)
        if velocity is not None and len(speeds) not in (1, len(points)):
            raise ArgumentError(f"argument 'velocity': must be x y z of one or of all {len(points)} grains, not of {len(speeds)}")

        def act() -> str:
            identities = self._world.add_grains(points, radius, material, speeds)
            return f"{len(identities)} grains, id {identities[0]} to {identities[-1]}" if len(identities) else "0 grains"

        return self._simulation.change(act)

    def _remove(self, id: list | None = None, low: list | None = None, high: list | None = None):
        if (id is None) == (low is None) or (low is None) != (high is None):
            raise ArgumentError("give either 'id', or 'low' and 'high' of a box")
        box = None if low is None else (_triples("low", low, 1)[0], _triples("high", high, 1)[0])
        identity = None if id is None else np.array(id)
        return self._simulation.change(lambda: f"{len(self._world.remove_grains(identity, box))} grains")

    def _set_mesh(self, tool: str, mesh: str, scale: float = 1.0):
        scene = self._world.scene
        try:
            path = allowed_mesh(mesh, *mesh_roots(scene.mesh_roots, scene.folder))
        except SceneError as error:
            raise ArgumentError(f"argument 'mesh': {error}") from None

        def act() -> str:
            self._world.set_tool_mesh(tool, str(path), scale)
            warnings = next(one.body.warnings for one in self._world.tools if one.tool.name == tool)
            return "; ".join([f"tool '{tool}' has mesh {path.name}", *warnings])

        return self._simulation.change(act)

    def _place(self, tool: str, position: list, orientation: list | None = None):
        def act() -> str:
            self._simulation.courses.place(tool, position, orientation)
            return f"tool '{tool}' is there"

        return self._simulation.change(act)

    def _put(self, body: str, **where: list):
        def act() -> str:
            self._world.place_body(body, **where)
            return f"body '{body}' is there"

        return self._simulation.change(act)

    def _push(self, body: str, **wrench: list):
        def act() -> str:
            self._world.push_body(body, **wrench)
            return f"body '{body}' is pushed"

        return self._simulation.request(act)

    def _drive(self, plunger: str, **how: float):
        def act() -> str:
            self._world.drive_plunger(plunger, **how)
            return f"plunger '{plunger}' is driven"

        return self._simulation.request(act)


def _triples(name: str, values: Any, number: int | None = None) -> np.ndarray:
    if not len(values) or len(values) % 3 or len(values) != 3 * (number or len(values) / 3):
        raise ArgumentError(f"argument '{name}': must be x y z of {number or 'one or more'}, not {len(values)} numbers")
    return np.array(values, float).reshape(-1, 3)
