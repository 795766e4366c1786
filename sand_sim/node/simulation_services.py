"""The services of ``simulation_interfaces`` and its action ``SimulateSteps``, where that package is installed.

They lie under the node's name, as all its services and as Gazebo's do, so that two simulators fit into one domain; remap them for
clients that look for them elsewhere.
"""

from collections.abc import Callable

from rclpy.action import CancelResponse
from rclpy.lifecycle import LifecycleNode

from msg_adapters.simulation_interfaces import action, msg, names_to_features, srv
from sand_sim.border import Observation
from sand_sim.node.connections import Connections
from sand_sim.node.entity_services import FEATURES as ENTITY_FEATURES
from sand_sim.node.entity_services import EntityServices, failed, succeeded, unsupported, wrong_state
from sand_sim.node.frames import FrameTree
from sand_sim.node.services import Services
from sand_sim.simulation import Simulation

FEATURES = (
    *ENTITY_FEATURES,
    "SIMULATION_RESET",
    "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING",
    "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE",
    "STEP_SIMULATION_ACTION",
)


class SimulationServices:
    """Answers as the standard says, in terms of pausing, resetting and stepping by frames.

    Args:
        node: with ``refusal``, ``hold`` and ``done``.
        connections: where services are made.
        services: that wait for the stepping thread.
        simulation: that runs.
        frames: in which poses may be given.
        last: the last observation, None before the first.
    """

    def __init__(
        self,
        node: LifecycleNode,
        connections: Connections,
        services: Services,
        simulation: Simulation,
        frames: FrameTree,
        last: Callable[[], Observation | None],
    ):
        self._node, self._services, self._simulation = node, services, simulation
        self._paused_at_zero = False  # else a run that is held at time zero counts as stopped
        self._stepping: object | None = None
        connections.service(srv.GetSimulatorFeatures, "~/get_simulator_features", self._tell_features)
        connections.service(srv.GetSimulationState, "~/get_simulation_state", self._tell_state)
        connections.service(srv.SetSimulationState, "~/set_simulation_state", self._set_state)
        connections.service(srv.ResetSimulation, "~/reset_simulation", self._reset)
        connections.service(srv.StepSimulation, "~/step_simulation", self._step)
        connections.action(action.SimulateSteps, "~/simulate_steps", self._simulate_steps, lambda _: CancelResponse.ACCEPT)
        EntityServices(node, connections, services, simulation, frames, last)

    def _tell_features(self, _, response):
        told = (
            f"sand_sim. A step is a frame of {self._simulation.frame:g} s. Reset is of time and state together. Entities are "
            "tools and free rigid bodies; SetEntityState puts them somewhere else at once, where there is room."
        )
        response.features = names_to_features(FEATURES, told)
        return response

    @property
    def _state(self) -> int:
        states = msg.SimulationState
        if self._node.done:
            return states.STATE_QUITTING
        if self._simulation.fault is not None:
            return states.STATE_PAUSED
        if not self._simulation.paused:
            return states.STATE_PLAYING
        at_zero = self._simulation.world.time == 0.0
        return states.STATE_STOPPED if at_zero and not self._paused_at_zero else states.STATE_PAUSED

    def _tell_state(self, _, response):
        response.state.state, response.result = self._state, succeeded()
        return response

    async def _set_state(self, request, response):
        states, target = msg.SimulationState, request.state.state
        if target == self._state:
            code, told = srv.SetSimulationState.Response.ALREADY_IN_TARGET_STATE, "the simulation is in this state already"
            response.result = msg.Result(result=code, error_message=told)
        elif target not in (states.STATE_STOPPED, states.STATE_PLAYING, states.STATE_PAUSED, states.STATE_QUITTING):
            code = srv.SetSimulationState.Response.INCORRECT_TRANSITION
            response.result = msg.Result(result=code, error_message=f"state {target} cannot be asked for")
        elif self._node.refusal and target != states.STATE_QUITTING:
            response.result = wrong_state(self._node.refusal)
        else:
            response.result = await self._enter(target)
        return response

    async def _enter(self, target: int):
        states = msg.SimulationState
        if target == states.STATE_PLAYING and self._simulation.fault is not None:
            code = srv.SetSimulationState.Response.STATE_TRANSITION_ERROR
            return msg.Result(result=code, error_message=f"stepping has stopped, reset to go on: {self._simulation.fault}")
        self._stepping = None
        self._node.hold(target != states.STATE_PLAYING)
        self._paused_at_zero = target == states.STATE_PAUSED
        if target == states.STATE_STOPPED:
            return _result(*await self._services.outcome(self._simulation.reset))
        if target == states.STATE_QUITTING:
            self._node.done = True
        return succeeded()

    async def _reset(self, request, response):
        scopes = srv.ResetSimulation.Request
        both = scopes.SCOPE_TIME | scopes.SCOPE_STATE
        if request.scope not in (scopes.SCOPE_DEFAULT, both, both | scopes.SCOPE_SPAWNED, scopes.SCOPE_ALL):
            response.result = unsupported("time and state are only reset together: SCOPE_DEFAULT, SCOPE_ALL, or both bits")
        elif self._node.refusal:
            response.result = wrong_state(self._node.refusal)
        else:
            self._stepping = None
            response.result = _result(*await self._services.outcome(self._simulation.reset))
        return response

    async def _step(self, request, response):
        response.result = await self._advance(request.steps)
        return response

    async def _simulate_steps(self, goal):
        def tell(completed: int) -> bool:
            if completed:
                left = goal.request.steps - completed
                goal.publish_feedback(action.SimulateSteps.Feedback(completed_steps=completed, remaining_steps=left))
            return not goal.is_cancel_requested

        result = action.SimulateSteps.Result(result=await self._advance(goal.request.steps, tell))
        if goal.is_cancel_requested:
            goal.canceled()
        elif result.result.result == msg.Result.RESULT_OK:
            goal.succeed()
        elif goal.is_active:
            goal.abort()
        return result

    async def _advance(self, steps: int, goes_on: Callable[[int], bool] = lambda completed: True):
        """Frame after frame while the run is paused; the result.

        Args:
            steps: number of frames.
            goes_on: asked before each frame and after the last with the number of frames done, whether to do more.
        """
        if self._node.refusal:
            return wrong_state(self._node.refusal)
        if not self._simulation.paused:
            return failed("the simulation is not paused; pause it first")
        if self._stepping is not None:
            return failed("others are stepping; wait for them, cancel them, or set a state")
        own = self._stepping = object()
        try:
            for completed in range(steps):
                if not goes_on(completed):
                    return failed(f"cancelled after {completed} of {steps} steps")
                if self._stepping is not own or not self._simulation.paused:
                    return failed(f"interrupted after {completed} of {steps} steps: the state has been changed")
                good, told = await self._services.outcome(self._simulation.step)
                if not good:
                    return failed(told)
            goes_on(steps)
            return succeeded()
        finally:
            if self._stepping is own:
                self._stepping = None


def _result(good: bool, told: str):
    return succeeded() if good else failed(told)
