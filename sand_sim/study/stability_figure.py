"""The picture of the map of stability."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from sand_sim.study.stability_map import STOPPED, Cell
from sand_sim.study.verdict import FLAGGED, RIGHT, WRONG

_MARKS = {
    RIGHT: ("o", "right"),
    FLAGGED: ("^", "flagged"),
    STOPPED: ("x", "stopped within a frame"),
    WRONG: ("D", "silently wrong"),
}
_TITLES = {
    "impact": ("One elastic impact", "relative error of the rebound speed", 1e-5, 1e1),
    "bed": ("Confined bed, restitution 0.5", "kinetic energy / that at the start", 1e-6, 1e6),
}


def draw_map(cells: list[Cell], path: Path) -> None:
    """Draw both maps with the predicted limit and the automatic step.

    Args:
        cells: of the map.
        path: PNG file.
    """
    scenes = [scene for scene in _TITLES if any(cell.scene == scene for cell in cells)]
    figure, axes = plt.subplots(1, len(scenes), figsize=(6.6 * len(scenes), 4.8), squeeze=False, layout="constrained")
    for axis, scene in zip(axes[0], scenes, strict=True):
        _draw_scene(axis, scene, [cell for cell in cells if cell.scene == scene])
    used = dict.fromkeys(cell.verdict for cell in cells)
    handles = [
        Line2D([], [], linestyle="", marker=_MARKS[v][0], markerfacecolor="none", markeredgecolor="black", label=_MARKS[v][1])
        for v in _MARKS
        if v in used
    ]
    handles.append(Line2D([], [], color="red", label="predicted limit"))
    handles.append(Line2D([], [], color="black", linestyle="--", label="automatic step"))
    handles.append(Line2D([], [], color="black", linestyle=":", label="refused beyond, unless forced"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _draw_scene(axis, scene: str, cells: list[Cell]) -> None:
    title, label, low, high = _TITLES[scene]
    ratios, youngs = (sorted({getattr(cell, name) for cell in cells}) for name in ("ratio", "young"))
    errors = np.full((len(youngs), len(ratios)), np.nan)
    for cell in cells:
        errors[youngs.index(cell.young), ratios.index(cell.ratio)] = np.clip(cell.error, low, high)
    norm = LogNorm(low, high)
    shown = axis.pcolormesh(_edges(ratios), np.arange(len(youngs) + 1) - 0.5, errors, norm=norm, cmap="RdYlGn_r")
    for verdict, (mark, _) in _MARKS.items():
        own = [cell for cell in cells if cell.verdict == verdict]
        style = {"color": "black"} if mark == "x" else {"facecolors": "none", "edgecolors": "black"}
        axis.scatter([c.ratio for c in own], [youngs.index(c.young) for c in own], marker=mark, s=28, linewidths=0.9, **style)
    axis.axvline(1.0, color="red", linewidth=1.8)
    automatic = [np.median([c.automatic for c in cells if c.young == young]) for young in youngs]
    for factor, line in ((1.0, "--"), (3.0, ":")):
        steps = factor * np.repeat(automatic, 2)
        axis.plot(steps, np.repeat(np.arange(len(youngs)), 2) + np.tile([-0.5, 0.5], len(youngs)), "k" + line, linewidth=1.4)
    axis.set_xscale("log")
    axis.set_xlim(_edges(ratios)[0], _edges(ratios)[-1])
    ticks = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0]
    axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()
    axis.set_yticks(range(len(youngs)), [f"{young:.0e}" for young in youngs])
    axis.set(title=title, xlabel="time step / predicted limit", ylabel="Young's modulus / Pa")
    axis.figure.colorbar(shown, ax=axis, label=label, extend="both")


def _edges(centres: list[float]) -> np.ndarray:
    """Edges of cells around centres on a logarithmic axis."""
    logs = np.log(centres)
    middle = 0.5 * (logs[1:] + logs[:-1])
    return np.exp(np.concatenate([[2 * logs[0] - middle[0]], middle, [2 * logs[-1] - middle[-1]]]))
