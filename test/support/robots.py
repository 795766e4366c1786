"""Robot descriptions for tests."""


def origin(xyz=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0)):
    xyz, rpy = (" ".join(map(repr, map(float, numbers))) for numbers in (xyz, rpy))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def link(name, *parts):
    """A link of parts as ``part`` makes them."""
    return f'<link name="{name}">{"".join(parts)}</link>'


def part(geometry, kind="collision", place=""):
    return f"<{kind}>{place}<geometry>{geometry}</geometry></{kind}>"


def joint(parent, child, place="", kind="fixed"):
    return f'<joint name="{parent}_{child}" type="{kind}">{place}<parent link="{parent}"/><child link="{child}"/></joint>'


def moved(parent, child, kind, axis=None, place="", more=""):
    """A movable joint with an axis, as text."""
    about = "" if axis is None else f'<axis xyz="{axis}"/>'
    return joint(parent, child, f"{place}{about}{more}", kind)


def robot(*elements):
    return f'<?xml version="1.0" encoding="utf-8"?>\n<robot name="digger">{"".join(elements)}</robot>'
