"""What is said about one case: right, flagged, refused, or silently wrong."""

import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from sand_sim.border import CommandError
from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.readout.trust import GAINED, gained_share
from sand_sim.scene.types import SceneError
from sand_sim.study.bench import Bench

RIGHT, FLAGGED, REFUSED, WRONG = "right", "flagged", "refused", "silently wrong"


@dataclass(frozen=True)
class Check:
    """One number against what it must be.

    Attributes:
        what: name of the number, with its unit.
        value: found.
        expected: must be.
        tolerance: allowed difference.
        source: closed form or invariant.
    """

    what: str
    value: float
    expected: float
    tolerance: float
    source: str = ""

    @property
    def passed(self) -> bool:
        """Whether the number is within its tolerance; one that is not a number is not."""
        return bool(abs(self.value - self.expected) <= self.tolerance)

    @property
    def error(self) -> float:
        """Difference over tolerance [1]; where none is allowed, 0 or infinite."""
        difference = abs(self.value - self.expected)
        return difference / self.tolerance if self.tolerance else (float("inf") if difference else 0.0)


@dataclass(frozen=True)
class Case:
    """One extreme.

    Attributes:
        group: of cases that vary the same thing.
        name: what is extreme.
        run: ``run(bench) -> checks`` makes a world, runs it and judges it.
        quick: part of the quick sweep.
        automatic: the time step is chosen automatically, so it must be stable.
        violent: physics itself makes grains fly apart, so that stopping is right.
    """

    group: str
    name: str
    run: Callable[[Bench], Iterable[Check]]
    quick: bool = True
    automatic: bool = True
    violent: bool = False


@dataclass
class Finding:
    """What became of a case.

    Attributes:
        group, name: of the case.
        verdict: ``right``, ``flagged``, ``refused`` or ``silently wrong``.
        reason: why it was flagged or refused, or what is wrong.
        checks: as far as it came.
        stable: whether the time step was.
        automatic: whether the time step was chosen automatically.
        time_step: [s], zero if there was no world.
        step_reason: what the automatic step comes from.
        seconds: it took.
    """

    group: str
    name: str
    automatic: bool
    verdict: str = WRONG
    reason: str = ""
    checks: list[Check] = field(default_factory=list)
    stable: bool = True
    time_step: float = 0.0
    step_reason: str = ""
    seconds: float = 0.0

    @property
    def bad(self) -> bool:
        """Whether this finding must not be: a silent error, or an automatic step that is not stable."""
        return self.verdict == WRONG or (self.automatic and not self.stable)

    def as_dict(self) -> dict:
        """Plain values for JSON."""
        plain = asdict(self)
        plain["checks"] = [asdict(check) | {"passed": check.passed} for check in self.checks]
        return plain


def examine(case: Case, check: Callable[[], None] = lambda: None) -> Finding:
    """Run a case and say what became of it.

    Args:
        case: to run.
        check: called now and then; may raise to give up.
    """
    finding, begin = Finding(case.group, case.name, case.automatic), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder), check)
        try:
            finding.checks = list(case.run(bench))
            health = bench.world.observe().health
            finding.stable = gained_share(health) <= GAINED
            failed = [one for one in finding.checks if not one.passed]
            finding.reason = "; ".join(health.doubts)
            if health.doubts:
                finding.verdict = FLAGGED
            elif failed:
                finding.reason = "; ".join(f"{one.what} is {one.value:.4g}, must be {one.expected:.4g}" for one in failed)
            else:
                finding.verdict = RIGHT
        except (SceneError, CommandError) as error:
            finding.verdict, finding.reason = REFUSED, str(error)
        except UnstableError as error:
            finding.verdict, finding.reason, finding.stable = FLAGGED, str(error), case.violent
        if bench.world is not None:
            finding.time_step = bench.world.time_step
            finding.step_reason = bench.world.assembly.time_step.reason
    finding.seconds = time.monotonic() - begin
    return finding
