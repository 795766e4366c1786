"""Play a scene with the trajectories it holds, in pure Python, without ROS."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from sand_sim.cli.console import Console
from sand_sim.config_folder import find_scene
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.interruption import Interruption
from sand_sim.playing import commands_at, frame_times
from sand_sim.report import progress_line, summary_text
from sand_sim.scene.reading import load_scene
from sand_sim.sinks.recorder import Recorder, RecordingError
from sand_sim.world import World


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own, such as dig")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for recording, history, summary and figure")
    parser.add_argument("--duration", type=float, help="simulated seconds; the scene's own if left out")
    parser.add_argument("--threads", type=int, help="cores to use; all if left out")
    parser.add_argument("--view", action="store_true", help="open the Rerun viewer")
    parser.add_argument("--particles", action="store_true", help="draw the particles of tools in Rerun")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    console = Console()
    scene = load_scene(find_scene(options.scene))
    if options.threads:
        scene = replace(scene, solver=replace(scene.solver, threads=options.threads))

    def progress(stage: str, share: float) -> None:
        interruption.check()
        console.stage(stage, share)

    world = World(scene, progress)
    recording = options.out / f"{scene.name}.rrd"
    try:
        recorder = Recorder(world, recording, options.out, options.view, options.particles)
    except RecordingError as error:
        console.line(str(error), force=True)
        console.end()
        recorder, recording = Recorder(world, output=options.out), None
    recorder.write(world.observe())
    if world.assembly.time_step.warning:
        console.line(f"warning: {world.assembly.time_step.warning}", force=True)
    for time in frame_times(scene, options.duration):
        for command in commands_at(scene, time):
            world.apply(command)
        try:
            world.step(round((time - world.time) / world.time_step))
        except UnstableError as error:
            recorder.log.fault = str(error)
            break
        recorder.write(world.observe())
        console.line(progress_line(recorder.log))
        if interruption.asked:
            break
    console.end()
    files = recorder.close()
    print(f"{scene.name}:\n{summary_text(recorder.log.summarise())}")
    print("written: " + ", ".join(str(path) for path in [recording, *files] if path))
    if recorder.log.fault:
        print(f"sand_sim: {recorder.log.fault}", file=sys.stderr)
        return 1
    return 130 if interruption.asked else 0
