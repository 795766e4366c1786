"""Reading the fills of a scene file."""

import math
from pathlib import Path

from sand_sim.scene.fields import Field
from sand_sim.scene.reading_boundaries import read_corners
from sand_sim.scene.shapes import SPHERE, TETRAHEDRON
from sand_sim.scene.types import Fill, SizeDistribution

_FEWEST = 0.01  # share of a normal distribution between its limits, so that radii are not drawn for ever


def read_fill(entry: Field, folder: Path) -> Fill:
    """One fill.

    Args:
        entry: mapping with its fields.
        folder: where relative paths start.

    Raises:
        SceneError: naming the field and how to mend it.
    """
    entry.keys(
        ("name", "material", "shape", "radius", "region", "count", "height", "file", "velocity", "seed"), required=("material",)
    )
    ways = [way for way in ("count", "height", "file") if way in entry]
    if len(ways) != 1:
        raise entry.refuse("give exactly one of 'count', 'height' and 'file'")
    if ways != ["file"] and not ("radius" in entry and "region" in entry):
        raise entry.refuse("the fields 'radius' and 'region' are needed unless the grains come from a file")
    if ways == ["file"] and (idle := [key for key in ("radius", "region", "seed") if key in entry]):
        raise entry[idle[0]].refuse("has no effect on grains from a file, which says where and how large they are; leave it out")
    low, high = entry.optional("region", read_corners, (None, None))
    return Fill(
        name=entry.optional("name", Field.text, entry.path),
        material=entry["material"].text(),
        shape=entry.optional("shape", lambda f: f.text() if f.value in (SPHERE, TETRAHEDRON) else f.file(folder), SPHERE),
        size=entry.optional("radius", _size, None),
        low=low,
        high=high,
        count=entry.optional("count", lambda f: f.whole(1), None),
        height=entry.optional("height", lambda f: f.number(above=0.0, unit="m"), None),
        file=entry.optional("file", lambda f: f.file(folder), None),
        velocity=entry.optional("velocity", Field.vector, (0.0, 0.0, 0.0)),
        seed=entry.optional("seed", lambda f: f.whole(0), 0),
    )


def _size(entry: Field) -> SizeDistribution:
    if not isinstance(entry.value, dict):
        return SizeDistribution("constant", mean=entry.number(above=0.0, unit="m"))
    if "uniform" in entry.value:
        low, high = entry.keys(("uniform",))["uniform"].vector(2)
        kind = SizeDistribution("uniform", low=low, high=high)
    elif "normal" in entry.value:
        normal = entry.keys(("normal",))["normal"].keys(("mean", "deviation", "low", "high"), ("mean", "deviation"))
        mean, deviation = normal["mean"].number(above=0.0, unit="m"), normal["deviation"].number(least=0.0, unit="m")
        low = normal.optional("low", lambda f: f.number(above=0.0, unit="m"), mean - 2.0 * deviation)
        high = normal.optional("high", Field.number, mean + 2.0 * deviation)
        if low <= 0.0:
            raise normal.refuse(f"is cut two deviations below the mean, at {low:g} m, which is no radius; give a 'low'")
        kind = SizeDistribution("normal", mean=mean, deviation=deviation, low=low, high=high)
        if low <= high and (share := _share_between(kind)) < _FEWEST:
            raise normal.refuse(
                f"of a mean of {mean:g} and a deviation of {deviation:g} only {share:.2g} lie between {low:g} and {high:g} [m], "
                f"at least {_FEWEST:g} must; move 'low' and 'high' apart, or nearer to the mean"
            )
    elif "table" in entry.value:
        table = entry.keys(("table",))["table"].keys(("radii", "weights", "by"), ("radii", "weights"))
        radii = tuple(r.number(above=0.0, unit="m") for r in table["radii"].entries())
        weights = tuple(w.number(least=0.0) for w in table["weights"].entries())
        if len(radii) != len(weights) or not sum(weights):
            raise table.refuse("needs as many weights as radii, and not all of them zero")
        if table.optional("by", lambda f: f.choice(("number", "mass")), "number") == "mass":
            weights = tuple(weight * (radii[0] / radius) ** 3 for weight, radius in zip(weights, radii, strict=True))
        return SizeDistribution("table", radii=radii, weights=weights)
    else:
        raise entry.refuse("must be a radius [m], or one of 'uniform', 'normal', 'table'")
    if not 0.0 < kind.low <= kind.high:
        raise entry.refuse(f"radii must be positive and in order, got {kind.low:g} to {kind.high:g} [m]")
    return kind


def _share_between(size: SizeDistribution) -> float:
    """Share of a normal distribution that its limits let through [1]."""
    if size.deviation == 0.0:
        return float(size.low <= size.mean <= size.high)
    below = [math.erf((limit - size.mean) / (math.sqrt(2.0) * size.deviation)) for limit in (size.low, size.high)]
    return 0.5 * (below[1] - below[0])
