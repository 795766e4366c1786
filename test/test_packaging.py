"""What colcon asks of setup.py, in a build folder of links as colcon --symlink-install makes it."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINKED = ("setup.py", "setup.cfg", "package.xml", "resource", "config", "launch", "msg_adapters", "sampler", "sand_sim")


@pytest.fixture
def build(tmp_path):
    for name in LINKED:
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def setup(build, *words):
    done = subprocess.run([sys.executable, "setup.py", *words], cwd=build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_setup_is_read_through_a_link(build):
    assert setup(build, "--version").split()[-1] == "0.1.0"


def test_commands_run_with_the_python_that_built_them(build):
    """Beside an apt ROS that is the one of a virtual environment, which nobody has activated where a launch file starts nodes."""
    setup(build, "install_scripts", "--install-dir", str(build / "bin"))
    for name in ("sand_sim", "sand_sim_node"):
        assert (build / "bin" / name).read_text().splitlines()[0] == f"#!{sys.executable}"
