"""The content of a scene file in which nothing is wrong, and changes to it."""

import copy

GOOD = {
    "materials": {
        "sand": {"density": 2600, "young": "1e7", "poisson": 0.25},
        "steel": {"density": 7800, "young": 1e9, "poisson": 0.3},
    },
    "pairs": [
        {"between": ["sand", "sand"], "restitution": 0.5, "friction": 0.5},
        {"between": ["steel", "sand"], "restitution": 0.4, "friction": 0.2},
    ],
    "fills": [{"material": "sand", "radius": 0.005, "region": {"low": [0, 0, 0], "high": [0.1, 0.1, 0.1]}, "count": 50}],
    "boundaries": [{"type": "plane", "material": "steel", "point": [0, 0, 0], "normal": [0, 0, 2]}],
    "tools": {"spade": {"mesh": "spade.stl", "material": "steel", "particle_radius": 0.002}},
}


def changed(path, value):
    """The good scene with one entry replaced, added or (with None) taken away."""
    parsed = copy.deepcopy(GOOD)
    entry = parsed
    for key in path[:-1]:
        entry = entry[key]
    if value is None:
        del entry[path[-1]]
    else:
        entry[path[-1]] = value
    return parsed
