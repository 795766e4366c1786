"""Rules of the house that a machine can check."""

import ast
import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sand_sim import border
from sand_sim.contact.model import SLOTS, ContactModel
from sand_sim.scene import types

ROOT = Path(__file__).parents[1]
PACKAGES = ("sand_sim", "sampler", "msg_adapters")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
ROS = {
    "rclpy",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "lifecycle_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "simulation_interfaces",
    "std_msgs",
    "std_srvs",
    "tf2_msgs",
    "visualization_msgs",
}
# Who may import whom among the parts of sand_sim, from the ground up; a part may always import itself.
BELOW = {
    "contact": {"precision"},
    "engine": {"contact", "precision", "integrator", "grain_table", "reach", "rotation"},
    "scene": {"contact", "precision", "integrator", "grain_table", "rotation"},
}
BELOW["tool_motion"] = {"scene", "border", "reach", "rotation"}
BELOW["assembly"] = BELOW["engine"] | {"engine", "scene", "tool_motion", "border", "config_folder", "showing"}
BELOW["readout"] = BELOW["assembly"] | {"assembly"}
BELOW["changes"] = BELOW["readout"] | {"readout"}
BELOW["sinks"] = BELOW["changes"] | {"world"}
BELOW["study"] = BELOW["changes"] | {"world", "following"}
WITHOUT_SAMPLER = {"contact", "engine", "scene"}
BELOW_IN_SAMPLER = {
    "geometry": {"launching"},
    "files": {"geometry", "errors", "options"},
    "mending": {"geometry", "errors", "files"},
    "particles": {"geometry", "launching"},
}


def imports(path):
    """Absolute names of all modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names if node.module in PACKAGES)


def test_lint():
    done = subprocess.run([sys.executable, "-m", "ruff", "check", "."], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_format():
    command = [sys.executable, "-m", "ruff", "format", "--check", "."]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_one_way(path):
    package, *_ = path.relative_to(ROOT).parts
    names = {name.split(".")[0] for name in imports(path)}
    if package == "sampler":
        assert not names & (ROS | {"sand_sim", "msg_adapters"})
        part = path.relative_to(ROOT / "sampler").parts[0]
        if part in BELOW_IN_SAMPLER:
            used = {name.split(".")[1] for name in imports(path) if name.startswith("sampler.")}
            assert used <= BELOW_IN_SAMPLER[part] | {part}
    elif package == "msg_adapters":
        assert {name for name in imports(path) if name.startswith("sand_sim")} <= {"sand_sim.border"}
        assert "sampler" not in names
    elif "node" not in path.parts:
        assert not names & (ROS | {"msg_adapters"}), "only sand_sim.node knows ROS"
    if package == "sand_sim":
        part = path.relative_to(ROOT / "sand_sim").parts[0]
        used = {name.split(".")[1] for name in imports(path) if name.startswith("sand_sim.")}
        if part in BELOW:
            assert used <= BELOW[part] | {part}
        if part in WITHOUT_SAMPLER:
            shared = {"sampler.quiet", "sampler.cores", "sampler.compiling"}  # to start Warp, count cores, and compile on them
            assert {name for name in imports(path) if name.startswith("sampler")} <= shared


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_kernel_constants_are_exact(path):
    """Warp rounds ``real(0.1)`` to single precision even where real is double; such constants must be quotients."""
    for literal in re.findall(r"\breal\(([^()]*)\)", path.read_text(encoding="utf-8")):
        if re.fullmatch(r"-?[0-9.]+(e-?[0-9]+)?", literal):
            value = float(literal)
            assert (value == float(f"{value:.7g}") and (value * 2**20).is_integer()) or literal in ALLOWED, literal
        assert not re.fullmatch(r"[0-9.]+ / [0-9.]+", literal), f"real({literal}) is rounded; write real(a) / real(b)"


ALLOWED = {"1.05"}  # growth of cells, not physics


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_are_small(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 330


def fields_without_unit(module):
    """Float and vector fields of a module's dataclasses whose line or docstring entry shows no [unit]."""
    source = Path(module.__file__).read_text(encoding="utf-8").splitlines()
    for kind in vars(module).values():
        if not (isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind.__module__ == module.__name__):
            continue
        for field in dataclasses.fields(kind):
            if not re.search(r"\bfloat\b|Vector|ndarray", str(field.type)):
                continue
            lines = [line for line in source if re.match(rf"\s+{field.name}: ", line)]
            entries = [
                line for line in (kind.__doc__ or "").splitlines() if re.match(rf"\s+(\w+, )*{field.name}(, \w+)*: ", line)
            ]
            if not any(
                "[" in line.split(":", 1)[1].replace("tuple[", "") or "orientation" in line for line in [*lines, *entries]
            ):
                yield f"{kind.__name__}.{field.name}"


@pytest.mark.parametrize("module", [types, border], ids=lambda module: module.__name__)
def test_physical_fields_have_units(module):
    without = set(fields_without_unit(module))
    assert without <= {
        "SizeDistribution.weights",
        "GrainCloud.identity",
        "Pose.position",  # its units are in the docstring's first line
        "Pose.orientation",
    }


@pytest.mark.parametrize(("slot", "name"), [(slot, name) for slot, laws in SLOTS.items() for name in laws if name != "none"])
def test_laws_have_source_and_test(slot, name):
    text = SLOTS[slot][name].build.__doc__
    assert "Source: " in text
    assert "``F" in text or "``M" in text
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "test").rglob("test_*.py"))
    assert name == getattr(ContactModel(), slot) or f'"{slot}": "{name}"' in tests


def calls_without_device(path):
    """Lines that leave it to Warp where an array lies or a kernel runs; ``wp.array(dtype=int)`` is a type."""
    for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(call, ast.Call) and re.fullmatch(rf"wp\.({PLACED})", ast.unparse(call.func)):
            names = {keyword.arg for keyword in call.keywords}
            is_type = call.func.attr.startswith("array") and not call.args and names <= {"dtype", "ndim"}
            if "device" not in names and not is_type:
                yield call.lineno


PLACED = "array|array2d|zeros|ones|full|empty|launch|launch_tiled|from_numpy|HashGrid|Volume|ScopedCapture|capture_begin"


@pytest.mark.parametrize("folder", [*PACKAGES, "benchmarks", "test"])
def test_everything_says_which_device_it_is_on(folder):
    """Where there is a GPU Warp takes that, also for what a scene on the CPU needs; a CPU kernel that is given it crashes."""
    found = {path: list(calls_without_device(path)) for path in (ROOT / folder).rglob("*.py")}
    assert found
    assert not {path: lines for path, lines in found.items() if lines}


def test_tests_share_by_support_alone():
    for path in (ROOT / "test").rglob("test_*.py"):
        assert not [name for name in imports(path) if name.startswith("test_")], path
