"""The stability study: every extreme case and the map, and what comes of them."""

import json
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from sand_sim.study.bed_cases import bed_cases
from sand_sim.study.bench import Bench
from sand_sim.study.contact_cases import impact_cases
from sand_sim.study.friction_cases import friction_cases
from sand_sim.study.stability_map import Cell, grid, limits_found, run_cell
from sand_sim.study.tool_cases import tool_cases
from sand_sim.study.verdict import WRONG, Case, Finding, examine


@dataclass
class Sweep:
    """All findings.

    Attributes:
        findings: of the cases.
        cells: of the map.
    """

    findings: list[Finding] = field(default_factory=list)
    cells: list[Cell] = field(default_factory=list)

    @property
    def bad(self) -> list[str]:
        """Names of what must not be: silent errors, and automatic steps that are not stable."""
        named = [f"{one.group}: {one.name}" for one in self.findings if one.bad]
        return named + [
            f"map: {cell.scene}, E = {cell.young:.0e} Pa, {cell.ratio:g} of the limit"
            for cell in self.cells
            if cell.verdict == WRONG
        ]

    def as_dict(self) -> dict:
        """Plain values for JSON, infinities as null."""
        limits = [
            {"scene": scene, "young_Pa": young, "stable_at": low, "unstable_at": high if high < float("inf") else None}
            for scene, young, low, high in limits_found(self.cells)
        ]
        cells = [asdict(cell) | {"error": cell.error if cell.error < float("inf") else None} for cell in self.cells]
        return {"bad": self.bad, "cases": [one.as_dict() for one in self.findings], "limits_found": limits, "map": cells}

    def save(self, path: Path) -> None:
        """Write a JSON file."""
        path.write_text(json.dumps(self.as_dict(), indent=1, default=float) + "\n")


def all_cases(quick: bool = False) -> list[Case]:
    """The extreme cases, group by group."""
    cases = [
        case for source in (impact_cases, friction_cases, bed_cases, tool_cases) for case in source() if case.quick or not quick
    ]
    groups = list(dict.fromkeys(case.group for case in cases))
    return sorted(cases, key=lambda case: groups.index(case.group))


def sweep(
    quick: bool = False,
    progress: Callable[[str, float], None] = lambda what, share: None,
    check: Callable[[], None] = lambda: None,
) -> Sweep:
    """Run everything.

    Args:
        quick: fewer cases and a coarser map.
        progress: called with what is run next and the share that is done, 0 to 1.
        check: called now and then; may raise to give up.
    """
    cases, cells, result = all_cases(quick), grid(quick), Sweep()
    total = len(cases) + len(cells)
    for done, case in enumerate(cases):
        progress(f"{case.group}: {case.name}", done / total)
        result.findings.append(examine(case, check))
    for done, (scene, young, ratio) in enumerate(cells):
        progress(f"map: {scene}, E = {young:.0e} Pa, {ratio:g} of the limit", (len(cases) + done) / total)
        with tempfile.TemporaryDirectory() as folder:
            result.cells.append(run_cell(Bench(Path(folder), check), scene, young, ratio))
    return result


def table_text(result: Sweep) -> str:
    """All findings as lines of text."""
    lines, group = [], None
    for one in result.findings:
        if one.group != group:
            group = one.group
            lines.append(f"\n{group}")
        mark = "  <- must not be" if one.bad else ""
        lines.append(f"  {one.verdict:<14}  {one.name}{mark}")
        told = one.reason or _worst(one)
        if told:
            lines.append(f"  {'':<14}  {told}")
    if result.cells:
        lines.append("\nlargest stable time step over the predicted limit, found between")
    for scene, young, low, high in limits_found(result.cells):
        lines.append(f"  {scene:<14}  E = {young:.0e} Pa: {low:g} and {high:g}")
    counts = {}
    for one in result.findings:
        counts[one.verdict] = counts.get(one.verdict, 0) + 1
    lines.append(f"\n{len(result.findings)} cases: " + ", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
    lines.append(f"{len(result.bad)} that must not be" + "".join(f"\n  {name}" for name in result.bad))
    return "\n".join(lines).lstrip("\n")


def _worst(finding: Finding) -> str:
    """The check nearest to its tolerance."""
    if not finding.checks:
        return ""
    worst = max(finding.checks, key=lambda check: check.error)
    return f"{worst.what} {worst.value:.5g}, {worst.source or 'expected'} {worst.expected:.5g} +- {worst.tolerance:.2g}"
