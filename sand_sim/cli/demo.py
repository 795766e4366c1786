"""Dig: start the node on a scene and a client that drives its tools, then show what came of it."""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from sand_sim.cli.writing import make_folder, place
from sand_sim.config_folder import find_scene
from sand_sim.interruption import Interruption
from sand_sim.report import summary_text
from sand_sim.scene.reading import load_scene
from sand_sim.tool_motion.playing import driven_tools

_PATIENCE = 20.0  # [s] for a process to end by itself after it was asked to


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", nargs="?", default="dig", help="scene file or name (default: dig)")
    parser.add_argument(
        "--out", type=place, default=Path("out"), help="folder for recording, history, summary and figure (default: out)"
    )
    parser.add_argument("--view", action="store_true", help="open the Rerun viewer")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    path = find_scene(options.scene)
    scene = load_scene(path)
    driven_tools(scene)  # or nothing would come of it
    make_folder(options.out)
    parameters = {
        "scene": str(path),
        "pacing": "lockstep",
        "duration": scene.duration,
        "end_on_fault": True,
        "recording": str(options.out / f"{scene.name}.rrd"),
        "output": str(options.out),
        "view": options.view,
    }
    assignments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={json.dumps(value)}")]
    # The demo talks to itself only, whatever else runs on the network, or on this machine.
    own = f"demo_{os.getpid()}"
    assignments += ["-r", f"__ns:=/{own}", "-r", f"/clock:=/{own}/clock"]
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **os.environ}
    summary = options.out / f"{scene.name}.json"
    summary.unlink(missing_ok=True)
    node = _start(["-m", "sand_sim.node", "--ros-args", *assignments], environment)
    client = _start(["-m", "sand_sim", "play", str(path), "--node", f"{own}/sand_sim", "--clock", f"/{own}/clock"], environment)
    while node.poll() is None and not client.poll():  # for a client that has failed the node would wait for ever
        try:
            node.wait(0.2)
        except subprocess.TimeoutExpired:
            if interruption.asked:
                break
    failed = client.poll() or 0
    for process in (client, node):
        _end(process)
    code = 130 if interruption.asked else node.returncode or failed
    if not summary.is_file():
        return code or 1
    print(f"{scene.name}:\n{summary_text(json.loads(summary.read_text()))}")
    files = [options.out / f"{scene.name}.{kind}" for kind in ("rrd", "png", "npz", "json")]
    print("written: " + ", ".join(str(file) for file in files if file.is_file()))
    return code


def _start(words: list[str], environment: dict[str, str]) -> subprocess.Popen:
    """A Python process in a group of its own, so that Ctrl-C reaches it through us and only once."""
    return subprocess.Popen([sys.executable, *words], env=environment, start_new_session=True)


def _end(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
