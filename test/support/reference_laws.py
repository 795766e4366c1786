"""Contact laws in NumPy, float64, written from the equations of their sources: the yardstick for the kernels.

A contact is a dict of normal (from b to a), overlap, velocity of a against b at the contact point, spin of a against b, both also
over the last step (drift, roll), radius R*, mass m*, and the radius of the smaller body. A pair is a dict of numbers, a memory a
dict that the laws write to.
"""

import numpy as np

JUST_NOW = 0.01  # of a step


def split(vector, normal):
    """Parts along a unit normal and across it."""
    along = vector @ normal
    return along, vector - along * normal


def cut(vector, length):
    """The vector, no longer than a length."""
    size = np.linalg.norm(vector)
    return vector * (length / size) if size > length else vector


def turned(spring, normal):
    """A spring turned into the tangent plane; it keeps its length but for what a turn by a milliradian takes."""
    out, flat = split(spring, normal)
    length = np.linalg.norm(flat)
    if length > 0.0 and abs(out) > 1e-3 * length:
        flat *= np.linalg.norm(spring) / length / np.sqrt(1.0 + 1e-6)
    return flat


def damped(c, p):
    """How long the dampers of this step act over the step, and the overlap they see: from touch to half a step on if bodies met
    within the step before; the mean of the fourth root of an overlap that grows from zero is that of 0.8^4 of it. Where they met
    in the last hundredth of a step nothing acts until the step after.
    """
    rate, _ = split(c["velocity"], c["normal"])
    since_touch = c["overlap"] / -rate if rate < 0.0 else np.inf
    if since_touch < JUST_NOW * p["dt"]:
        return 0.0, c["overlap"]
    if since_touch < (1.0 + JUST_NOW) * p["dt"]:
        span = since_touch + 0.5 * p["dt"]
        return span / p["dt"], 0.8**4 * span * -rate
    return 1.0, c["overlap"]


def growth(c, p):
    """Time over which springs have grown: a step, or that since touch."""
    rate, _ = split(c["velocity"], c["normal"])
    since_touch = c["overlap"] / -rate if rate < 0.0 else np.inf
    if since_touch < (1.0 + JUST_NOW) * p["dt"]:
        return since_touch if since_touch > JUST_NOW * p["dt"] else 0.0
    return p["dt"]


def hertz(c, p, memory):
    rate, _ = split(c["velocity"], c["normal"])
    share, overlap = damped(c, p)
    elastic = 4.0 / 3.0 * p["young"] * np.sqrt(c["radius"]) * c["overlap"] ** 1.5
    stiffness = 2.0 * p["young"] * np.sqrt(c["radius"] * overlap)
    return max(elastic - share * 2.0 * p["ratio"] * np.sqrt(stiffness * c["mass"]) * rate, 0.0)


def linear_normal(c, p, memory):
    rate, _ = split(c["velocity"], c["normal"])
    viscosity = damped(c, p)[0] * 2.0 * p["linear_ratio"] * np.sqrt(p["stiffness"] * c["mass"])
    return max(p["stiffness"] * c["overlap"] - viscosity * rate, 0.0)


def viscoelastic(c, p, memory):
    rate, _ = split(c["velocity"], c["normal"])
    force = 4.0 / 3.0 * p["young"] * np.sqrt(c["radius"])
    return max(force * (c["overlap"] ** 1.5 - 1.5 * p["viscous_time"] * np.sqrt(c["overlap"]) * rate), 0.0)


def bounded(c, p, memory, push, stiffness, viscosity):
    _, slip = split(c["velocity"], c["normal"])
    spring = turned(memory.get("spring", np.zeros(3)), c["normal"]) + split(c["drift"], c["normal"])[1] * growth(c, p)
    bound = p["friction"] * push
    memory["spring"] = cut(spring, bound / stiffness)
    return cut(-stiffness * memory["spring"] - viscosity * slip, bound)


def viscous(c, p, memory, push):
    _, slip = split(c["velocity"], c["normal"])
    size = np.linalg.norm(slip)
    return -min(p["friction"] * push, p["shear_viscosity"] * size) * slip / size if size > 0.0 else np.zeros(3)


def linear_tangential(c, p, memory, push):
    viscosity = damped(c, p)[0] * 2.0 * p["linear_ratio"] * np.sqrt(p["shear_stiffness"] * c["mass"])
    return bounded(c, p, memory, push, p["shear_stiffness"], viscosity)


def mindlin(c, p, memory, push):
    share, overlap = damped(c, p)
    viscosity = share * 2.0 * p["ratio"] * np.sqrt(8.0 * p["shear"] * np.sqrt(c["radius"] * overlap) * c["mass"])
    return bounded(c, p, memory, push, 8.0 * p["shear"] * np.sqrt(c["radius"] * c["overlap"]), viscosity)


def mindlin_rescaled(c, p, memory, push):
    patch = np.sqrt(c["radius"] * c["overlap"])
    if patch < memory.get("patch", 0.0):
        share = patch / memory["patch"]
        grown = split(c["drift"], c["normal"])[1] * growth(c, p)
        memory["spring"] = memory["spring"] * share - grown * (1.0 - share) / 2.0
    memory["patch"] = patch
    return mindlin(c, p, memory, push)


