"""Error against run time of all settings of a study, with the Pareto front. Needs matplotlib."""

from pathlib import Path

import numpy as np

from sand_sim.study.comparison import Row

_LEAST = 1e-7  # error that is drawn where there is none


def draw_pareto(rows: list[Row], tolerance: float, scatter: float | None, recommended: str, title: str, path: Path) -> None:
    """Draw a PNG file.

    Args:
        rows: settings; those that were not run are left out, those not to be trusted are drawn as crosses.
        tolerance: largest error that will do [1].
        scatter: of the reference by chance [1], None if it has none.
        recommended: title of a row, empty for none.
        title: of the figure.
        path: of the file; its folder is made.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    shown = [row for row in rows if row.time and row.error and np.isfinite(row.error.middle)]
    groups = list(dict.fromkeys(row.group or row.name for row in shown))
    colours = {group: plt.get_cmap("tab10")(k % 10) for k, group in enumerate(groups)}
    figure, axis = plt.subplots(figsize=(10.5, 6.4), layout="constrained")
    axis.set_xscale("log")
    axis.set_yscale("log")
    for row in shown:
        x, y = row.time.middle, max(row.error.middle, _LEAST)
        axis.errorbar(
            x,
            y,
            xerr=[[x - row.time.low], [row.time.high - x]],
            yerr=[[y - max(row.error.low, _LEAST)], [max(row.error.high, _LEAST) - y]],
            fmt="X" if row.doubts else "o",
            color=colours[row.group or row.name],
            mfc="white" if row.doubts else None,
            ms=7,
            lw=0.9,
            zorder=3,
        )
    front = sorted((row.time.middle, max(row.error.middle, _LEAST)) for row in shown if row.front)
    if front:
        axis.plot(*zip(*front, strict=True), color="black", lw=1.0, ls="-", zorder=2, label="Pareto front")
    for row in shown:
        if row.title == recommended:
            spot = (row.time.middle, max(row.error.middle, _LEAST))
            axis.plot(*spot, "o", ms=17, mfc="none", mec="black", mew=1.4, zorder=4, ls="none", label="recommended")
    axis.axhline(tolerance, color="tab:green", ls="--", lw=1.1, label=f"tolerance {100.0 * tolerance:g} %")
    if scatter:
        axis.axhline(scatter, color="grey", ls=":", lw=1.1, label=f"chance alone {100.0 * scatter:.2g} %")
    axis.plot([], [], "X", color="grey", mfc="white", ls="none", label="not to be trusted")
    _label(axis, shown, colours)
    axis.set_xlabel("run time of the steps [s], median and range")
    axis.set_ylabel("largest relative error and its range")
    axis.set_title(title, fontsize=10, loc="left")
    axis.grid(alpha=0.25, which="both")
    axis.legend(fontsize=8, loc="best")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _label(axis, rows: list[Row], colours: dict) -> None:
    """Write the settings' names in a column beside the axes, each tied to its point, so that none hides another."""
    ordered = sorted(rows, key=lambda row: row.error.middle)
    low, high = (np.log10(value) for value in axis.get_ylim())
    for k, row in enumerate(ordered):
        height = 10.0 ** (low + (high - low) * (k + 0.5) / len(ordered))
        colour = colours[row.group or row.name]
        axis.annotate(
            row.title if len(row.title) <= 44 else row.title[:43] + "…",
            (row.time.middle, max(row.error.middle, _LEAST)),
            xytext=(1.015, height),
            textcoords=axis.get_yaxis_transform(),
            fontsize=7,
            va="center",
            color=colour,
            fontweight="bold" if row.front else "normal",
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.4, "alpha": 0.45, "shrinkA": 0, "shrinkB": 3},
            annotation_clip=False,
        )
