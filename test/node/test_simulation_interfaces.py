"""The services and the action of ``simulation_interfaces``, by clients that have the package generated from its fields."""

import shutil
import signal
import time
from types import SimpleNamespace

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from node_client import PATIENCE
from rclpy.action import ActionClient
from scenes import write_small_scene

pytestmark = [
    pytest.mark.slow,
    pytest.mark.xdist_group("processes"),
    pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("g++")), reason="needs a compiler"),
]
SUCCEEDED, CANCELLED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED
FRAME = 0.02  # [s] of the small scene
BALL = {"spheres": [[0.01, 0.0, 0.0, 0.008]], "material": "sand", "pose": {"position": [0.1, 0.1, 0.2]}, "spin": [0.0, 0.0, 3.0]}


@pytest.fixture(scope="module")
def package(build_messages):
    """The package, importable here and in nodes."""
    build_messages("simulation_interfaces")
    from simulation_interfaces import action, msg, srv

    return SimpleNamespace(action=action, msg=msg, srv=srv)


@pytest.fixture
def run(package, client, start_process, tmp_path):
    """``run(pacing=...)`` starts a node; what it gives asks its services by their names."""

    def start(**parameters):
        write_small_scene(tmp_path, bodies={"ball": BALL})
        process = start_process(scene="small.yaml", **parameters)

        def ask(name, **fields):
            kind = getattr(package.srv, name)
            snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)[1:]
            return client.call(kind, snake, kind.Request(**fields))

        def state():
            return ask("GetSimulationState").state.state

        def enter(number):
            return ask("SetSimulationState", state=package.msg.SimulationState(state=number)).result.result

        return SimpleNamespace(process=process, ask=ask, state=state, enter=enter)

    return start


def test_features_are_those_that_are_there(run, client, package):
    node = run(paused=True)
    features = node.ask("GetSimulatorFeatures").features
    known = package.msg.SimulatorFeatures
    told = {name for name in dir(type(known)) if name.isupper() and getattr(known, name) in features.features}
    assert told == {
        "ENTITY_TAGS",
        "ENTITY_CATEGORIES",
        "ENTITY_STATE_GETTING",
        "ENTITY_STATE_SETTING",
        "ENTITY_INFO_GETTING",
        "SIMULATION_RESET",
        "SIMULATION_STATE_GETTING",
        "SIMULATION_STATE_SETTING",
        "SIMULATION_STATE_PAUSE",
        "STEP_SIMULATION_SINGLE",
        "STEP_SIMULATION_MULTIPLE",
        "STEP_SIMULATION_ACTION",
    }
    services = {name for name, kinds in client.node.get_service_names_and_types() if "simulation_interfaces/srv" in kinds[0]}
    assert services == {
        f"/sand_sim/{name}"
        for name in (
            "get_simulator_features",
            "get_simulation_state",
            "set_simulation_state",
            "reset_simulation",
            "step_simulation",
            "get_entities",
            "get_entities_states",
            "get_entity_state",
            "get_entity_info",
            "set_entity_state",
        )
    }
    assert "0.02 s" in features.custom_info


def test_states(run, client, package):
    states, codes = package.msg.SimulationState, package.srv.SetSimulationState.Response
    good = package.msg.Result.RESULT_OK
    node = run(pacing="fast", paused=True)
    assert node.state() == states.STATE_STOPPED
    assert node.enter(states.STATE_STOPPED) == codes.ALREADY_IN_TARGET_STATE
    assert node.enter(states.STATE_PAUSED) == good
    assert node.state() == states.STATE_PAUSED
    assert node.enter(states.STATE_PLAYING) == good
    client.wait_for(lambda: client.time > 0.1)
    assert node.state() == states.STATE_PLAYING
    assert node.enter(states.STATE_PAUSED) == good
    assert node.state() == states.STATE_PAUSED
    assert node.ask("GetEntityState", entity="plate").state.header.stamp.nanosec > 0
    assert node.enter(states.STATE_STOPPED) == good
    assert node.state() == states.STATE_STOPPED
    stamp = node.ask("GetEntityState", entity="plate").state.header.stamp
    assert (stamp.sec, stamp.nanosec) == (0, 0)
    for unreachable in (states.STATE_NO_WORLD, states.STATE_LOADING_WORLD, 77):
        assert node.enter(unreachable) == codes.INCORRECT_TRANSITION
    assert node.enter(states.STATE_PLAYING) == good
    client.wait_for(lambda: client.time > 0.1)
    assert node.enter(states.STATE_QUITTING) == good
    _, errors = node.process.communicate(timeout=PATIENCE)
    assert node.process.returncode == 0, errors
    assert "Traceback" not in errors


