"""What ``docs/node.md`` shows is run as it stands there."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

import yaml
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.config_folder import find_scene

DOCUMENT = Path(__file__).parents[2] / "docs" / "node.md"


def test_documented_tests_pass_beside_each_other(tmp_path):
    section = DOCUMENT.read_text().partition("## In tests of your own")[2]
    shown = re.search(r"```python\n(.*?)```", section, re.DOTALL).group(1)
    for name in ("one", "other"):
        (tmp_path / f"test_{name}.py").write_text(shown)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "loadfile", "-p", "no:cacheprovider", tmp_path]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert "2 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["left", "right"])
def test_documented_second_node_has_a_clock_of_its_own(client, tmp_path, name):
    from rclpy.parameter import Parameter

    from sand_sim.node.node import SandSimNode

    scene = Parameter("scene", value=str(write_small_scene(tmp_path)))
    clock = ["--ros-args", "-r", f"/clock:=/{name}/clock"]
    node = SandSimNode(namespace=name, cli_args=clock, parameter_overrides=[scene])
    try:
        node.start()
        client.wait_for(lambda: client.node.count_publishers(f"/{name}/clock"))
        assert client.node.count_publishers("/clock") == 0
        assert client.node.count_publishers(f"/{name}/sand_sim/tools/plate/wrench")
    finally:
        node.destroy_node()


def test_documented_grains_are_added_to_the_usual_scene():
    words = re.search(r'SetParametersAtomically "(.*?)"\n', DOCUMENT.read_text(), re.DOTALL).group(1)
    value = {one["name"]: one["value"] for one in yaml.safe_load(words)["parameters"]}
    scene = load_scene(find_scene("dig"))
    world = World(replace(scene, fills=(replace(scene.fills[0], height=None, count=100),)))  # settles sooner than the whole bed
    position = np.reshape(value["position"]["double_array_value"], (-1, 3))
    assert len(world.add_grains(position, value["radius"]["double_value"], None, 0.0)) == 2
