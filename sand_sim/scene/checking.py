"""What can only be checked when the whole scene is known."""

from itertools import combinations_with_replacement

from sand_sim.contact.law import ASKS
from sand_sim.contact.model import SLOTS
from sand_sim.scene.types import Scene, SceneError


def check_scene(scene: Scene) -> None:
    """Refuse a scene whose parts do not fit together.

    Raises:
        SceneError: naming the field and how to mend it.
    """
    if not isinstance(scene, Scene):
        raise SceneError(
            f"scene: must be a Scene, got {scene!r:.60}; 'load_scene(path)' reads one from a file, 'read_scene' from a mapping"
        )
    if not scene.materials:
        raise SceneError("materials: at least one material is needed")
    if not (scene.fills or scene.bodies):
        raise SceneError("fills: at least one fill, or one of 'bodies', is needed; there is nothing to simulate otherwise")
    known = {m.name for m in scene.materials}
    used = [("fills", f.name, f.material) for f in scene.fills]
    used += [("boundaries", b.name, b.material) for b in scene.boundaries]
    used += [("tools", t.name, t.material) for t in scene.tools]
    used += [("bodies", b.name, b.material) for b in scene.bodies]
    for section, name, material in used:
        if material not in known:
            raise SceneError(f"{section}: '{name}' is of unknown material '{material}'; known are {', '.join(sorted(known))}")
    names = [b.name for b in scene.boundaries]
    for boundary in scene.boundaries:
        if (boundary.drive or boundary.terrain) and names.count(boundary.name) > 1:
            raise SceneError(
                f"boundaries: '{boundary.name}' is the name of several; give the {boundary.kind} a 'name' of its own"
            )
    _check_pairs(scene, known)
    for fill in scene.fills:
        if fill.height is not None and fill.height > fill.high[2] - fill.low[2]:
            raise SceneError(
                f"fills: '{fill.name}' height {fill.height:g} m does not fit its region; raise region.high[2] above "
                f"{fill.low[2] + fill.height:g}"
            )
        if fill.height is not None and scene.gravity[2] >= 0.0 and any(scene.gravity):
            raise SceneError(
                f"fills: '{fill.name}' has a 'height', up to which it is filled along z, but gravity is {list(scene.gravity)}; "
                "give a 'count' instead"
            )
    if scene.domain is not None:
        for fill in scene.fills:
            if fill.low is not None and not all(
                d_low <= low and high <= d_high
                for d_low, low, high, d_high in zip(scene.domain[0], fill.low, fill.high, scene.domain[1], strict=True)
            ):
                raise SceneError(f"domain: must contain the region of fill '{fill.name}', its grains would be retired at once")


# From where on another unit is more likely meant: friction and rolling friction, density [kg/m^3], Young's modulus [Pa], surface
# tension [N/m] and adhesion [J/m^2]; molten metals pull with up to 2.5 N/m.
_STEEP, _LIGHT, _SOFT, _TENSE, _STICKY = 5.0, 10.0, 1.0e3, 5.0, 10.0


def odd_numbers(scene: Scene) -> list[str]:
    """Numbers that are possible, but more likely in another unit."""
    names = ("friction", "rolling_friction")
    steep = [(rule.between, name, rule.numbers.get(name, 0.0)) for rule in scene.pairs for name in names]
    told = [
        f"pairs: '{a}' and '{b}' have a {name} of {value:g}; it is the tangent of an angle, not the angle"
        for (a, b), name, value in steep
        if value >= _STEEP
    ]
    sticky = [(rule.between, rule.numbers.get("adhesion", 0.0)) for rule in scene.pairs]
    told += [
        f"pairs: '{a}' and '{b}' have an adhesion of {value:g} J/m^2, a thousand times that of sticky solids; is it in mJ/m^2?"
        for (a, b), value in sticky
        if value >= _STICKY
    ]
    for one in scene.materials:
        if one.density < _LIGHT:
            told.append(f"materials.{one.name}: a density of {one.density:g} kg/m^3 is that of a foam; is it in g/cm^3?")
        if one.young < _SOFT:
            told.append(f"materials.{one.name}: a young of {one.young:g} Pa is that of a jelly; is it in MPa or GPa?")
    if scene.liquid is not None and scene.liquid.surface_tension >= _TENSE:
        told.append(f"liquid: no liquid has a surface_tension of {scene.liquid.surface_tension:g} N/m; is it in mN/m?")
    return told


def unused_numbers(scene: Scene) -> list[str]:
    """What the scene gives for contact laws that it has not chosen, for whoever forgot to choose them; a zero asks for none."""
    told, chosen = [], set(scene.contact.asks)
    for name in dict.fromkeys(name for rule in scene.pairs for name, number in rule.numbers.items() if number):
        if name not in chosen:
            ways = [f"{slot}: {law}" for slot, laws in SLOTS.items() for law in laws if name in laws[law].asks]
            told.append(f"pairs: '{name}' has no effect; the section 'contact' would have to say {', or '.join(ways)}")
    if scene.liquid is not None and scene.contact.cohesion != "capillary":
        told.append("liquid: has no effect; the section 'contact' would have to say cohesion: capillary")
    return told


def _check_pairs(scene: Scene, known: set[str]) -> None:
    given = []
    for rule in scene.pairs:
        for name in rule.between:
            if name not in known:
                raise SceneError(f"pairs: unknown material '{name}'; known are {', '.join(sorted(known))}")
        if set(rule.between) in given:
            raise SceneError(f"pairs: {' and '.join(rule.between)} are given twice")
        given.append(set(rule.between))
    grains = sorted({one.material for one in (*scene.fills, *scene.bodies)})
    others = {b.material for b in scene.boundaries} | {t.material for t in scene.tools}
    needed = list(combinations_with_replacement(grains, 2)) + [(g, o) for g in grains for o in sorted(others)]
    for a, b in needed:
        asked = scene.contact.asks
        if {a, b} not in given:
            raise SceneError(f"pairs: no entry for '{a}' and '{b}', which can meet; add one with {_listing(asked)}")
        numbers = scene.pair(a, b).numbers
        for name in asked:
            if name not in numbers:
                slots = [slot for slot, law in scene.contact.laws.items() if name in law.asks]
                chosen = f"contact.{slots[0]} '{getattr(scene.contact, slots[0])}'"
                unit = f" [{ASKS[name].unit}]" if ASKS[name].unit else ""
                raise SceneError(f"pairs: '{a}' and '{b}' have no '{name}', which {chosen} needs; add {name}{unit}")
    if scene.contact.cohesion == "capillary" and scene.liquid is None:
        raise SceneError("liquid: contact.cohesion 'capillary' needs it; add 'liquid: {saturation: ...}'")
    if scene.contact.twisting == "marshall" and not scene.contact.tangential.startswith("mindlin"):
        raise SceneError("contact.twisting: 'marshall' is the twist of Mindlin's law; choose contact.tangential 'mindlin'")
    if scene.contact.cohesion == "jkr" and scene.contact.normal == "linear":
        raise SceneError(
            "contact.cohesion: 'jkr' widens a Hertz contact; choose contact.normal 'hertz', or contact.cohesion 'dmt'"
        )


def _listing(names: tuple[str, ...]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1] if names else "no numbers"]))
