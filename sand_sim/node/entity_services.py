"""The entities of ``simulation_interfaces``: tools and free rigid bodies, told and put elsewhere."""

from collections.abc import Callable
from functools import partial

import numpy as np
from rclpy.node import Node

from msg_adapters.simulation_interfaces import (
    filters_to_asked,
    msg,
    report_to_state,
    srv,
    state_to_command,
    state_to_velocity,
    texts_to_info,
)
from sand_sim import rotation
from sand_sim.border import BodyReport, CommandError, Observation, ToolPose, ToolReport
from sand_sim.node.connections import Connections
from sand_sim.node.frames import FrameTree
from sand_sim.node.name_pattern import NamePattern, PatternError
from sand_sim.node.services import Services
from sand_sim.simulation import Simulation
from sand_sim.tool_motion.commands import check_command

_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
FEATURES = (
    "ENTITY_TAGS",
    "ENTITY_CATEGORIES",
    "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING",
    "ENTITY_INFO_GETTING",
)


class EntityServices:
    """Tells of entities as they were at the end of the last frame.

    Args:
        node: with ``refusal``.
        connections: where services are made.
        services: that wait for the stepping thread.
        simulation: that runs.
        frames: in which poses may be given.
        last: the last observation, None before the first.
    """

    def __init__(
        self,
        node: Node,
        connections: Connections,
        services: Services,
        simulation: Simulation,
        frames: FrameTree,
        last: Callable[[], Observation | None],
    ):
        self._node, self._services, self._simulation, self._frames, self._last = node, services, simulation, frames, last
        connections.service(srv.GetEntities, "~/get_entities", self._list)
        connections.service(srv.GetEntitiesStates, "~/get_entities_states", self._list_states)
        connections.service(srv.GetEntityState, "~/get_entity_state", self._tell_state)
        connections.service(srv.GetEntityInfo, "~/get_entity_info", self._tell_info)
        connections.service(srv.SetEntityState, "~/set_entity_state", self._set_state)

    def _now(self) -> tuple[float, dict[str, ToolReport | BodyReport]]:
        """When they were seen [s], and all by name; of a body whose name a tool has, too, with a prefix."""
        last = self._last()
        if last is None:
            return 0.0, {}
        tools = {report.name: report for report in last.tools}
        return last.time, tools | {f"bodies/{body.name}" if body.name in tools else body.name: body for body in last.bodies}

    def _list(self, request, response):
        _, entities = self._now()
        response.result, response.entities = _select(entities, request.filters)
        return response

    def _list_states(self, request, response):
        time, entities = self._now()
        response.result, response.entities = _select(entities, request.filters)
        response.states = [self._state(entities[name], time) for name in response.entities]
        return response

    def _tell_state(self, request, response):
        time, entities = self._now()
        response.result, report = _find(entities, request.entity)
        if report is not None:
            response.state = self._state(report, time)
        return response

    def _tell_info(self, request, response):
        response.result, report = _find(self._now()[1], request.entity)
        if report is not None:
            kind = "tool, moved by commands" if isinstance(report, ToolReport) else f"free rigid body of {report.mass:.4g} kg"
            response.info = texts_to_info(_category(report), kind, list(_tags(report)))
        return response

    async def _set_state(self, request, response):
        response.result, report = _find(self._now()[1], request.entity)
        if report is None:
            return response
        pose, twist = getattr(request, "set_pose", True), getattr(request, "set_twist", False)  # the first versions have no flags
        if getattr(request, "set_acceleration", False):
            response.result = unsupported(f"'{request.entity}': an acceleration cannot be set, only set_pose and set_twist")
        elif twist and isinstance(report, ToolReport):
            response.result = unsupported(f"'{request.entity}' is a tool; only its pose can be set (set_pose)")
        elif not (pose or twist):
            response.result = failed("nothing is to be set; set_pose and set_twist are false")
        elif self._node.refusal:
            response.result = wrong_state(self._node.refusal)
        else:
            response.result = await self._put(report, request.state, pose, twist)
        return response

    async def _put(self, report: ToolReport | BodyReport, state, pose: bool, twist: bool):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # what comes of huge numbers is refused
                act = self._putting(report, state, pose, twist)
        except CommandError as error:
            self._simulation.reject(error)
            invalid = getattr(srv.SetEntityState.Response, "INVALID_POSE", msg.Result.RESULT_OPERATION_FAILED)
            code = msg.Result.RESULT_OPERATION_FAILED if error.reason == "unknown_frame" else invalid
            return msg.Result(result=code, error_message=str(error))
        good, told = await self._services.outcome(lambda: self._simulation.change(act))
        return succeeded() if good else failed(told)

    def _putting(self, report: ToolReport | BodyReport, state, pose: bool, twist: bool) -> Callable[[], None]:
        """What puts an entity where a state says, and gives it that velocity.

        Raises:
            CommandError: if the state makes no sense by itself.
        """
        frame, tool = state.header.frame_id or self._frames.root, isinstance(report, ToolReport)
        position = orientation = velocity = spin = None
        if pose:
            command = state_to_command(state, report.name)
            command = ToolPose(report.name, *self._frames.in_root(frame, command.position, command.orientation))
            command = check_command(command, "" if tool else f"body '{report.name}'")
            position, orientation = command.position, command.orientation
        if tool:
            return partial(self._simulation.courses.place, report.name, position, orientation)
        if twist:
            moving, turn = state_to_velocity(state, report.name), self._frames.in_root(frame, np.zeros(3), _NO_TURN)[1]
            velocity, spin = rotation.rotate(turn, moving.linear), rotation.rotate(turn, moving.angular)
            velocity = velocity + self._of_centre(report.name, spin, report.orientation if orientation is None else orientation)
        return partial(self._simulation.world.place_body, report.name, position, orientation, velocity, spin)

    def _of_centre(self, body: str, spin: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """How much faster the centre of mass of a body moves than its frame's origin [m/s]."""
        model = next(model for model in self._simulation.world.assembly.bodies if model.body.name == body)
        return model.lead(spin, orientation)

    def _state(self, report: ToolReport | BodyReport, time: float):
        velocity = report.velocity
        if isinstance(report, BodyReport):  # which has that of the centre of mass
            velocity = velocity - self._of_centre(report.name, report.spin, report.orientation)
        return report_to_state(report, velocity, time, self._frames.root)


def succeeded():
    """A good result."""
    return msg.Result(result=msg.Result.RESULT_OK)


def failed(why: str):
    """Understood, but it could not be done."""
    return msg.Result(result=msg.Result.RESULT_OPERATION_FAILED, error_message=why)


def unsupported(why: str):
    """Never done here."""
    return msg.Result(result=msg.Result.RESULT_FEATURE_UNSUPPORTED, error_message=why)


def wrong_state(why: str):
    """Done, but not in this state."""
    return msg.Result(result=msg.Result.RESULT_INCORRECT_STATE, error_message=why)


def _find(entities: dict[str, ToolReport | BodyReport], name: str):
    """A result, and the entity if there is one of this name."""
    report = entities.get(name)
    if report is None:
        return msg.Result(result=msg.Result.RESULT_NOT_FOUND, error_message=_unknown(name, entities)), None
    return succeeded(), report


def _select(entities: dict[str, ToolReport | BodyReport], filters):
    """A result, and the names of the entities that pass."""
    asked = filters_to_asked(filters)
    if asked.bounded:
        return unsupported("filters.bounds: entities cannot be selected by region"), []
    try:
        pattern = NamePattern(asked.pattern)
    except PatternError as error:
        return failed(f"filters.filter: {error}"), []
    some = all if asked.all_tags else any
    return succeeded(), [
        name
        for name, report in entities.items()
        if pattern.found_in(name)
        and (not asked.categories or _category(report) in asked.categories)
        and (not asked.tags or some(tag in _tags(report) for tag in asked.tags))
    ]


def _category(report: ToolReport | BodyReport) -> int:
    kinds = msg.EntityCategory
    return kinds.CATEGORY_ROBOT if isinstance(report, ToolReport) else kinds.CATEGORY_DYNAMIC_OBJECT


def _tags(report: ToolReport | BodyReport) -> tuple[str, ...]:
    return ("tool",) if isinstance(report, ToolReport) else ("body",)


def _unknown(name: str, known: dict) -> str:
    return str(CommandError("unknown_entity", f"entity '{name}' is unknown; known are {', '.join(known) or 'none'}"))