def test_reset_scopes(run, client, package):
    results, scopes = package.msg.Result, package.srv.ResetSimulation.Request
    node = run(pacing="fast", paused=True)

    def time_after_reset(scope):
        assert node.ask("StepSimulation", steps=2).result.result == results.RESULT_OK
        result = node.ask("ResetSimulation", scope=scope).result.result
        stamp = node.ask("GetEntityState", entity="plate").state.header.stamp
        return result, stamp.sec + 1e-9 * stamp.nanosec

    for scope in (scopes.SCOPE_DEFAULT, scopes.SCOPE_ALL, scopes.SCOPE_TIME | scopes.SCOPE_STATE):
        assert time_after_reset(scope) == (results.RESULT_OK, 0.0)
    for number, scope in enumerate((scopes.SCOPE_TIME, scopes.SCOPE_STATE, scopes.SCOPE_SPAWNED, 8), 1):
        result, at = time_after_reset(scope)
        assert result == results.RESULT_FEATURE_UNSUPPORTED
        assert at == pytest.approx(2 * number * FRAME, rel=1e-3)


def test_steps(run, client, package):
    results, states = package.msg.Result, package.msg.SimulationState
    node = run(pacing="realtime", paused=True)
    assert node.ask("StepSimulation", steps=3).result.result == results.RESULT_OK
    client.wait_for(lambda: client.time > 2.9 * FRAME)
    assert client.time == pytest.approx(3 * FRAME, rel=1e-3)
    assert node.state() == states.STATE_PAUSED
    assert node.ask("StepSimulation", steps=0).result.result == results.RESULT_OK
    node.enter(states.STATE_PLAYING)
    answer = node.ask("StepSimulation", steps=1).result
    assert answer.result == results.RESULT_OPERATION_FAILED
    assert "not paused" in answer.error_message


def test_endless_steps_of_a_service_do_not_make_the_node_deaf(run, client, package):
    results, states = package.msg.Result, package.msg.SimulationState
    node = run(pacing="realtime", paused=True)
    node.ask("StepSimulation", steps=1)
    steps = client.node.create_client(package.srv.StepSimulation, "/sand_sim/step_simulation")
    client.wait_for(steps.service_is_ready)
    answer = steps.call_async(package.srv.StepSimulation.Request(steps=2**64 - 1))
    client.wait_for(lambda: client.time > 5 * FRAME)
    assert node.state() == states.STATE_PAUSED
    assert node.ask("GetEntityState", entity="plate").result.result == results.RESULT_OK
    assert not answer.done()
    assert node.enter(states.STATE_STOPPED) == results.RESULT_OK
    client.wait_for(answer.done)
    assert answer.result().result.result == results.RESULT_OPERATION_FAILED
    assert node.state() == states.STATE_STOPPED


def change(client, label):
    """Whether a transition of the lifecycle has been made."""
    return client.call(ChangeState, "change_state", ChangeState.Request(transition=Transition(label=label))).success


