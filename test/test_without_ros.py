"""Everything but the node works where ROS is not installed."""

import subprocess
import sys

PROBE = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("rclpy", "builtin_interfaces", "geometry_msgs", "sensor_msgs", "std_srvs", "matplotlib"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
"""


def run(code, folder):
    return subprocess.run([sys.executable, "-c", PROBE + code], cwd=folder, capture_output=True, text=True, check=False)


def test_packages_import_without_ros(tmp_path):
    done = run("import sand_sim, sampler, sand_sim.cli.main, sand_sim.simulation, sand_sim.sinks.recorder", tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_scene_plays_without_ros(tmp_path):
    code = "from sand_sim.cli.main import main; sys.exit(main(['run', 'dig', '--duration', '0.02', '--out', 'out']))"
    done = run(code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "dig.rrd").stat().st_size > 100_000
    assert not (tmp_path / "out" / "dig.png").exists()
    assert "largest overlap / radius" in done.stdout


def test_play_says_that_it_needs_ros(tmp_path):
    done = run("from sand_sim.cli.main import main; sys.exit(main(['play', 'dig']))", tmp_path)
    assert done.returncode == 1
    assert "needs ROS 2" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
