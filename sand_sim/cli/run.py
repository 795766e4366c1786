"""Play a scene with the trajectories it holds, in pure Python, without ROS."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sand_sim.border import CommandError
from sand_sim.checkpoint import CheckpointError, take_checkpoint
from sand_sim.checkpoints import PERIOD, CheckpointFolder
from sand_sim.cli import changes
from sand_sim.cli.console import Console
from sand_sim.cli.numbers import count, positive
from sand_sim.cli.writing import make_folder, place
from sand_sim.config_folder import find_scene
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.following import follow
from sand_sim.interruption import Interruption
from sand_sim.report import progress_line, summary_text
from sand_sim.sinks.recorder import Recorder, RecordingError, require_rerun
from sand_sim.sinks.run_log import RunLog
from sand_sim.tool_motion.playing import frame_times
from sand_sim.world import World


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own, such as dig")
    parser.add_argument(
        "--out", type=place, default=Path("out"), help="folder for recording, history, summary and figure (default: out)"
    )
    changes.add_argument(parser)
    parser.add_argument("--duration", type=positive, help="simulated seconds; the scene's own if left out")
    parser.add_argument("--threads", type=count, help="most cores to use; the scene's choice if left out")
    parser.add_argument("--checkpoint", type=place, metavar="FOLDER", help="keep the state there, so that a crash loses little")
    parser.add_argument("--checkpoint-period", type=float, metavar="S", help=f"wall seconds, default {PERIOD:g}")
    parser.add_argument("--resume", action="store_true", help="go on from the newest good checkpoint in that folder")
    parser.add_argument("--view", action="store_true", help="open the Rerun viewer")
    parser.add_argument("--particles", action="store_true", help="draw the particles of tools in Rerun")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    console = Console()
    scene = changes.load_changed(find_scene(options.scene), options.set)
    make_folder(options.out)
    if options.threads:
        scene = replace(scene, solver=replace(scene.solver, threads=options.threads))

    def progress(stage: str, share: float) -> None:
        interruption.check()
        console.stage(stage, share)

    checkpoints = None
    if options.checkpoint:
        period = PERIOD if options.checkpoint_period is None else options.checkpoint_period
        checkpoints = CheckpointFolder(options.checkpoint, scene.name, period, console.tell)
    elif options.resume:
        raise CheckpointError("--resume: give the folder to resume from with --checkpoint FOLDER")
    elif options.checkpoint_period is not None:
        raise CheckpointError("--checkpoint-period: give the folder for checkpoints with --checkpoint FOLDER")
    recorded = _can_record(console.tell)
    world = World(scene, progress)
    log = RunLog(scene)
    if options.resume:
        checkpoints.resume(world, lambda checkpoint: log.unpack(checkpoint.history))
    elif checkpoints and checkpoints.files():
        console.tell(
            f"{options.checkpoint} holds checkpoints of an earlier run, which this one replaces; --resume would go on from them"
        )
    recorder = _open_recorder(world, log, options, recorded, console.tell)
    recorder.write(world.observe())
    for warning in world.warnings:
        console.tell(f"warning: {warning}")
    begin = world.time + 0.5 * world.time_step
    for time in (time for time in frame_times(scene, options.duration) if time > begin):
        try:
            follow(world, time)
        except (CommandError, UnstableError) as error:
            recorder.log.fault = str(error)
            break
        recorder.write(world.observe())
        console.line(progress_line(recorder.log))
        if checkpoints and checkpoints.due(world.steps):
            checkpoints.offer(take_checkpoint(world, history=recorder.log.pack()))
        if interruption.asked:
            recorder.log.interrupted = True
            break
    console.end()
    if checkpoints:
        if checkpoints.due(world.steps, soon=True) and not recorder.log.fault:
            checkpoints.offer(take_checkpoint(world, history=recorder.log.pack()))
        checkpoints.close()
    files = recorder.close()
    print(f"{scene.name}:\n{summary_text(recorder.log.summarise())}")
    print(f"written: {', '.join(map(str, files)) or 'nothing'}")
    if recorder.log.fault:
        print(f"sand_sim: {recorder.log.fault}", file=sys.stderr)
    if recorder.log.fault or recorder.failed:
        return 1
    return 130 if interruption.asked else 0


def _can_record(tell: Callable[[str], None]) -> bool:
    """Whether Rerun is there; told before the bed settles."""
    try:
        require_rerun()
    except RecordingError as error:
        tell(str(error))
        return False
    return True


def _open_recorder(
    world: World, log: RunLog, options: argparse.Namespace, recorded: bool, tell: Callable[[str], None]
) -> Recorder:
    """The run's recorder; a run that goes on writes a recording of its own beside the one that was broken off."""
    name = f"{world.scene.name}.from-{world.time:.3f}s" if log.rows else world.scene.name
    recording = options.out / f"{name}.rrd" if recorded else None
    return Recorder(world, recording, options.out, options.view and recorded, options.particles, tell, log)
