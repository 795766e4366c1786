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


def shown_tests():
    section = DOCUMENT.read_text().partition("## In tests of your own")[2]
    return re.search(r"```python\n(.*?)```", section, re.DOTALL).group(1)


def run_tests(folder, *options):
    """What pytest prints about the tests in a folder."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "-q", *options, "-p", "no:cacheprovider", folder]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False)
    return done.stdout + done.stderr


def test_documented_tests_pass_beside_each_other(tmp_path):
    for name in ("one", "other"):
        (tmp_path / f"test_{name}.py").write_text(shown_tests())
    told = run_tests(tmp_path, "-n", "2", "--dist", "loadfile")
    assert "2 passed" in told, told


def test_documented_fixture_leaves_the_next_test_alone_when_a_scene_cannot_work(tmp_path):
    spoilt = shown_tests().replace("  plate: {mesh: plate.stl, material: steel,", "  plate: {mesh: plate.stl, material: stone,")
    assert spoilt != shown_tests()
    again = "\n\ndef test_again(executor):\n    pass\n"
    (tmp_path / "test_spoilt.py").write_text(spoilt + again)
    told = run_tests(tmp_path)
    assert "2 errors" in told, told
    assert len(re.findall(r"^E +\S*SceneError:", told, re.MULTILINE)) == 2, "the second must not blame the first"


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
