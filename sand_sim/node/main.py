"""Entry point of the node: start-up with one clear line if it fails, clean end on SIGINT and SIGTERM."""

import sys

from sand_sim.interruption import InterruptedByUserError, Interruption
from sand_sim.output import perhaps_unread

_USAGE = (
    "usage: sand_sim_node --ros-args -p scene:=FILE [-p NAME:=VALUE ...] [--params-file FILE] [-r __node:=NAME] ...; "
    "docs/node.md tells the parameters, and ros2 param describe those of a running node"
)
_ELSEWHERE = {
    "logging directory": "; set HOME or ROS_LOG_DIR",
    "SECURITY": "",
}  # why else ROS may not start, hints
_SWITCH_INTERVAL = 5e-5  # [s] that Python's threads wait for each other; with the usual 5 ms stepping waits for messages


def main(arguments: list[str] | None = None) -> int:
    """Run the node until it is interrupted or its duration is over.

    Returns:
        Exit code: 0, or 1 if the node could not start, was to end when the run blows up and it did, or could not write its files.
    """
    interruption = Interruption()  # before the long imports
    sys.setswitchinterval(_SWITCH_INTERVAL)
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    try:
        from sand_sim.node.node import SandSimNode
        from sand_sim.node.preparing import Preparation
        from sand_sim.node.security import demand_security
        from sand_sim.node.transport import enlarge_shared_memory
        from sand_sim.scene.types import SceneError
    except OSError as error:  # of the folder for compiled kernels
        print(f"sand_sim: {error}", file=sys.stderr)
        return 1
    enlarge_shared_memory()
    try:
        demand_security()
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except SceneError as error:
        print(f"sand_sim: {error}", file=sys.stderr)
        return 1
    except RuntimeError as error:
        told = " ".join(str(error).split())
        hint = next((hint for cause, hint in _ELSEWHERE.items() if cause in told), None)
        where = "arguments after --ros-args" if hint is None else "ROS cannot start"
        print(f"sand_sim: {where}: {told}{hint or ''}", file=sys.stderr)
        return 1
    executor, node, code = SingleThreadedExecutor(), None, 0
    try:
        interruption.check()
        if strange := remove_ros_args(sys.argv if arguments is None else arguments)[1:]:
            return _explain(strange)
        node = SandSimNode(progress=Preparation(interruption.check, lambda line: node.get_logger().info(line)))
        executor.add_node(node)
        if node.parameters["autostart"]:
            node.start()
        while not (interruption.asked or node.done):
            _spin(executor, node)
        code = 1 if node.configured and node.simulation.fault else 0
    except (InterruptedByUserError, ExternalShutdownException):
        pass
    except (SceneError, ValueError, OSError, ParameterException) as error:
        print(f"sand_sim: {error}", file=sys.stderr)
        return 1
    finally:
        if node is not None:
            executor.shutdown()  # it holds on to what it waits for
            node.destroy_node()
        rclpy.try_shutdown()
    return 1 if node is not None and node.incomplete else code


def _explain(strange: list[str]) -> int:
    """Say what arguments there are, instead of a run of the usual scene that nobody has asked for; the exit code."""
    if {"-h", "--help"} & set(strange):
        with perhaps_unread():
            print(_USAGE)
        return 0
    print(f"sand_sim: unknown arguments '{' '.join(strange)}'; {_USAGE}", file=sys.stderr)
    return 1


def _spin(executor, node) -> None:
    """Wait for something to do and do it; an error while one message or request is answered must not end the others."""
    from rclpy.executors import ExternalShutdownException

    try:
        executor.spin_once(timeout_sec=0.1)
    except ExternalShutdownException:
        raise
    except Exception as error:
        node.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)
