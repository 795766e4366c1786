"""The time step: characteristic times, and what is said about a step of the user's own."""

import numpy as np
import pytest

from sand_sim import SceneError
from sand_sim.scene.time_step import contact_time, rayleigh_time
from sand_sim.scene.types import Material

# E [Pa]: Hertz contact time of two grains of 1 mm at 0.1 m/s, Rayleigh time [s]; nu 0.25 gives the published figures.
TIMES = {7e10: (4.9e-6, 0.52e-6), 1e9: (26.2e-6, 4.45e-6), 1e8: (65.8e-6, 14.1e-6), 1e7: (165e-6, 44.6e-6), 1e6: (415e-6, 141e-6)}


@pytest.mark.parametrize("young", TIMES)
def test_characteristic_times(young):
    material = Material("sand", 2650.0, young, 0.25)
    radius = 5e-4
    mass = 2650.0 * 4 / 3 * np.pi * radius**3
    effective = young / (2.0 * (1.0 - 0.25**2))
    assert contact_time(radius / 2.0, mass / 2.0, effective, 0.1) == pytest.approx(TIMES[young][0], rel=0.03)
    assert rayleigh_time(radius, material) == pytest.approx(TIMES[young][1], rel=0.05)


def test_own_step_is_checked(make_world):
    safe = make_world([[0.0, 0.0, 0.0]], 0.005).assembly.time_step.safe
    assert make_world([[0.0, 0.0, 0.0]], 0.005, time_step=0.5 * safe).observe().health.doubts == ()
    doubtful = make_world([[0.0, 0.0, 0.0]], 0.005, time_step=2.0 * safe)
    assert "2.0 times the safe step" in doubtful.assembly.time_step.warning
    assert any("time step" in doubt for doubt in doubtful.observe().health.doubts)
    with pytest.raises(SceneError, match=r"solver.time_step: .* is 10.0 times the safe step .* use 'auto'"):
        make_world([[0.0, 0.0, 0.0]], 0.005, time_step=10.0 * safe)


def test_frames_are_whole_numbers_of_steps(make_world):
    world = make_world([[0.0, 0.0, 0.0]], 0.005, frame_rate=50.0)
    assert world.frame_steps * world.time_step == pytest.approx(0.02, rel=1e-12)
    assert world.time_step <= world.assembly.time_step.safe
