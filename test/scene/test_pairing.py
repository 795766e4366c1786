"""What is known of two materials that meet, by hand."""

from pathlib import Path

import pytest
from good_scene import changed

from sand_sim import read_scene
from sand_sim.scene.pairing import pair_numbers


def test_each_pair_has_its_own_numbers_whichever_is_named_first():
    """``1/E* = (1 - nu^2)/E`` and ``1/G* = (2 - nu)/G``, each summed up over both, with ``G = E/(2 (1 + nu))``."""
    scene = read_scene(changed(("liquid",), {"saturation": 0.02, "surface_tension": 0.05, "contact_angle": 0.3}), Path.cwd())
    for one, other in (("sand", "steel"), ("steel", "sand")):
        found = pair_numbers(scene, one, other)
        assert found.young == pytest.approx(1.0 / ((1.0 - 0.25**2) / 1e7 + (1.0 - 0.3**2) / 1e9))
        shear = 1.0 / ((2.0 - 0.25) * 2.0 * 1.25 / 1e7 + (2.0 - 0.3) * 2.0 * 1.3 / 1e9)
        assert found.shear == pytest.approx(shear)
        assert found.given == {"restitution": 0.4, "friction": 0.2}
        assert found.liquid == {"saturation": 0.02, "surface_tension": 0.05, "contact_angle": 0.3}
    assert pair_numbers(scene, "sand", "sand").given == {"restitution": 0.5, "friction": 0.5}
    assert pair_numbers(scene, "sand", "sand").young == pytest.approx(1e7 / (2.0 * (1.0 - 0.25**2)))
    assert pair_numbers(scene, "steel", "steel") is None
