"""What can be said of security with wheels that have none: it is not left out silently, and the policy names what there is."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE
from scenes import write_small_scene

from sand_sim.cli.main import main

GUIDE = Path(__file__).parents[2] / "docs" / "security.md"
UNAVAILABLE = "^sand_sim: ROS cannot start: .*SECURITY|^sand_sim: ROS_SECURITY_KEYSTORE: |doesn't have the security libraries"


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}, UNAVAILABLE),
        ({"ROS_SECURITY_ENABLE": "true"}, UNAVAILABLE),
        ({"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "enforce"}, "^sand_sim: ROS_SECURITY_STRATEGY: .* 'enforce'"),
        ({"ROS_SECURITY_ENABLE": "True", "ROS_SECURITY_STRATEGY": "Enforce"}, "^sand_sim: ROS_SECURITY_ENABLE: .* 'True'"),
    ],
)
@pytest.mark.parametrize("keystore", ["keys", "nowhere", None])
def test_asked_for_security_and_cannot_have_it(start_process, tmp_path, monkeypatch, given, named, keystore):
    """The keystore holds no enclave, is not there or not named, and the wheels have no security to begin with.

    ROS itself runs unprotected, and says nothing, in all of these cases but the first.
    """
    (tmp_path / "keys" / "enclaves").mkdir(parents=True)
    monkeypatch.delenv("ROS_SECURITY_STRATEGY", raising=False)
    monkeypatch.delenv("ROS_SECURITY_KEYSTORE", raising=False)
    for name, value in (given | ({"ROS_SECURITY_KEYSTORE": str(tmp_path / keystore)} if keystore else {})).items():
        monkeypatch.setenv(name, value)
    write_small_scene(tmp_path)
    process = start_process(scene="small.yaml", duration=0.1, pacing="fast")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "is ready" not in errors
    assert re.search(named, errors, re.MULTILINE), errors


def test_the_player_asks_for_it_as_the_node_does(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "True")
    assert main(["play", str(write_small_scene(tmp_path))]) == 1
    assert "sand_sim: ROS_SECURITY_ENABLE: " in capsys.readouterr().err


def test_policy_names_what_there_is(client, start_node):
    start_node()
    client.connect()
    policy = ElementTree.fromstring(
        re.search(r"```xml\n(.*?)```", GUIDE.read_text(), re.DOTALL).group(1).replace("bucket", "plate")
    )
    there = {
        "publish": client.node.get_subscriber_names_and_types_by_node,
        "subscribe": client.node.get_publisher_names_and_types_by_node,
        "request": client.node.get_service_names_and_types_by_node,
    }
    everyones = {"/rosout", "/parameter_events"}
    seen = 0
    for group in policy.iter():
        for right in there.keys() & group.keys():
            named = {one.text for one in group} - everyones
            client.wait_for(lambda: named <= {name for name, _ in there[right]("sand_sim", "/")})  # noqa: B023
            seen += len(named)
    assert seen > 10
