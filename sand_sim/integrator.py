"""Names of the integrators."""

EULER, VERLET = INTEGRATORS = ("symplectic_euler", "velocity_verlet")
