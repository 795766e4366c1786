"""What the command line says about a body."""

import numpy as np

from sampler.body import ParticleBody
from sampler.mass import MassProperties


def report_table(body: ParticleBody, mass: MassProperties | None, seconds: dict[str, float]) -> str:
    """A table of two columns: size, defects mended, particles, spacing, coverage, walls, mass, time.

    Args:
        body: that was made.
        mass: where a density or mass was given.
        seconds: time that each stage took [s].
    """
    even, h = body.evenness, body.spacing
    mended = ", ".join(f"{count} {name}" for name, count in body.steps.items() if count) or "nothing"
    size = np.ptp(body.triangles.reshape(-1, 3), axis=0)
    rows = [
        ("size", " x ".join(_length(x) for x in size)),
        ("mended", mended),
        ("particles", f"{len(body)} of radius {_length(body.radius)} on {body.area:.4g} m^2"),
        ("spacing h", f"{_length(h)}, {h / body.radius:.2f} radii"),
        ("nearest neighbour", f"{even.nearest:.2f} to {even.farthest:.2f} h, coefficient of variation {even.variation:.3f}"),
        ("coverage", f"{_length(body.coverage)}, {even.coverage:.2f} h; along each skin {even.skin_coverage:.2f} h"),
        ("stops grains of", f"radius {_length(body.smallest_grain)} and more" if body.smallest_grain else "any radius"),
        ("thinnest wall", _length(body.thinnest_wall)),
        ("volume", f"{body.volume:.6g} m^3"),
        ("centre", " ".join(f"{x:.6g}" for x in body.centre) + " m"),
    ]
    if mass:
        rows.append(("mass", f"{mass.mass:.6g} kg"))
        rows.append(("principal inertia", " ".join(f"{x:.6g}" for x in mass.principal) + " kg m^2"))
    rows.append(("time", ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())))
    rows += [("warning", text) for text in (*body.warnings, *body.mass_warnings)]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _length(value: float) -> str:
    return f"{1000.0 * value:.4g} mm" if value < 10.0 else f"{value:.4g} m"
