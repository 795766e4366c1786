"""Nodes and clients for the tests of this folder."""

import os
import subprocess
import sys
import threading
from contextlib import ExitStack

import pytest

rclpy = pytest.importorskip("rclpy", reason="needs ROS 2")

import interface_builder
from node_client import Client
from processes import kill
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from scenes import write_small_scene

from sand_sim.node.node import SandSimNode


@pytest.fixture(scope="module")
def build_messages(tmp_path_factory):
    """``build_messages(package)`` generates a package that is not among the wheels, to be imported here and in nodes."""
    with pytest.MonkeyPatch.context() as patch:

        def build(package):
            folder = tmp_path_factory.mktemp("interfaces")
            command = [sys.executable, interface_builder.__file__, folder, package]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            patch.syspath_prepend(folder / "site")
            patch.setenv("PYTHONPATH", str(folder / "site"), prepend=os.pathsep)

        yield build


@pytest.fixture
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def client(ros):
    client = Client()
    yield client
    client.close()


@pytest.fixture
def start_node(ros, tmp_path):
    """``start_node(pacing=..., ...)`` runs a node on the small scene in a thread of this process."""

    def start(scene_fields=None, **parameters):
        scene = write_small_scene(tmp_path, **(scene_fields or {}))
        overrides = [Parameter(name, value=value) for name, value in ({"scene": str(scene)} | parameters).items()]
        node = SandSimNode(parameter_overrides=overrides)
        running.callback(node.destroy_node)
        executor = SingleThreadedExecutor()
        running.callback(executor.shutdown)  # it holds on to what it waits for
        executor.add_node(node)
        if node.parameters["autostart"]:
            node.start()
        ending = threading.Event()

        def spin():
            while not ending.is_set():
                executor.spin_once(timeout_sec=0.05)

        thread = threading.Thread(target=spin)
        thread.start()
        running.callback(thread.join)
        running.callback(ending.set)
        return node

    with ExitStack() as running:
        yield start


@pytest.fixture
def start_process(tmp_path):
    """``start_process(pacing=..., ...)`` runs the node in another process."""
    running = []

    def start(**parameters):
        assignments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        command = [sys.executable, "-m", "sand_sim.node", "--ros-args", *assignments]
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        running.append(process)
        return process

    yield start
    for process in running:
        kill(process)
