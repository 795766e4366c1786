"""A node that is driven hard for a while: many tools at 1 kHz each, every wrench counted, memory watched. Needs ROS 2.

Each tool hangs above a small bed and swings. Latency is from publishing a pose until a wrench of a frame that began after it is
there; the node paces itself in real time, so that half a frame and one frame of stepping are part of it.

    python -m benchmarks.node_endurance --seconds 60 --tools 8
"""

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.processes import resident_bytes, use_own_domain
from benchmarks.provenance import provenance
from sand_sim import ToolPose

RATE = 1000.0  # poses a second of each tool
FRAME_RATE = 200.0  # [1/s]
RADIUS = 0.005  # [m]
PATIENCE = 60.0  # [s]
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def main() -> None:
    """Drive a node and print one JSON line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--tools", type=int, default=8)
    options = parser.parse_args()
    use_own_domain()
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(Path(folder), options.tools)
        words = ["-p", f"scene:={scene}", "-p", "threads:=1", "-p", "points_rate:=0.0", "--log-level", "warn"]
        node = subprocess.Popen([sys.executable, "-m", "sand_sim.node", "--ros-args", *words], start_new_session=True)
        try:
            row = drive(node, options.tools, options.seconds)
        finally:
            node.send_signal(signal.SIGINT)
            code = node.wait(PATIENCE)
    row = {"benchmark": "node_endurance", "tools": options.tools, "seconds": options.seconds} | row | {"exit_code": code}
    print(json.dumps(row | provenance(1)))


def write_scene(folder: Path, tools: int) -> Path:
    """A few grains on a floor under plates in a row."""
    trimesh.creation.box((0.02, 0.02, 0.004)).export(folder / "plate.stl")
    grains = np.stack(np.meshgrid(range(4), range(4), range(2), indexing="ij"), -1).reshape(-1, 3)
    np.savez(folder / "bed.npz", position=2.02 * RADIUS * (grains + 0.5), radius=np.full(len(grains), RADIUS))
    plate = {"mesh": "plate.stl", "material": "steel", "particle_radius": 0.003, "max_speed": 2.0}
    scene = {
        "name": "endurance",
        "materials": {
            "sand": {"density": 2600.0, "young": 1e6, "poisson": 0.25},
            "steel": {"density": 7800.0, "young": 1e7, "poisson": 0.3},
        },
        "pairs": [{"between": ["sand", other], "restitution": 0.3, "friction": 0.5} for other in ("sand", "steel")],
        "fills": [{"material": "sand", "file": "bed.npz"}],
        "boundaries": [{"name": "floor", "type": "plane", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 1]}],
        "domain": {"low": [-0.5, -0.5, -0.05], "high": [0.5, 0.5, 0.5]},
        "tools": {f"plate_{k}": plate | {"pose": {"position": [0.03 * k, 0.0, 0.1]}} for k in range(tools)},
        "frame_rate": FRAME_RATE,
    }
    path = folder / "endurance.yaml"
    path.write_text(json.dumps(scene))
    return path


def drive(process: subprocess.Popen, tools: int, seconds: float) -> dict:
    """Send poses and count wrenches."""
    import rclpy
    from geometry_msgs.msg import PoseStamped, WrenchStamped
    from rclpy.executors import SingleThreadedExecutor

    from msg_adapters.geometry_msgs import command_to_pose

    rclpy.init()
    client = rclpy.create_node("endurance")
    publishers, stamps, sent_at, waits = [], [[] for _ in range(tools)], [0.0], []

    def hear(message: WrenchStamped, tool: int) -> None:
        stamps[tool].append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
        if tool == 0 and sent_at[0]:
            waits.append(time.perf_counter() - sent_at[0])
            sent_at[0] = 0.0

    for k in range(tools):
        topic = f"/sand_sim/tools/plate_{k}"
        publishers.append(client.create_publisher(PoseStamped, f"{topic}/pose", 100))
        client.create_subscription(WrenchStamped, f"{topic}/wrench", lambda message, k=k: hear(message, k), 1000)
    executor = SingleThreadedExecutor()
    executor.add_node(client)
    end = time.monotonic() + PATIENCE
    while not all(stamps):
        if time.monotonic() > end or process.poll() is not None:
            sys.exit("the node does not answer")
        executor.spin_once(timeout_sec=0.1)
    begin, sent, memory = time.perf_counter(), 0, []
    while (now := time.perf_counter() - begin) < seconds:
        due = int(now * RATE)
        while sent < due:
            sent += 1
            sent_at[0] = sent_at[0] or time.perf_counter()
            height = 0.1 + 0.01 * np.sin(2.0 * np.pi * sent / RATE)
            for k, publisher in enumerate(publishers):
                command = ToolPose(f"plate_{k}", np.array([0.03 * k, 0.0, height]), NO_TURN)
                publisher.publish(command_to_pose(command, "world"))
        if len(memory) <= now:
            memory.append(resident_bytes(process.pid))
        executor.spin_once(timeout_sec=0.0005)
    client.destroy_node()
    rclpy.try_shutdown()
    missed = [int(np.sum(np.round(np.diff(one) * 1e-9 * FRAME_RATE) - 1)) for one in stamps]
    half = len(memory) // 2
    return {
        "poses_sent": sent * tools,
        "poses_per_second": round(sent * tools / seconds),
        "wrenches": sum(map(len, stamps)),
        "wrenches_missed": sum(missed),
        "median_ms": round(1e3 * float(np.median(waits)), 2),
        "p99_ms": round(1e3 * float(np.percentile(waits, 99)), 2),
        "memory_mb": [round(memory[k] / 1e6, 1) for k in (half, -1)],
    }


if __name__ == "__main__":
    main()