def goal_of(client, package, steps):
    """A goal sent and accepted, and the feedback that comes in for it."""
    feedback, actions = [], ActionClient(client.node, package.action.SimulateSteps, "/sand_sim/simulate_steps")
    client.wait_for(actions.server_is_ready)
    goal = package.action.SimulateSteps.Goal(steps=steps)
    sent = actions.send_goal_async(goal, lambda heard: feedback.append(heard.feedback))
    client.wait_for(sent.done)
    assert sent.result().accepted
    return sent.result(), feedback


def end_of(client, goal):
    end = goal.get_result_async()
    client.wait_for(end.done)
    return end.result()


def test_action_tells_each_step(run, client, package):
    node = run(pacing="realtime", paused=True)
    goal, feedback = goal_of(client, package, 5)
    end = end_of(client, goal)
    assert (end.status, end.result.result.result) == (SUCCEEDED, package.msg.Result.RESULT_OK)
    client.wait_for(lambda: len(feedback) == 5)
    assert [(one.completed_steps, one.remaining_steps) for one in feedback] == [(k, 5 - k) for k in range(1, 6)]
    client.wait_for(lambda: client.time > 4.9 * FRAME)
    assert client.time == pytest.approx(5 * FRAME, rel=1e-3)
    node.enter(package.msg.SimulationState.STATE_PLAYING)
    goal, _ = goal_of(client, package, 5)
    end = end_of(client, goal)
    assert (end.status, end.result.result.result) == (ABORTED, package.msg.Result.RESULT_OPERATION_FAILED)


def test_action_is_cancelled_interrupted_and_one_at_a_time(run, client, package):
    results, states = package.msg.Result, package.msg.SimulationState
    node = run(pacing="realtime", paused=True)
    goal, feedback = goal_of(client, package, 2**64 - 1)
    client.wait_for(lambda: len(feedback) > 2)
    assert "others are stepping" in node.ask("StepSimulation", steps=1).result.error_message
    cancelled = goal.cancel_goal_async()
    client.wait_for(cancelled.done)
    end = end_of(client, goal)
    assert end.status == CANCELLED
    assert "cancelled after" in end.result.result.error_message
    held = node.ask("GetEntityState", entity="plate").state.header.stamp
    time.sleep(0.3)
    assert node.ask("GetEntityState", entity="plate").state.header.stamp == held
    assert node.state() == states.STATE_PAUSED

    goal, feedback = goal_of(client, package, 2**63)
    client.wait_for(lambda: len(feedback) > 2)
    assert node.enter(states.STATE_STOPPED) == results.RESULT_OK
    end = end_of(client, goal)
    assert end.status == ABORTED
    assert "interrupted" in end.result.result.error_message
    assert node.state() == states.STATE_STOPPED

    goal, feedback = goal_of(client, package, 2**63)
    client.wait_for(lambda: len(feedback) > 2)
    assert change(client, "deactivate")
    end = end_of(client, goal)
    assert end.status == ABORTED
    assert node.ask("StepSimulation", steps=1).result.result == results.RESULT_INCORRECT_STATE
    assert node.enter(states.STATE_PLAYING) == results.RESULT_INCORRECT_STATE
    assert node.ask("SetEntityState", entity="plate", set_pose=True).result.result == results.RESULT_INCORRECT_STATE
    for label in ("cleanup", "configure", "activate"):
        assert change(client, label)
    assert node.ask("StepSimulation", steps=1).result.result == results.RESULT_OK

    goal, feedback = goal_of(client, package, 2**63)
    client.wait_for(lambda: len(feedback) > 2)
    node.process.send_signal(signal.SIGINT)
    _, errors = node.process.communicate(timeout=PATIENCE)
    assert node.process.returncode == 0, errors
    assert "Traceback" not in errors


