"""``python -m sampler MESH --radius R``: make a particle body and say what came out."""

import argparse
import signal
import sys
import time
from os.path import exists, isdir, isfile  # unlike those of Path they raise nothing where a folder may not be looked into
from pathlib import Path

from sampler.errors import MeshError


def main(arguments: list[str] | None = None) -> int:
    """Run the command line.

    Returns:
        0; 1 where the mesh, an option or a folder cannot be used; 130 where the user stopped it.
    """
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except (MeshError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130


def _run(options: argparse.Namespace) -> int:
    from sampler.cache import sample_file
    from sampler.distance import SignedDistance
    from sampler.files.location import locate_mesh
    from sampler.files.reading import read_mesh
    from sampler.options import check_weight
    from sampler.quiet import start_warp
    from sampler.report import report_table
    from sampler.storage import save_body

    start_warp()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    begin = time.perf_counter()
    weighed = (options.density, options.mass) != (None, None)
    if weighed:
        check_weight(options.density, options.mass)
    path = locate_mesh(options.mesh)
    for written in (options.output, options.rrd):
        if written and not isdir(written.parent):
            raise MeshError(f"cannot write {written}: there is no folder {written.parent}")
        if written and isdir(written):
            raise MeshError(f"cannot write {written}: it is a folder; name a file in it")
        if written and exists(written) and not isfile(written):
            raise MeshError(f"cannot write {written}: it is no file")
        if written and exists(written) and written.samefile(path):
            raise MeshError(f"cannot write {written}: it is the mesh; name another file")
    if options.rrd and options.output and options.rrd.resolve() == options.output.resolve():
        raise MeshError(f"cannot write {options.output}: it is named twice")
    recording = None
    if options.rrd:
        from sampler.recording import Recording

        recording = Recording(options.rrd, read_mesh(path, options.scale), options.radius)
    names = ("spacing", "seed", "device", "count", "grain", "inset", "thickness", "sheets")
    with _Bar() as bar:
        body = sample_file(
            path,
            options.radius,
            options.scale,
            cache=options.cache and not recording,
            progress=bar.show,
            observe=recording.particles if recording else None,
            **{name: getattr(options, name) for name in names},
        )
    sampled = time.perf_counter()
    seconds = {"sampling": sampled - begin}
    if recording:
        distance = SignedDistance(read_mesh(path, options.scale), options.device, options.thickness or 2.0 * options.radius)
        recording.finish(body, distance)
        seconds["recording"] = time.perf_counter() - sampled
    if options.output:
        save_body(options.output, body)
    mass = body.mass_properties(options.density, options.mass) if weighed and body.volume > 0.0 else None
    print(report_table(body, mass, seconds))
    for written in (options.output, options.rrd):
        if written:
            print(f"wrote {written}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "python -m sampler",
        description="Turn a triangle mesh into a rigid body of even particles.",
        epilog="example: python -m sampler bucket.stl --scale 0.001 --radius 0.004 --grain 0.001 --density 7800 -o bucket.npz",
    )
    parser.add_argument("mesh", help="path, file:// or package:// address of an STL, OBJ, PLY, OFF, DAE, glTF, 3MF ... file")
    parser.add_argument("--radius", type=float, required=True, metavar="R", help="of every particle [m]")
    parser.add_argument("--count", type=int, metavar="N", help="number of particles, instead of a spacing")
    parser.add_argument("--spacing", type=float, metavar="H", help="distance between neighbours [m] (default: 1.5 radii)")
    parser.add_argument("--grain", type=float, metavar="R", help="radius of the smallest grain that must not pass [m]")
    parser.add_argument(
        "--scale", type=float, default=1.0, help="metres per unit of the file (default: 1; 0.001 for millimetres)"
    )
    parser.add_argument("--inset", action="store_true", help="centres one radius below the surface (default: on the surface)")
    parser.add_argument("--thickness", type=float, metavar="T", help="of surfaces modelled without any [m] (default: 2 radii)")
    parser.add_argument("--sheets", choices=("auto", "never", "always"), default="auto", help="whether open surfaces are sheets")
    parser.add_argument("--density", type=float, help="[kg/m^3], for the report's mass and inertia")
    parser.add_argument("--mass", type=float, help="[kg], instead of a density")
    parser.add_argument("--seed", type=int, default=0, help="of the random start (default: 0)")
    parser.add_argument("--device", default="cpu", help="Warp device (default: cpu)")
    parser.add_argument("--no-cache", dest="cache", action="store_false", help="sample anew even if it was done before")
    parser.add_argument("--rrd", type=Path, metavar="FILE", help="record mesh, field and relaxing particles for Rerun")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the body, .npz")
    return parser


class _Bar:
    """A progress bar on a terminal; silent elsewhere. Whatever is said afterwards begins a new line."""

    def __init__(self):
        self._open = False

    def __enter__(self) -> "_Bar":
        return self

    def show(self, share: float) -> None:
        if sys.stderr.isatty():
            full = round(40 * share)
            print(f"\rsampling [{'#' * full}{'.' * (40 - full)}] {100.0 * share:3.0f} %", end="", file=sys.stderr, flush=True)
            self._open = True

    def __exit__(self, *_) -> None:
        if self._open:
            print(file=sys.stderr)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # imports pass an exception on as anything, or swallow it
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # as usual where nobody reads on, as in ``| head``
    sys.exit(main())
