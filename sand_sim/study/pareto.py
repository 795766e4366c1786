"""Runs a scene over its choices, in turns so that a slow moment of the machine hits all of them alike."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from sand_sim.engine.explicit_dem import UnstableError
from sand_sim.scene.reading import read_scene
from sand_sim.scene.types import SceneError
from sand_sim.study.choices import REFERENCE, WRITTEN
from sand_sim.study.comparison import (
    Row,
    Spanned,
    best_of_groups,
    convergence_orders,
    mark_front,
    recommend,
)
from sand_sim.study.quantity import QUANTITIES
from sand_sim.study.sample import Sample, mean_sample
from sand_sim.study.variation import Facts, Variation, repeated
from sand_sim.world import World


@dataclass(frozen=True)
class Plan:
    """What a study does.

    Attributes:
        quantity: name of what is compared.
        tolerance: largest error that will do [1].
        repeats: runs of each setting, which differ by chance only.
        variations: tried.
    """

    quantity: str
    tolerance: float
    repeats: int
    variations: tuple[Variation, ...]


@dataclass
class Candidate:
    """A variation with its runs so far."""

    variation: Variation
    parsed: dict
    samples: list[Sample] = field(default_factory=list)
    refusal: str = ""


class Study:
    """A scene, its variations and their runs.

    Args:
        parsed: the scene that is varied, as YAML gives it.
        folder: where its relative paths start.
        plan: what to do.
        progress: called with a line on where the study is.
        check: called now and then; what it raises ends the study, and what was run until then stays.

    Raises:
        SceneError: if the scene or its reference cannot be run.
    """

    def __init__(
        self,
        parsed: dict,
        folder: Path,
        plan: Plan,
        progress: Callable[[str], None] = lambda line: None,
        check: Callable[[], None] = lambda: None,
    ):
        self.plan, self._parsed, self._folder, self._progress, self._check = plan, parsed, folder, progress, check
        scene = read_scene(parsed, folder)
        self.facts = Facts.of(scene)
        self._quantity = QUANTITIES[plan.quantity]
        self._exact = self._quantity.exact(scene)
        self.written = self._candidate(WRITTEN)
        self.reference = None if self._exact else self._candidate(REFERENCE)
        if self.reference and self.reference.refusal:
            raise SceneError(f"{REFERENCE.title}: {self.reference.refusal}")
        self._candidates = [one for one in (self.written, self.reference) if one]
        known = [scene]
        for variation in plan.variations:
            candidate = self._candidate(variation)
            if not candidate.refusal:
                varied = read_scene(candidate.parsed, folder)
                if varied in known:
                    continue  # the scene has it so already
                known.append(varied)
            self._candidates.append(candidate)
        self._begun = time.monotonic()

    def run(self) -> None:
        """Run all variations, then the best of each choice together.

        Raises:
            SceneError: if the scene as written or the reference cannot be run.
        """
        for repeat in range(self.plan.repeats):
            self._run_round(self._candidates, repeat)
        rows = self.rows()
        best = best_of_groups(rows, self._row(self.written), self.plan.tolerance)
        if len(best) < 2:
            return
        named = {one.variation.title: one.variation for one in self._candidates}
        chosen = [named[row.title] for row in best]
        edits = tuple(edit for variation in chosen for edit in variation.edits)
        together = self._candidate(Variation("together", ", ".join(one.title for one in chosen), edits))
        self._candidates.append(together)
        for repeat in range(self.plan.repeats):
            self._run_round([self.written, together], self.plan.repeats + repeat)

    def rows(self) -> list[Row]:
        """What came of all settings that were run or refused; empty while there is nothing to compare with."""
        if not self._reference_samples():
            return []
        return mark_front([self._row(one) for one in self._candidates if one.samples or one.refusal])

    def recommendation(self) -> tuple[Variation, Row] | None:
        """The cheapest setting within the tolerance, None if there is none."""
        rows = [row for row in self.rows() if row.title != REFERENCE.title]
        row = recommend(rows, self._row(self.written), self.plan.tolerance)
        if row is None:
            return None
        return next((one.variation, row) for one in self._candidates if one.variation.title == row.title)

    def orders(self) -> dict[str, float]:
        """Measured convergence order in the time step where there is a closed form, else nothing: chance hides it."""
        if not self._exact:
            return {}
        return convergence_orders([row for row in self.rows() if row.group in ("", "time step")])

    def scatter(self) -> float | None:
        """How far two sets of runs of the reference lie from one another by chance: errors below it mean nothing [1]."""
        error = self._row(self.reference).error if self.reference else None
        return error and error.middle

    def _candidate(self, variation: Variation) -> Candidate:
        candidate = Candidate(variation, self._parsed)
        try:
            candidate.parsed = variation.apply(self._parsed, self.facts)
            read_scene(candidate.parsed, self._folder)
        except SceneError as error:
            candidate.refusal = str(error)
        return candidate

    def _run_round(self, candidates: Iterable[Candidate], repeat: int) -> None:
        runnable = [one for one in candidates if not one.refusal]
        for number, one in enumerate(runnable, 1):
            self._check()
            further = " of the best together" if repeat >= self.plan.repeats else ""
            where = f"repeat {repeat % self.plan.repeats + 1}/{self.plan.repeats}{further}, setting {number}/{len(runnable)}"
            self._progress(f"{where}, {time.monotonic() - self._begun:.0f} s: {one.variation.title}")
            try:
                scene = read_scene(repeated(one.parsed, repeat, self.facts), self._folder)
                world = World(scene, lambda stage, share: self._check())
                one.samples.append(self._quantity.measure(world, self._check))
            except (SceneError, UnstableError) as error:
                if one in (self.written, self.reference):
                    raise SceneError(f"{one.variation.title}: {error}") from None
                one.refusal = f"unstable: {error}" if isinstance(error, UnstableError) else str(error)

    def _reference_samples(self) -> list[Sample]:
        return [self._exact] if self._exact else self.reference.samples

    def _row(self, candidate: Candidate) -> Row:
        variation, samples = candidate.variation, candidate.samples
        row = Row(variation.group, variation.name, refusal=candidate.refusal, runs=len(samples))
        if not samples or candidate.refusal:
            return row
        errors = self._errors(candidate)
        return replace(
            row,
            error=errors.pop("", None),
            time=Spanned.of([one.wall for one in samples]),
            parts=errors,
            time_step=samples[0].time_step,
            steps=samples[0].steps,
            doubts=tuple(dict.fromkeys(doubt for one in samples for doubt in one.doubts)),
        )

    def _errors(self, candidate: Candidate) -> dict[str, Spanned]:
        """Distances from the reference by what is compared, and under the empty name the largest.

        With a closed form: median and range over the runs. Else runs are chaotic, and their mean is compared with the mean of the
        reference's runs; the range is that of leaving out one run. For the reference itself it is the distance that chance makes
        of two such means: a run lies ``sqrt(n / (n - 1))`` standard deviations from the mean of the others, the means of two
        sets of n runs lie ``sqrt(2 / n)`` apart.
        """
        samples, references, measure = candidate.samples, self._reference_samples(), self._quantity.errors
        if candidate is self.reference:
            number = len(samples)
            chance = [
                _scaled(measure(one, mean), np.sqrt(2.0 * (number - 1)) / number) for one, mean in _each_and_others(samples)
            ]
            middle = None
        elif self._exact:
            chance, middle = [measure(one, self._exact) for one in samples], None
        else:
            mean = mean_sample(references)
            chance = [measure(others, mean) for _, others in _each_and_others(samples)]
            middle = measure(mean_sample(samples), mean)
            chance.append(middle)
        if not chance:
            return {}
        tables = [{"": max(table.values())} | table for table in chance]
        spans = {name: Spanned.of([table[name] for table in tables]) for name in tables[0]}
        if middle is None:
            return spans
        return {name: replace(span, middle=tables[-1][name]) for name, span in spans.items()}


def _each_and_others(samples: list[Sample]) -> list[tuple[Sample, Sample]]:
    """Each run with the mean of the others; empty for a single run."""
    others = [[other for other in samples if other is not one] for one in samples]
    return [(one, mean_sample(rest)) for one, rest in zip(samples, others, strict=True) if rest]


def _scaled(errors: dict[str, float], factor: float) -> dict[str, float]:
    return {name: float(factor * error) for name, error in errors.items()}
