"""How scenes are studied: the package's own made short enough for one sitting, all others as they are."""

from dataclasses import dataclass
from pathlib import Path

from sand_sim.config_folder import config_folder
from sand_sim.scene.types import Scene
from sand_sim.study.choices import CHOICES, stepped
from sand_sim.study.quantity import choose_quantity
from sand_sim.study.variation import Edit, Variation, times, to

TOLERANCES = {"impact": 0.01, "spread": 0.1, "wrench": 0.2}  # [1]


WHOLE = Variation("", "")  # nothing is left out


@dataclass(frozen=True)
class Preparation:
    """How a scene is studied.

    Attributes:
        quantity: name of what is compared.
        variations: tried.
        shortening: edits that make the scene cheaper before it is varied, and what they do in words.
        quick: further ones for a quick study.
        repeats: runs of each setting, in a whole study.
    """

    quantity: str
    variations: tuple[Variation, ...] = CHOICES
    shortening: Variation = WHOLE
    quick: Variation = WHOLE
    repeats: int = 3


_IMPACT = Preparation("impact", (*CHOICES, stepped(8.0, quick=True)), repeats=8)
_COLUMN = Preparation(
    "spread",
    quick=Variation(
        "",
        "grains 1.3 times as large, up to 0.25 s",
        (Edit("fills.*.radius", times(1.3)), Edit("duration", to(0.25)), Edit("settle.time", to(0.2))),
    ),
)
_DIG = Preparation(
    "wrench",
    shortening=Variation(
        "",
        "grains 1.3 times as large, bed 0.45 m long, up to 1.2 s, 0.9 s of them in the cut",
        (
            Edit("fills.*.radius", times(1.3)),
            Edit("tools.*.particle_radius", times(1.3)),
            Edit("fills.*.region.high.0", to(0.45)),
            Edit("boundaries.*.high.0", to(0.45)),
            Edit("settle.time", to(0.4)),
            Edit("duration", to(1.2)),
        ),
    ),
    quick=Variation(
        "",
        "grains another 1.2 times as large",
        (Edit("fills.*.radius", times(1.2)), Edit("tools.*.particle_radius", times(1.2)), Edit("settle.time", to(0.3))),
    ),
)
_READY = {"impact.yaml": _IMPACT, "column.yaml": _COLUMN, "dig.yaml": _DIG}


def prepare(path: Path, scene: Scene, grains: int, quantity: str | None) -> Preparation:
    """How to study a scene file: as it is, unless it is one of the package's own.

    Args:
        path: of the file.
        scene: read from it.
        grains: number of them.
        quantity: name of what is compared, None to choose it.
    """
    own = _READY.get(path.name) if path.resolve().parent == config_folder().resolve() else None
    if own and quantity in (None, own.quantity):
        return own
    return Preparation(quantity or choose_quantity(scene, grains))
