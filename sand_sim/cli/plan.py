"""Show what a scene keeps and leaves out: stages, arrays, kernels, time step, predicted cost."""

import argparse
import json
from dataclasses import asdict

from sand_sim.assembly.assemble import assemble
from sand_sim.cli import changes
from sand_sim.cli.console import Console
from sand_sim.config_folder import find_scene
from sand_sim.interruption import Interruption
from sand_sim.plan import Plan, make_plan
from sand_sim.scene.types import ROUGH, SMOOTH

_TOUCHED = {ROUGH: "rough: particles of its mesh", SMOOTH: "smooth: the true surface of its mesh"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own, such as dig")
    changes.add_argument(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--no-measure", action="store_true", help="do not run a sample to predict the cost")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    console = Console()

    def progress(stage: str, share: float) -> None:
        interruption.check()
        console.stage(stage, share)

    assembly = assemble(changes.load_changed(find_scene(options.scene), options.set), progress)
    plan = make_plan(assembly, measure=not options.no_measure, check=interruption.check)
    console.end()
    print(json.dumps(asdict(plan), indent=2, default=float) if options.json else plan_text(plan))
    return 0


def plan_text(plan: Plan) -> str:
    """A plan to read."""
    lines = [f"{plan.grains:,} grains, {plan.spheres:,} spheres", "", "stages kept"]
    lines += [f"  {name:32} {when}" for name, when in plan.kept.items()]
    for kind, touched in (("tools", plan.tools), ("terrains", plan.terrains)):
        lines += ["", f"{kind}: what grains touch"] if touched else []
        lines += [f"  {name:32} {_TOUCHED[contact]}" for name, contact in touched.items()]
    lines += ["", "tools: where their meshes lie in their frames"] if plan.boxes else []
    lines += [f"  {name:32} from ({_corner(low)}) to ({_corner(high)}) m" for name, (low, high) in plan.boxes.items()]
    lines += ["", "meshes: what had to be mended or guessed"] if plan.meshes else []
    lines += [f"  {name:32} {what}" for name, told in plan.meshes.items() for what in told]
    lines += ["", "without effect", *(f"  {what}" for what in plan.unused)] if plan.unused else []
    lines += ["", "numbers that may be in another unit", *(f"  {what}" for what in plan.odd)] if plan.odd else []
    lines += ["", "left out: no code compiled, no memory taken"]
    lines += [f"  {name:32} {why}" for name, why in plan.left_out.items()]
    lines += ["", f"arrays: {plan.bytes_per_sphere:.0f} bytes per sphere, {sum(plan.arrays.values()) / 1e6:.1f} MB in all"]
    largest = sorted(plan.arrays.items(), key=lambda item: -item[1])[:12]
    lines += [f"  {name:32} {size / plan.spheres:7.1f} B per sphere" for name, size in largest]
    lines += [f"  {'others':32} {(sum(plan.arrays.values()) - sum(s for _, s in largest)) / plan.spheres:7.1f} B per sphere"]
    lines += ["", f"kernels ({len(plan.kernels)}): " + ", ".join(plan.kernels)]
    step = plan.time_step
    lines += ["", f"time step {step['value']:.3g} s; safe is {step['safe']:.3g} s, decided by {step['reason']}"]
    lines += [f"  contact time {step['contact']:.3g} s, Rayleigh time {step['rayleigh']:.3g} s, at {step['speed']:.3g} m/s"]
    lines += [f"  {step['warning']}"] if step["warning"] else []
    lines.append(f"cost: {plan.steps:,} steps")
    if plan.sphere_step is not None:
        lines[-1] += f" at {1e9 * plan.sphere_step:.0f} ns per sphere and step on this machine, about {plan.duration:,.0f} s"
    return "\n".join(lines)


def _corner(place: list[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in place)
