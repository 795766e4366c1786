"""The results of a study as a table for people and as plain data for programs."""

import math

from sand_sim.study.comparison import Row, Spanned


def table_text(rows: list[Row]) -> str:
    """All settings, the fastest first, with the Pareto front marked ``*`` and those not to be trusted ``!``."""
    run = sorted((row for row in rows if row.time), key=lambda row: row.time.middle)
    lines = [("", "setting", "error (range)", "run time (range)", "time step", "steps")]
    for row in run:
        mark = "!" if row.doubts else "*" if row.front else ""
        error = _spanned(row.error, percent) if row.error else "unknown"
        lines.append((mark, row.title, error, _spanned(row.time, seconds), f"{row.time_step * 1e6:.3g} us", f"{row.steps:,}"))
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    text = ["  " + "  ".join(f"{cell:<{width}}" for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    for row in run:
        text += [f"  ! {row.title}: not to be trusted, {doubt}" for doubt in row.doubts]
    text += [f"  - {row.title}: not available, {row.refusal}" for row in rows if row.refusal]
    return "\n".join(text)


def plain_rows(rows: list[Row]) -> list[dict]:
    """All settings as JSON takes them, SI units."""
    return [
        {
            "group": row.group,
            "name": row.name,
            "error": _plain(row.error),
            "run_time_s": _plain(row.time),
            "errors": {name: _plain(value) for name, value in row.parts.items()},
            "time_step_s": row.time_step or None,
            "steps": row.steps,
            "runs": row.runs,
            "on_front": row.front,
            "doubts": list(row.doubts),
            "not_available": row.refusal or None,
        }
        for row in rows
    ]


def chance_text(scatter: float) -> str:
    """What is said of how far two sets of runs of the reference lie apart by chance [1]."""
    if scatter == 0.0:
        return "repeats do not differ, having no seeds or walls to vary, so that nothing is known of what chance does"
    return f"by chance alone, two sets of runs of the reference lie {percent(scatter)} apart; more --repeats lower that"


def percent(value: float) -> str:
    """A share in percent, three digits."""
    return f"{100.0 * value:.3g} %"


def seconds(value: float) -> str:
    """A time with three digits."""
    return f"{value:.3g} s" if value >= 0.1 else f"{1e3 * value:.3g} ms"


def _spanned(value: Spanned, show) -> str:
    return f"{show(value.middle)} ({show(value.low)} to {show(value.high)})"


def _plain(value: Spanned | None) -> dict | None:
    return value and {name: _finite(getattr(value, name)) for name in ("middle", "low", "high")}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
