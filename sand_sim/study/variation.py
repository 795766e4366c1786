"""Named edits of a scene as YAML gives it, before it is read: what a variation changes is data, and may be refused."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from sand_sim.assembly.assemble import assemble
from sand_sim.scene.types import Scene, SceneError, unit

_UNSCALED = ("weights",)  # numbers inside a scaled entry that are no lengths


@dataclass(frozen=True)
class Facts:
    """What the numbers of a variation are reckoned from, measured on the scene that it starts from.

    Attributes:
        step: safe time step [s].
        contact: shortest contact time [s].
        frame: time between two observations [s].
        radius: mean of the grains [m].
        mass: mean of the grains [kg].
        grains: number of them.
    """

    step: float
    contact: float
    frame: float
    radius: float
    mass: float
    grains: int

    @classmethod
    def of(cls, scene: Scene) -> "Facts":
        """Measure a scene.

        Raises:
            SceneError: if it cannot be made into a world.
        """
        assembly = assemble(scene)
        grains = assembly.solver.arrays.grains
        number = grains.active.get()
        return cls(
            step=assembly.time_step.safe,
            contact=assembly.time_step.contact,
            frame=1.0 / scene.frame_rate,
            radius=float(grains.place.numpy()[:number, 3].mean() * assembly.lattice.quantum),
            mass=float(grains.motion.numpy()[:number, 3].mean()),
            grains=number,
        )


Change = Callable[[Any, Facts], Any]  # from the entry as it is (None if absent) to what it becomes (None leaves it alone)


@dataclass(frozen=True)
class Edit:
    """A change of one entry; ``*`` in the path stands for all entries of a list or mapping, missing mappings are made."""

    path: str
    change: Change


@dataclass(frozen=True)
class Variation:
    """A scene with one choice made differently.

    Attributes:
        group: the choice.
        name: how it is made.
        edits: of the scene.
        quick: whether it belongs to a quick study.
    """

    group: str
    name: str
    edits: tuple[Edit, ...] = ()
    quick: bool = False

    def apply(self, parsed: dict, facts: Facts) -> dict:
        """The edited scene; ``parsed`` stays as it is."""
        edited = deepcopy(parsed)
        for edit in self.edits:
            _change(edited, edit.path.split("."), edit.change, facts)
        return edited

    @property
    def title(self) -> str:
        """Group and name."""
        return f"{self.group}: {self.name}" if self.group else self.name


def to(value: Any) -> Change:
    """Set an entry."""
    return lambda old, facts: value


def times(factor: float) -> Change:
    """Multiply an entry, or all numbers in it, where it is given."""
    return lambda old, facts: None if old is None else _scale(old, factor)


def counted(factor: float) -> Change:
    """Multiply a count where it is given."""
    return lambda old, facts: None if old is None else max(1, round(int(old) * factor))


def where_given(value: Any) -> Change:
    """Set an entry that the scene gives, leave it out where the scene does."""
    return lambda old, facts: None if old is None else value


def drawn(old: Any, facts: Facts) -> None:
    """Leave fills alone, but refuse a variation of their sizes where grains come from files, which no edit reaches.

    Raises:
        SceneError: if no fill is drawn.
    """
    if all(fill.get("file") is not None for fill in old or ()):
        raise SceneError("fills: none is drawn by its sizes, and grains from a file have those that it says")


def steps(factor: float) -> Change:
    """A multiple of the safe time step, shortened so that whole steps make a frame [s]."""
    return lambda old, facts: float(facts.frame / np.ceil(facts.frame / (factor * facts.step)))


def automatic(old: Any, facts: Facts) -> Any:
    """Make an entry ``auto`` where it is not so already."""
    return None if old in (None, "auto") else "auto"


def skins(factor: float) -> Change:
    """A multiple of the mean grain radius [m]."""
    return lambda old, facts: factor * facts.radius


def springs(factor: float) -> Change:
    """A linear stiffness, in multiples of the one whose contacts between mean grains last as long as Hertz's shortest [N/m].

    ``k = m* (pi / t_c)^2`` with ``m*`` half the mass of a grain.
    """
    return lambda old, facts: factor * 0.5 * facts.mass * (np.pi / facts.contact) ** 2


def dampers(factor: float) -> Change:
    """A linear damping, in multiples of ``pi m*/t_c``, which slows mean grains down within a contact time [N s/m]."""
    return lambda old, facts: factor * 0.5 * facts.mass * np.pi / facts.contact


def repeated(parsed: dict, repeat: int, facts: Facts) -> dict:
    """A scene that differs from ``parsed`` by chance only, to see how much chance does; repeat zero is the scene itself.

    Fills take other seeds. Where grains come from a file, or there are none beside bodies, planes are moved back by up to a
    thousandth of a radius instead, so that contacts begin elsewhere within a time step and sums round differently; without planes
    all other walls are, but for cylinders and cones, which stand on something.
    """
    changed, random = deepcopy(parsed), np.random.default_rng(repeat)
    if repeat == 0:
        return changed
    fills = changed.get("fills") or []
    sown = [fill for fill in fills if fill.get("file") is None]
    for fill in sown:
        fill["seed"] = int(fill.get("seed") or 0) + 1000 * repeat
    if len(sown) < len(fills) or not fills:
        walls = changed.get("boundaries") or ()
        for wall in [wall for wall in walls if wall.get("type") == "plane"] or walls:
            _move_back(wall, 1e-3 * facts.radius * random.uniform())
    return changed


def _move_back(wall: dict, way: float) -> None:
    """Move a wall away from the grains, which lie above a terrain [m]; cylinders and cones stay where they are."""
    if "normal" in wall:
        wall["point"] = _shifted(wall["point"], -way * unit(wall["normal"]))
    elif "low" in wall:
        wall["low"], wall["high"] = _shifted(wall["low"], [-way] * 3), _shifted(wall["high"], [way] * 3)
    elif wall.get("type") == "terrain":
        pose = wall.get("pose") or {}
        wall["pose"] = pose | {"position": _shifted(pose.get("position", [0.0] * 3), [0.0, 0.0, -way])}


def _shifted(place: Any, by: Any) -> list[float]:
    return [float(p) + float(s) for p, s in zip(place, by, strict=True)]


def _scale(value: Any, factor: float) -> Any:
    if isinstance(value, dict):
        return {key: inner if key in _UNSCALED else _scale(inner, factor) for key, inner in value.items()}
    if isinstance(value, list):
        return [_scale(inner, factor) for inner in value]
    return float(f"{float(value) * factor:.6g}")


def _change(node: Any, keys: list[str], change: Change, facts: Facts) -> None:
    key, *rest = keys
    if key == "*":
        for inner in node.values() if isinstance(node, dict) else node or ():
            _change(inner, rest, change, facts)
        return
    if not isinstance(node, dict | list):
        raise ValueError(f"'{key}' is asked of {node}, which has no entries")
    if isinstance(node, list) and not (key.isdecimal() and int(key) < len(node)):
        raise ValueError(f"'{key}' is none of the numbers from 0 to {len(node) - 1}")
    place = int(key) if isinstance(node, list) else key
    present = isinstance(node, list) or place in node
    if rest:
        there = present and node[place] is not None  # a section may be left empty
        inner = node[place] if there else {}
        _change(inner, rest, change, facts)
        if not there and inner:
            node[place] = inner
        return
    new = change(node[place] if present else None, facts)
    if new is not None:
        node[place] = float(new) if isinstance(new, np.floating) else new
