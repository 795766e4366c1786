"""An independent DEM in NumPy, float64, all pairs: the yardstick for the kernels, written from the equations."""

import numpy as np


class ReferenceDem:
    """Frictional spheres between planes, Hertz-Mindlin with history, symplectic Euler.

    Args:
        position, velocity, spin: shape (n, 3) [m], [m/s], [rad/s].
        radius: shape (n,) [m].
        density: [kg/m^3].
        young, shear: effective moduli E* and G* between grains [Pa].
        ratio: damping ratio z of the Hertz contact [1].
        friction: mu [1].
        planes: list of (point, normal, E*, G*).
        gravity: shape (3,) [m/s^2].
        dt: [s].
    """

    def __init__(self, position, velocity, spin, radius, density, young, shear, ratio, friction, planes, gravity, dt):
        self.x, self.v, self.w = (np.array(a, float) for a in (position, velocity, spin))
        self.r, self.dt, self.g = np.asarray(radius, float), dt, np.asarray(gravity, float)
        self.m = density * 4.0 / 3.0 * np.pi * self.r**3
        self.inertia = 0.4 * self.m * self.r**2
        self.young, self.shear, self.ratio, self.friction, self.planes = young, shear, ratio, friction, planes
        n = len(self.r)
        self.spring = np.zeros((n, n, 3))
        self.plane_spring = np.zeros((len(planes), n, 3))

    def step(self):
        """One time step."""
        force, torque = self.m[:, None] * self.g, np.zeros_like(self.x)
        n = len(self.r)
        for i in range(n):
            for j in range(i + 1, n):
                apart = self.x[i] - self.x[j]
                distance = np.sqrt(apart @ apart)
                overlap = self.r[i] + self.r[j] - distance
                if overlap <= 0.0:
                    self.spring[i, j] = 0.0
                    continue
                normal = apart / distance
                arm_i, arm_j = self.r[i] - overlap / 2.0, self.r[j] - overlap / 2.0
                at_i = self.v[i] + np.cross(self.w[i], -arm_i * normal)
                at_j = self.v[j] + np.cross(self.w[j], arm_j * normal)
                radius = self.r[i] * self.r[j] / (self.r[i] + self.r[j])
                mass = self.m[i] * self.m[j] / (self.m[i] + self.m[j])
                contact = self._contact(normal, overlap, at_i - at_j, radius, mass, self.young, self.shear, self.spring[i, j])
                push, drag, self.spring[i, j] = contact
                force[i] += push + drag
                force[j] -= push + drag
                torque[i] += np.cross(-arm_i * normal, drag)
                torque[j] += np.cross(arm_j * normal, -drag)
        for k, (point, normal, young, shear) in enumerate(self.planes):
            for i in range(n):
                distance = (self.x[i] - point) @ normal
                overlap = self.r[i] - distance
                if overlap <= 0.0:
                    self.plane_spring[k, i] = 0.0
                    continue
                at = self.v[i] + np.cross(self.w[i], -distance * normal)
                contact = self._contact(normal, overlap, at, self.r[i], self.m[i], young, shear, self.plane_spring[k, i])
                push, drag, self.plane_spring[k, i] = contact
                force[i] += push + drag
                torque[i] += np.cross(-distance * normal, drag)
        self.v += force / self.m[:, None] * self.dt
        self.w += torque / self.inertia[:, None] * self.dt
        self.x += self.v * self.dt

    def _contact(self, normal, overlap, velocity, radius, mass, young, shear, spring):
        approach = velocity @ normal
        slip = velocity - approach * normal
        patch = np.sqrt(radius * overlap)
        push = 4.0 / 3.0 * young * np.sqrt(radius) * overlap**1.5
        push -= 2.0 * self.ratio * np.sqrt(2.0 * young * patch * mass) * approach
        push = max(push, 0.0)
        stiffness = 8.0 * shear * patch
        viscosity = 2.0 * self.ratio * np.sqrt(stiffness * mass)
        spring = spring - (spring @ normal) * normal + slip * self.dt
        drag = -stiffness * spring - viscosity * slip
        size = np.sqrt(drag @ drag)
        if size > self.friction * push:
            drag = drag * (self.friction * push / size)
            spring = -(drag + viscosity * slip) / stiffness
        return push * normal, drag, spring
