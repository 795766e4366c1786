"""Builds a package of messages that is not among the wheels from the fields and constants in the file of its name.

Run as a program: ``python interface_builder.py FOLDER PACKAGE``; the package is then in ``FOLDER/site``. Needs gcc, g++ and the
headers of Python. What comes out talks to everyone who has the package with the same fields.
"""

import importlib.metadata
import os
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy

NAME = sys.argv[2] if __name__ == "__main__" else ""
USED = ("std_msgs", "geometry_msgs", "builtin_interfaces", "service_msgs", "action_msgs", "unique_identifier_msgs")
KINDS = ("generator_c", "generator_py", "typesupport_c", "typesupport_fastrtps_c", "typesupport_introspection_c")
RUNTIME = ("rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_fastrtps_cpp")
PREFIX = Path(sys.prefix)


def build(folder: Path) -> Path:
    """Generate, compile, link; the folder to import from."""
    generated = generate(write_definitions(folder / "definitions"), folder / "generated")
    headers = folder / "headers"
    includes = [
        PREFIX / "include",
        *(PREFIX / "include").iterdir(),
        Path(sysconfig.get_path("include")),
        Path(numpy.get_include()),
    ]
    for kind in ("c", "fastrtps_c", "introspection_c"):
        (headers / kind).mkdir(parents=True)
        (headers / kind / NAME).symlink_to(generated / kind)
        includes.insert(0, headers / kind)
    options = ["-w", "-O0", "-fPIC", *(f"-I{path}" for path in includes)]

    def compiled(paths) -> list[str]:
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(lambda path: compile_one(path, options), sorted(paths)))

    site = folder / "site"
    package = site / NAME
    site.mkdir()
    (generated / "py").rename(package)
    (package / "__init__.py").touch()
    sources = [*generated.glob("c/**/*.c"), *generated.glob("c/**/*.cpp"), *generated.glob("fastrtps_c/**/*.cpp")]
    libraries = [PREFIX / "lib" / f"lib{used}__rosidl_{kind}.so" for used in USED for kind in KINDS]
    names = (*RUNTIME, "rosidl_typesupport_introspection_c", "fastcdr", "rmw", "rcutils")
    libraries += [PREFIX / "lib" / f"lib{name}.so" for name in names]
    fast = link(package, "fastrtps_c", [*compiled(sources), *compiled(package.glob("*/*_s.c"))], libraries)
    slow = link(package, "introspection_c", compiled(generated.glob("introspection_c/**/*.c")), [fast, *libraries])
    entry = compiled(package.glob("_*_s.ep.rosidl_typesupport_c.c"))
    loaded = ["-Wl,--no-as-needed", f"-Wl,-rpath,{package}", fast, slow]
    run(["g++", "-shared", "-o", package / f"{NAME}_s__rosidl_typesupport_c.so", *entry, *loaded])
    return site


def write_definitions(folder: Path) -> Path:
    """The sections of the text file as files."""
    for section in Path(__file__).with_name(f"{NAME}.txt").read_text().split("== ")[1:]:
        name, _, fields = section.partition("\n")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(fields)
    return folder


def generate(definitions: Path, folder: Path) -> Path:
    """Sources in C, C++ and Python, by the generators of ROS."""
    os.environ["AMENT_PREFIX_PATH"] = str(PREFIX)
    os.environ["PATH"] = f"{PREFIX / 'bin'}:{os.environ['PATH']}"
    from rosidl_adapter import convert_to_idl
    from rosidl_cli import entry_points

    # The wheels tell each generator twice, which it takes for an error.
    entry_points.get_entry_points = lambda group, *, specs=None, strict=False: {
        point.name: point for point in importlib.metadata.entry_points(group=group) if not specs or point.name in specs
    }
    from rosidl_cli.command.generate.api import generate

    idl, files = folder / "idl" / NAME, []
    for path in sorted(definitions.glob("*/*")):
        name = path.relative_to(definitions)
        convert_to_idl(definitions, NAME, name, idl)
        files.append(f"{idl}:{name.with_suffix('.idl')}")
    generate(
        package_name=NAME,
        interface_files=files,
        include_paths=[str(PREFIX / "share")],
        output_path=folder / NAME,
        types=["c", "py"],
        typesupports=["c", "fastrtps_c", "introspection_c"],
    )
    return folder / NAME


def compile_one(path: Path, options: list[str]) -> str:
    """The object file of a source."""
    compiler = ["g++", "-std=c++17"] if path.suffix == ".cpp" else ["gcc"]
    run([*compiler, *options, "-c", path, "-o", f"{path}.o"])
    return f"{path}.o"


def link(package: Path, kind: str, objects: list[str], libraries: list[Path]) -> Path:
    """A shared library under the name by which the middleware asks for it."""
    path = package / f"lib{NAME}__rosidl_typesupport_{kind}.so"
    places = [f"-Wl,-rpath,{PREFIX / 'lib'}", f"-Wl,-rpath,{package}", f"-Wl,-soname,{path.name}"]
    run(["g++", "-shared", "-o", path, *objects, *libraries, *places])
    return path


def run(command: list) -> None:
    """Run a compiler; what it says on an error is the error."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr[-2000:]}")


if __name__ == "__main__":
    build(Path(sys.argv[1]).resolve())
