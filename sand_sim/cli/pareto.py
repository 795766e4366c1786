"""Measure what each choice of a scene costs in run time and accuracy, and recommend the cheapest that is accurate enough.

The scene is run with its time step, stiffness, integrator, precision, contact law, grain shape, grain size and skin varied one
by one, then with the best of each together. Where there is a closed form (one impact by Hertz's law) every run is compared
with it. Elsewhere single runs are chaotic, and the mean over repeats is compared with that of runs resolved more finely.
Repeats differ by chance only: seeds, or the moment of a contact within a step. Only the steps are timed, after grains have
settled and kernels are compiled; settings take turns.
"""

import argparse
import json
from pathlib import Path

from sand_sim.cli import changes
from sand_sim.cli.console import Console
from sand_sim.cli.numbers import count, positive
from sand_sim.cli.writing import check_file, make_folder, place
from sand_sim.config_folder import find_scene
from sand_sim.interruption import InterruptedByUserError, Interruption
from sand_sim.scene.reading import load_scene, parse_scene
from sand_sim.study.pareto import Plan, Study
from sand_sim.study.quantity import QUANTITIES
from sand_sim.study.ready import TOLERANCES, WHOLE, prepare
from sand_sim.study.scene_writing import write_scene
from sand_sim.study.table import chance_text, percent, plain_rows, seconds, table_text
from sand_sim.study.variation import Edit, Facts, Variation, to


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", help="scene file, or the name of one of the package's own: impact, column and dig are ready")
    parser.add_argument(
        "--out", type=place, default=Path("out"), help="folder for NAME_pareto.json and NAME_pareto.png (default: out)"
    )
    defaults = ", ".join(f"{percent(value)} for {name}" for name, value in TOLERANCES.items()).replace("%", "%%")
    parser.add_argument("--tolerance", type=positive, help=f"largest relative error that will do, as 0.05 (default: {defaults})")
    parser.add_argument("--repeats", type=count, help="runs of each setting (default: 3, of one impact 8, with --quick 2)")
    parser.add_argument("--write", type=place, metavar="FILE", help="write the scene, else unchanged, with what is recommended")
    parser.add_argument("--quick", action="store_true", help="fewer settings, of a shorter run where the scene is one of ours")
    parser.add_argument("--quantity", choices=QUANTITIES, help="what is compared; chosen from the scene if left out")
    changes.add_argument(parser, " before it is varied")
    parser.add_argument("--threads", type=count, help="most cores to use; the scene's choice if left out")


def execute(options: argparse.Namespace, interruption: Interruption) -> int:
    """Run the verb."""
    console, path = Console(), find_scene(options.scene)
    scene = load_scene(path)
    make_folder(options.out)
    check_file(options.write, "--write")
    whole = parse_scene(path)
    facts = Facts.of(scene)
    preparation = prepare(path, scene, facts.grains, options.quantity)
    shortenings = [preparation.shortening] + ([preparation.quick] if options.quick else [])
    threads = (Edit("solver.threads", to(options.threads)),) if options.threads else ()
    varied = whole
    for shortening in (*shortenings, Variation("", "", (*options.set, *threads))):
        varied = changes.apply_edits(shortening, varied, facts)
    tolerance = options.tolerance or TOLERANCES[preparation.quantity]
    variations = tuple(one for one in preparation.variations if one.quick or not options.quick)
    plan = Plan(preparation.quantity, tolerance, options.repeats or (2 if options.quick else preparation.repeats), variations)
    study = Study(varied, path.resolve().parent, plan, console.line, interruption.check)
    stopped = False
    try:
        study.run()
    except InterruptedByUserError:
        stopped = True
    console.end()
    rows = study.rows()
    if not rows:
        return 130
    notes = [one.name for one in shortenings if one is not WHOLE] + ["interrupted"] * stopped
    print(f"{scene.name}, by its {plan.quantity}, {plan.repeats} repeats{': ' if notes else ''}{'; '.join(notes)}")
    print(table_text(rows))
    chosen = study.recommendation()
    _sum_up(study, chosen, tolerance)
    for file in _write(study, scene.name, chosen, notes, options.out):
        print(f"written: {file}")
    if options.write and chosen:
        kept = write_scene(path, changes.apply_edits(chosen[0], whole, facts), options.write)
        load_scene(options.write)
        print(f"written: {options.write}" + ("" if kept else ", without the comments of the original"))
    elif options.write:
        print(f"not written: {options.write}, because nothing is recommended")
    return 130 if stopped else int(bool(options.write) and not chosen)


def _sum_up(study: Study, chosen: tuple | None, tolerance: float) -> None:
    """Say what follows from the table."""
    orders, scatter = study.orders(), study.scatter()
    if orders:
        print("  order in the time step: " + ", ".join(f"{name} {order:.2f}" for name, order in orders.items()))
    if scatter is not None:
        print(f"  {chance_text(scatter)}")
    if chosen is None:
        best = min((row for row in study.rows() if row.trusted), key=lambda row: row.error.high, default=None)
        nearest = f"; the nearest is '{best.title}' with {percent(best.error.high)}" if best else ""
        print(f"  recommended: nothing, no setting that can be trusted is within {percent(tolerance)}{nearest}")
        return
    row = chosen[1]
    print(
        f"  recommended: {row.title}, the cheapest within {percent(tolerance)}: "
        f"{percent(row.error.high)} at most in {seconds(row.time.middle)}"
    )


def _write(study: Study, name: str, chosen: tuple | None, notes: list[str], folder: Path) -> list[Path]:
    """Write JSON and, where matplotlib is installed, the figure; return their paths."""
    rows, plan, scatter = study.rows(), study.plan, study.scatter()
    recommended = chosen[1].title if chosen else ""
    files = [folder / f"{name}_pareto.json"]
    plain = {
        "scene": name,
        "quantity": plan.quantity,
        "tolerance": plan.tolerance,
        "notes": notes,
        "scatter": scatter or None,  # zero where repeats have nothing to vary
        "order_in_time_step": study.orders(),
        "recommended": recommended or None,
        "settings": plain_rows(rows),
    }
    files[0].write_text(json.dumps(plain, indent=2) + "\n")
    try:
        from sand_sim.study.pareto_figure import draw_pareto

        title = f"{name}, by its {plan.quantity}, {plan.repeats} repeats" + (f"\n{'; '.join(notes)}" if notes else "")
        draw_pareto(rows, plan.tolerance, scatter, recommended, title, folder / f"{name}_pareto.png")
        files.append(folder / f"{name}_pareto.png")
    except ModuleNotFoundError:
        pass  # matplotlib is an extra; the JSON holds all that the figure shows
    return files