def test_entities(run, package):
    results, kinds, filters = package.msg.Result, package.msg.EntityCategory, package.msg.EntityFilters
    node = run(paused=True)

    def listed(**fields):
        answer = node.ask("GetEntities", filters=filters(**fields))
        return answer.result.result, list(answer.entities)

    good = results.RESULT_OK
    assert listed() == (good, ["plate", "ball"])
    assert listed(filter="^pl[[:alpha:]]+e$") == (good, ["plate"])
    assert listed(filter="l") == (good, ["plate", "ball"])
    assert listed(categories=[kinds(category=kinds.CATEGORY_DYNAMIC_OBJECT)]) == (good, ["ball"])
    assert listed(categories=[kinds(category=kinds.CATEGORY_HUMAN)]) == (good, [])
    tags = package.msg.TagsFilter
    assert listed(tags=tags(tags=["tool", "body"])) == (good, ["plate", "ball"])
    assert listed(tags=tags(tags=["tool", "body"], filter_mode=tags.FILTER_MODE_ALL)) == (good, [])
    assert listed(filter="(")[0] == results.RESULT_OPERATION_FAILED
    assert listed(filter="(a+)+" * 40 + "x")[0] == good
    assert listed(filter="x" * 10_000_000)[0] == results.RESULT_OPERATION_FAILED
    from geometry_msgs.msg import Vector3

    sphere = package.msg.Bounds(type=package.msg.Bounds.TYPE_SPHERE, points=[Vector3(), Vector3(x=1.0)])
    assert listed(bounds=sphere) == (results.RESULT_FEATURE_UNSUPPORTED, [])

    info = node.ask("GetEntityInfo", entity="ball").info
    assert (info.category.category, info.tags) == (kinds.CATEGORY_DYNAMIC_OBJECT, ["body"])
    missing = node.ask("GetEntityState", entity="bowl").result
    assert missing.result == results.RESULT_NOT_FOUND
    assert "plate, ball" in missing.error_message

    both = node.ask("GetEntitiesStates", filters=filters())
    assert both.entities == ["plate", "ball"]
    plate, ball = both.states
    place = ball.pose.position
    np.testing.assert_allclose([place.x, place.y, place.z], [0.1, 0.1, 0.2], atol=1e-7)
    # It turns about its centre, 0.01 m along x from its frame's origin, and that rests.
    np.testing.assert_allclose(ball.twist.linear.y, -3.0 * 0.01, rtol=1e-4)
    assert ball.twist.angular.z == pytest.approx(3.0)
    assert plate.header.frame_id == "world"
    assert plate.pose.position.z == pytest.approx(0.06)


def test_a_tool_is_put_at_a_pose(run, client, package):
    results, codes = package.msg.Result, package.srv.SetEntityState.Response
    base = {"frame_names": "[base]", "frames.base.pose": "[0.1, 0.0, 0.0, 0.0, 0.0, 1.5707963267948966]"}  # turned left
    node = run(pacing="fast", paused=True, **base)

    def sent(entity="plate", frame="", set_pose=True, set_twist=False, turn=1.0, **position):
        state = package.msg.EntityState()
        state.header.frame_id, state.pose.orientation.w = frame, turn
        for axis, value in position.items():
            setattr(state.pose.position, axis, value)
        answer = node.ask("SetEntityState", entity=entity, state=state, set_pose=set_pose, set_twist=set_twist)
        return answer.result.result

    target = {"x": 0.02, "y": 0.01, "z": 0.1}
    assert sent(**target) == results.RESULT_OK
    place = node.ask("GetEntityState", entity="plate").state.pose.position
    np.testing.assert_allclose([place.x, place.y, place.z], list(target.values()), atol=1e-6)
    assert sent(frame="base", x=0.01, y=0.08, z=0.1) == results.RESULT_OK
    node.ask("StepSimulation", steps=1)
    pose = node.ask("GetEntityState", entity="plate").state.pose
    np.testing.assert_allclose([pose.position.x, pose.position.y, pose.position.z], [0.02, 0.01, 0.1], atol=1e-6)
    np.testing.assert_allclose([abs(pose.orientation.z), abs(pose.orientation.w)], [0.5**0.5] * 2, atol=1e-6)

    assert sent(x=float("nan")) == codes.INVALID_POSE
    assert sent(x=0.1, turn=0.0) == codes.INVALID_POSE
    assert sent(x=1e308, frame="world") in (results.RESULT_OPERATION_FAILED, codes.INVALID_POSE)
    assert sent(x=0.015, y=0.015, z=0.01) == results.RESULT_OPERATION_FAILED, "in the bed"
    assert sent(frame="moon", **target) == results.RESULT_OPERATION_FAILED
    assert sent(set_pose=False, **target) == results.RESULT_OPERATION_FAILED
    assert sent(set_twist=True, **target) == results.RESULT_FEATURE_UNSUPPORTED
    assert sent("moon", **target) == results.RESULT_NOT_FOUND
    assert node.process.poll() is None


