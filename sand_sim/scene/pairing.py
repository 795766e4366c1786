"""What is known of two materials that meet."""

from dataclasses import asdict

from sand_sim.contact.law import PairNumbers
from sand_sim.scene.types import Material, Scene


def effective_young(a: Material, b: Material) -> float:
    """``E* = [(1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b]^-1`` [Pa]."""
    return 1.0 / ((1.0 - a.poisson**2) / a.young + (1.0 - b.poisson**2) / b.young)


def effective_shear(a: Material, b: Material) -> float:
    """``G* = [(2 - nu_a)/G_a + (2 - nu_b)/G_b]^-1`` with ``G = E / (2 (1 + nu))`` [Pa]."""
    shear_a, shear_b = (m.young / (2.0 * (1.0 + m.poisson)) for m in (a, b))
    return 1.0 / ((2.0 - a.poisson) / shear_a + (2.0 - b.poisson) / shear_b)


def pair_numbers(scene: Scene, a: str, b: str) -> PairNumbers | None:
    """All numbers of two materials by their names; None if the scene lacks a rule or a number, because they never meet."""
    one, other = (scene.materials[scene.material_index(name)] for name in (a, b))
    rules = [rule for rule in scene.pairs if set(rule.between) == {a, b}]
    if not rules or not set(scene.contact.asks) <= rules[0].numbers.keys():
        return None
    liquid = asdict(scene.liquid) if scene.liquid else {}
    return PairNumbers(effective_young(one, other), effective_shear(one, other), rules[0].numbers, liquid)
