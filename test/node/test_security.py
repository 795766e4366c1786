"""What can be said of security with wheels that have none: it is not left out silently, and the policy names what there is."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

pytestmark = pytest.mark.xdist_group("processes")

from node_client import PATIENCE
from scenes import write_small_scene

GUIDE = Path(__file__).parents[2] / "docs" / "security.md"


def test_asked_for_security_and_cannot_have_it(start_process, tmp_path, monkeypatch):
    """The keystore holds no enclave, and the wheels have no security to begin with."""
    (tmp_path / "keys" / "enclaves").mkdir(parents=True)
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path / "keys"))
    write_small_scene(tmp_path)
    process = start_process(scene="small.yaml", duration=0.1, pacing="fast")
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert "is ready" not in errors
    assert "secur" in errors.lower()


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
