"""How many clouds get through, and how long they take, from one process to another. Needs ROS 2.

A writer publishes clouds as the node makes them at a steady rate, a reader in this process counts them and reads when each was
sent off its stamp, which holds the machine's monotonic clock. In turn: reliable and best-effort readers, with the profile of
``config/ros/fastdds.xml`` on the writer's side and without.

    python -m benchmarks.cloud_transport --points 100000 --rate 30
"""

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np

from benchmarks.processes import use_own_domain
from benchmarks.provenance import provenance
from sand_sim.border import GrainCloud
from sand_sim.config_folder import config_folder

TOPIC = "clouds"
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PATIENCE = 20.0  # [s]


def main() -> None:
    """Measure all four cases and print one JSON line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--rate", type=float, default=30.0, help="clouds per second")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--write", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.write:
        write(options.points, options.rate, options.seconds)
        return
    use_own_domain()
    for profile in (True, False):
        for reliability in ("reliable", "best_effort"):
            row = {"benchmark": "cloud_transport", "points": options.points, "rate": options.rate, "seconds": options.seconds}
            row |= {"reader": reliability, "profile": profile} | read(options, reliability, profile) | provenance(1)
            print(json.dumps(row), flush=True)


def write(points: int, rate: float, seconds: float) -> None:
    """Publish, in a process of its own."""
    import rclpy
    from sensor_msgs.msg import PointCloud2

    from msg_adapters.sensor_msgs import grains_to_cloud

    rclpy.init()
    node = rclpy.create_node("cloud_writer")
    publisher = node.create_publisher(PointCloud2, TOPIC, _quality("reliable"))  # as the node
    random, zeros = np.random.default_rng(0), np.zeros((points, 3), np.float32)
    scalars = np.ones(points, np.float32)
    cloud = GrainCloud(np.arange(points), random.normal(size=(points, 3)), zeros, zeros, scalars, scalars, zeros)
    end = time.monotonic() + PATIENCE
    while not publisher.get_subscription_count() and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)
    time.sleep(1.0)
    begin = time.monotonic()
    for k in range(round(seconds * rate)):
        time.sleep(max(0.0, begin + k / rate - time.monotonic()))
        publisher.publish(grains_to_cloud(cloud, time.monotonic(), "world"))
    time.sleep(2.0)
    node.destroy_node()
    rclpy.try_shutdown()


def read(options: argparse.Namespace, reliability: str, profile: bool) -> dict:
    """Start a writer and hear it to its end."""
    import rclpy
    from sensor_msgs.msg import PointCloud2

    waits = []

    def hear(message: PointCloud2) -> None:
        waits.append(time.monotonic() - message.header.stamp.sec - 1e-9 * message.header.stamp.nanosec)

    rclpy.init()
    node = rclpy.create_node("cloud_reader")
    node.create_subscription(PointCloud2, TOPIC, hear, _quality(reliability))
    words = ["--points", options.points, "--rate", options.rate, "--seconds", options.seconds, "--write"]
    environment = os.environ | ({PROFILE: str(config_folder() / "ros" / "fastdds.xml")} if profile else {})
    writer = subprocess.Popen([sys.executable, "-m", "benchmarks.cloud_transport", *map(str, words)], env=environment)
    while writer.poll() is None:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.try_shutdown()
    sent = round(options.seconds * options.rate)
    row = {"sent": sent, "lost": sent - len(waits)}
    if waits:
        row |= {"median_ms": round(1e3 * float(np.median(waits)), 2), "p99_ms": round(1e3 * float(np.percentile(waits, 99)), 2)}
    return row


def _quality(reliability: str):
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(reliability=ReliabilityPolicy[reliability.upper()], history=HistoryPolicy.KEEP_LAST, depth=5)


if __name__ == "__main__":
    main()
