"""``sand_sim VERB``: robots digging and scooping sand, grain by grain."""

import argparse
import sys

from sand_sim.cli.console import Console
from sand_sim.interruption import InterruptedByUserError, Interruption
from sand_sim.output import UNREAD, perhaps_unread


def main(arguments: list[str] | None = None) -> int:
    """Run the command line.

    Returns:
        Exit code: 0 done, 1 refused with one line that says why, 130 interrupted, 141 nobody reads its output any more.
    """
    interruption = Interruption()  # before the long imports
    with perhaps_unread():
        try:
            return _execute(arguments, interruption)
        except BrokenPipeError:
            raise  # to ``perhaps_unread``
        except OSError as error:  # of files that cannot be written, also those of kernels while all is imported
            Console().tell(f"sand_sim: {error}")
            return 1
    return UNREAD


def _execute(arguments: list[str] | None, interruption: Interruption) -> int:
    from sand_sim.checkpoint import CheckpointError
    from sand_sim.cli import bench, demo, pareto, plan, play, repose, run, stability
    from sand_sim.scene.types import SceneError

    parser = argparse.ArgumentParser(prog="sand_sim", description=(__doc__ or "").partition(": ")[2])
    parser.add_argument("--version", action=_Version, nargs=0, help="tell the version")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for verb in (run, demo, play, plan, repose, pareto, stability, bench):
        name = verb.__name__.rsplit(".", 1)[-1]
        first = (verb.__doc__ or "").partition("\n")[0]  # there are none under python -OO
        one = verbs.add_parser(name, help=first, description=first)
        verb.add_arguments(one)
        one.set_defaults(execute=verb.execute)
    options = parser.parse_args(arguments)
    try:
        interruption.check()
        return options.execute(options, interruption)
    except (CheckpointError, SceneError) as error:
        Console().tell(f"sand_sim: {error}")
        return 1
    except InterruptedByUserError:
        return 130


class _Version(argparse.Action):
    """Tells the version, which is looked up only then: a source tree that is not installed has none."""

    def __call__(self, parser, *_) -> None:
        from importlib.metadata import version

        print(f"sand_sim {version('sand_sim')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
