"""The choices that trade accuracy for time, and the settings of each that a study tries."""

from sand_sim.study.variation import (
    Edit,
    Variation,
    automatic,
    counted,
    dampers,
    drawn,
    skins,
    springs,
    steps,
    times,
    to,
    where_given,
)

WRITTEN = Variation("", "as written", (), quick=True)


def stepped(divisor: float, quick: bool = False) -> Variation:
    """The safe time step divided by a number."""
    name = f"safe / {divisor:g}" if divisor >= 1.0 else f"safe x {1.0 / divisor:g}"
    return Variation("time step", name, (Edit("solver.time_step", steps(1.0 / divisor)),), quick)


def stiff(factor: float, quick: bool = False) -> Variation:
    """All materials stiffer or softer, and linear springs, which do not follow them."""
    paths = "materials.*.young", "pairs.*.stiffness", "pairs.*.shear_stiffness"
    return Variation("stiffness", f"E x {factor:g}", tuple(Edit(path, times(factor)) for path in paths), quick)


def coarse(factor: float, quick: bool = False) -> Variation:
    """Larger grains, as many as fill the same space."""
    # Tool particles grow with the grains, which else would touch many of them at once.
    edits = (Edit("fills", drawn), Edit("fills.*.radius", times(factor)), Edit("fills.*.count", counted(factor**-3)))
    edits += (Edit("tools.*.particle_radius", times(factor)),)
    return Variation("grain size", f"radius x {factor:g}", edits, quick)


def _skin(factor: float, quick: bool = False) -> Variation:
    return Variation("skin", f"{factor:g} radii", (Edit("solver.skin", skins(factor)),), quick)


def _rolling(friction: float, quick: bool = False) -> Variation:
    edits = (
        Edit("fills.*.shape", where_given("sphere")),
        Edit("contact.rolling", to("constant")),
        Edit("pairs.*.rolling_friction", to(friction)),
    )
    return Variation("shape", f"spheres, rolling friction {friction:g}", edits, quick)


_LINEAR = (Edit("contact.normal", to("linear")), Edit("pairs.*.stiffness", springs(1.0)))
_LINEAR_SHEAR = (Edit("contact.tangential", to("linear")), Edit("pairs.*.shear_stiffness", springs(2.0 / 7.0)))
_VISCOUS = (Edit("contact.tangential", to("viscous")), Edit("pairs.*.shear_viscosity", dampers(2.0 / 7.0)))

CHOICES = (
    stepped(0.5, quick=True),
    Variation("time step", "safe", (Edit("solver.time_step", automatic),)),
    stepped(2.0, quick=True),
    stepped(4.0),
    stiff(0.1, quick=True),
    stiff(0.3),
    stiff(3.0),
    Variation("integrator", "symplectic Euler", (Edit("solver.integrator", to("symplectic_euler")),)),
    Variation("integrator", "velocity Verlet", (Edit("solver.integrator", to("velocity_verlet")),), quick=True),
    Variation("precision", "single", (Edit("solver.precision", to("single")),)),
    Variation("precision", "double", (Edit("solver.precision", to("double")),), quick=True),
    Variation("contact law", "linear", _LINEAR, quick=True),
    Variation("contact law", "linear, linear friction", (*_LINEAR, *_LINEAR_SHEAR)),
    Variation("contact law", "no friction", (Edit("contact.tangential", to("none")),)),
    Variation("contact law", "viscous friction", _VISCOUS),
    Variation("contact law", "friction rescaled", (Edit("contact.tangential", to("mindlin_rescaled")),)),
    _rolling(0.02),
    _rolling(0.1, quick=True),
    Variation("shape", "tetrahedra of spheres", (Edit("fills.*.shape", to("tetrahedron")),), quick=True),
    coarse(1.5, quick=True),
    coarse(2.0),
    _skin(0.1),
    _skin(0.5, quick=True),
)

# What the others are compared with where there is no closed form: the scene as written, resolved as finely as can be afforded.
REFERENCE = Variation("reference", "safe / 4, double", (*stepped(4.0).edits, Edit("solver.precision", to("double"))), quick=True)