def test_a_body_is_put_at_a_pose_with_a_velocity(run, package):
    """In the axes of a frame that is turned left; what is not set stays as it is."""
    results, codes = package.msg.Result, package.srv.SetEntityState.Response
    base = {"frame_names": "[base]", "frames.base.pose": "[0.1, 0.0, 0.0, 0.0, 0.0, 1.5707963267948966]"}
    node = run(pacing="fast", paused=True, **base)

    def put(position=None, linear=None, angular=(0.0, 0.0, 0.0), frame="base", **further):
        state = package.msg.EntityState()
        state.header.frame_id, state.pose.orientation.w = frame, 1.0
        point, twist = state.pose.position, state.twist
        for message, values in ((point, position), (twist.linear, linear), (twist.angular, angular)):
            message.x, message.y, message.z = values or (0.0, 0.0, 0.0)
        flags = {"set_pose": position is not None, "set_twist": linear is not None} | further
        return node.ask("SetEntityState", entity="ball", state=state, **flags).result.result

    def ball():
        state = node.ask("GetEntityState", entity="ball").state
        parts = state.pose.position, state.twist.linear, state.twist.angular
        return [np.array([part.x, part.y, part.z]) for part in parts]

    assert put((0.05, 0.2, 0.15)) == results.RESULT_OK
    position, linear, angular = ball()
    np.testing.assert_allclose(position, [-0.1, 0.05, 0.15], atol=1e-7)
    np.testing.assert_allclose(angular, [0.0, 0.0, 3.0], rtol=1e-5)
    np.testing.assert_allclose(linear, [3.0 * 0.01, 0.0, 0.0], atol=1e-6)  # of the frame's origin: its centre still rests
    assert put(linear=(0.2, 0.0, 0.1), angular=(0.0, 1.0, 0.0)) == results.RESULT_OK
    position, linear, angular = ball()
    np.testing.assert_allclose(position, [-0.1, 0.05, 0.15], atol=1e-7)
    np.testing.assert_allclose(linear, [0.0, 0.2, 0.1], atol=1e-6)
    np.testing.assert_allclose(angular, [-1.0, 0.0, 0.0], atol=1e-6)

    assert put((float("nan"), 0.0, 0.0)) == codes.INVALID_POSE
    assert put((0.015, 0.085, 0.01)) == results.RESULT_OPERATION_FAILED, "among the grains"
    assert put(linear=(1e6, 0.0, 0.0)) == results.RESULT_OPERATION_FAILED
    assert put((0.05, 0.2, 0.15), frame="moon") == results.RESULT_OPERATION_FAILED
    assert put() == results.RESULT_OPERATION_FAILED, "nothing is to be set"
    assert put((0.05, 0.2, 0.15), set_acceleration=True) == results.RESULT_FEATURE_UNSUPPORTED
    assert node.process.poll() is None


def test_without_the_package_it_says_so_once(start_process, tmp_path, monkeypatch):
    monkeypatch.delenv("PYTHONPATH", raising=False)
    write_small_scene(tmp_path)
    process = start_process(scene="small.yaml", pacing="fast", duration=0.1)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    told = [line for line in errors.splitlines() if "simulation_interfaces" in line]
    assert len(told) == 1
    assert "not installed" in told[0]
