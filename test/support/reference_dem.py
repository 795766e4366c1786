"""An independent DEM in NumPy, float64, all pairs: spheres between planes, with the laws of ``reference_laws.py``."""

from collections import defaultdict
from copy import deepcopy

import numpy as np
from reference_laws import respond


class ReferenceDem:
    """Frictional spheres and planes under two integrators.

    Args:
        position, velocity, spin: shape (n, 3) [m], [m/s], [rad/s].
        radius: shape (n,) [m].
        density: [kg/m^3].
        laws: name of the law per slot.
        pair: numbers between grains, and the same between grains and planes.
        planes: list of (point, normal).
        gravity: shape (3,) [m/s^2].
        dt: [s].
        integrator: ``symplectic_euler`` or ``velocity_verlet``.
    """

    def __init__(self, position, velocity, spin, radius, density, laws, pair, planes, gravity, dt, integrator):
        self.x, self.v, self.w = (np.array(a, float) for a in (position, velocity, spin))
        self.r, self.dt, self.g = np.asarray(radius, float), dt, np.asarray(gravity, float)
        self.m = density * 4.0 / 3.0 * np.pi * self.r**3
        self.inertia = 0.4 * self.m * self.r**2
        self.laws, self.planes, self.integrator = laws, planes, integrator
        self.pair = pair | {"dt": dt}
        self.memories = defaultdict(dict)
        self.half = None  # velocity and spin half a step ago

    def accelerations(self):
        """Of all grains, linear and angular."""
        force, torque = self.m[:, None] * self.g, np.zeros_like(self.x)
        n = len(self.r)
        hv, hw = self.half or (self.v, self.w)
        for i in range(n):
            for j in range(i + 1, n):
                apart = self.x[i] - self.x[j]
                distance = np.sqrt(apart @ apart)
                overlap, normal = self.r[i] + self.r[j] - distance, apart / distance
                if overlap < -0.5 * self.r[i]:
                    continue
                arm_i, arm_j = self.r[i] - overlap / 2.0, self.r[j] - overlap / 2.0
                at_i = self.v[i] + np.cross(self.w[i], -arm_i * normal)
                at_j = self.v[j] + np.cross(self.w[j], arm_j * normal)
                c = {"normal": normal, "overlap": overlap, "velocity": at_i - at_j, "spin": self.w[i] - self.w[j]}
                past, roll = hv[i] - hv[j], hw[i] - hw[j]
                lag = 0.5 * self.dt * (past - normal * (past @ normal)) / (self.r[i] + self.r[j])
                drift = past - np.cross(arm_i * hw[i] + arm_j * hw[j], normal - lag)
                c |= {"drift": drift, "roll": roll + lag * (roll @ normal) - normal * (roll @ lag)}
                c["radius"] = self.r[i] * self.r[j] / (self.r[i] + self.r[j])
                c["mass"] = self.m[i] * self.m[j] / (self.m[i] + self.m[j])
                c["least"] = min(self.r[i], self.r[j])
                pull, moment = respond(self.laws, c, self.pair, self.memories[i, j])
                force[i] += pull
                force[j] -= pull
                torque[i] += np.cross(-arm_i * normal, pull) + moment
                torque[j] += np.cross(arm_j * normal, -pull) - moment
        for k, (point, normal) in enumerate(self.planes):
            for i in range(n):
                distance = (self.x[i] - point) @ normal
                overlap = self.r[i] - distance
                if overlap < -0.5 * self.r[i]:
                    continue
                at = self.v[i] + np.cross(self.w[i], -distance * normal)
                c = {"normal": normal, "overlap": overlap, "velocity": at, "spin": self.w[i]}
                c |= {"drift": hv[i] + np.cross(hw[i], -distance * normal), "roll": hw[i]}
                c |= {"radius": self.r[i], "mass": self.m[i], "least": self.r[i]}
                pull, moment = respond(self.laws, c, self.pair, self.memories["plane", k, i])
                force[i] += pull
                torque[i] += np.cross(-distance * normal, pull) + moment
        return force / self.m[:, None], torque / self.inertia[:, None]

    def step(self):
        """One time step."""
        linear, angular = self.accelerations()
        if self.integrator == "symplectic_euler":
            self.v += linear * self.dt
            self.w += angular * self.dt
            self.x += self.v * self.dt
            return
        first = self.half is None
        v, w = (self.v, self.w) if first else self.half
        kick = 0.5 * self.dt if first else self.dt
        self.half = v + kick * linear, w + kick * angular
        self.x += self.half[0] * self.dt
        self.v, self.w = self.half[0] + 0.5 * self.dt * linear, self.half[1] + 0.5 * self.dt * angular

    def seen(self):
        """Velocity and spin of now, shape (n, 3) each: the half steps of velocity Verlet completed with the forces of now."""
        if self.half is None:
            return self.v, self.w
        kept = deepcopy(self.memories)
        linear, angular = self.accelerations()
        self.memories = kept
        return self.half[0] + 0.5 * self.dt * linear, self.half[1] + 0.5 * self.dt * angular