def rolling_constant(c, p, memory, push):
    _, rolling = split(c["spin"], c["normal"])
    rate = np.linalg.norm(rolling)
    return -p["rolling_friction"] * c["radius"] * push * rolling / rate if rate > 0.0 else np.zeros(3)


def rolling_spring(c, p, memory, push):
    _, rolling = split(c["spin"], c["normal"])
    angle = turned(memory.get("rolled", np.zeros(3)), c["normal"]) + split(c["roll"], c["normal"])[1] * growth(c, p)
    arm = p["rolling_friction"] * c["radius"]
    stiffness = 2.25 * 2.0 * p["young"] * np.sqrt(c["radius"] * c["overlap"]) * arm**2
    damping = 2.0 * 0.3 * np.sqrt(stiffness * 7.0 / 5.0 * c["mass"] * c["least"] ** 2)
    memory["rolled"] = cut(angle, arm * push / stiffness)
    return cut(-stiffness * memory["rolled"] - damping * rolling, arm * push)


def twisting_marshall(c, p, memory, push):
    rate, _ = split(c["spin"], c["normal"])
    patch = np.sqrt(c["radius"] * c["overlap"])
    stiffness = 8.0 * p["shear"] * patch
    share, overlap = damped(c, p)
    damping = share * 2.0 * p["ratio"] * np.sqrt(8.0 * p["shear"] * np.sqrt(c["radius"] * overlap) * c["mass"])
    angle = memory.get("twisted", 0.0) + split(c["roll"], c["normal"])[0] * growth(c, p)
    bound = 2.0 / 3.0 * patch * p["friction"] * push
    limit = bound / (0.5 * patch**2 * stiffness)
    memory["twisted"] = np.clip(angle, -limit, limit)
    return np.clip(-0.5 * patch**2 * (stiffness * memory["twisted"] + damping * rate), -bound, bound) * c["normal"]


def capillary(c, p, memory):
    if c["overlap"] > 0.0:
        memory["volume"] = p["bridge_share"] * 4.0 / 3.0 * np.pi * c["least"] ** 3
    volume, gap = memory.get("volume", 0.0), max(-c["overlap"], 0.0)
    if volume == 0.0 or gap > (1.0 + 0.5 * p["angle"]) * volume ** (1.0 / 3.0):
        memory["volume"] = 0.0
        return 0.0
    radius = 2.0 * c["radius"]
    scaled = gap * np.sqrt(radius / volume)
    pull = 2.0 * np.pi * radius * p["tension"] * np.cos(p["angle"])
    return pull / (1.0 + 1.05 * scaled + 2.5 * scaled**2)


def dmt(c, p, memory):
    return 2.0 * np.pi * p["adhesion"] * c["radius"] if c["overlap"] > 0.0 else 0.0


def jkr(c, p, memory):
    """Largest root of ``b^4/R^2 - 2 d b^2/R - 2 pi w b/E + d^2 = 0``, the squared form of the JKR overlap."""
    memory["stuck"] = memory.get("stuck", False) or c["overlap"] > 0.0
    radius, young, energy, overlap = c["radius"], p["young"], p["adhesion"], c["overlap"]
    narrowest = (np.pi * energy * radius**2 / (8.0 * young)) ** (1.0 / 3.0)
    if not memory["stuck"] or overlap < -3.0 * narrowest**2 / radius:
        memory["stuck"] = False
        return 0.0
    roots = np.roots([1.0 / radius**2, 0.0, -2.0 * overlap / radius, -2.0 * np.pi * energy / young, overlap**2])
    patch = max(root.real for root in roots if abs(root.imag) < 1e-6 * abs(root))
    whole = 4.0 * young * patch**3 / (3.0 * radius) - np.sqrt(8.0 * np.pi * energy * young * patch**3)
    return 4.0 / 3.0 * young * np.sqrt(radius) * max(overlap, 0.0) ** 1.5 - whole


def nothing(*_):
    return 0.0


LAWS = {
    "normal": {"hertz": hertz, "linear": linear_normal, "viscoelastic": viscoelastic},
    "tangential": {
        "none": nothing,
        "viscous": viscous,
        "linear": linear_tangential,
        "mindlin": mindlin,
        "mindlin_rescaled": mindlin_rescaled,
    },
    "rolling": {"none": nothing, "constant": rolling_constant, "spring": rolling_spring},
    "twisting": {"none": nothing, "marshall": twisting_marshall},
    "cohesion": {"none": nothing, "capillary": capillary, "dmt": dmt, "jkr": jkr},
}


def respond(laws, c, p, memory):
    """Force on body a at the contact point and moment on it.

    Args:
        laws: name per slot.
        c, p, memory: contact, pair and memory.
    """
    push, drag, moment = 0.0, np.zeros(3), np.zeros(3)
    if c["overlap"] > 0.0:
        push = LAWS["normal"][laws["normal"]](c, p, memory)
        drag = drag + LAWS["tangential"][laws["tangential"]](c, p, memory, push)
        moment = moment + LAWS["rolling"][laws["rolling"]](c, p, memory, push)
        moment = moment + LAWS["twisting"][laws["twisting"]](c, p, memory, push)
    else:
        for name in ("spring", "patch", "rolled", "twisted"):
            memory.pop(name, None)
    pull = LAWS["cohesion"][laws["cohesion"]](c, p, memory)
    return (push - pull) * c["normal"] + drag, moment
