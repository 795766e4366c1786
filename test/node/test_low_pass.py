"""The low-pass filter against the closed forms of a second-order Butterworth filter."""

import numpy as np
import pytest

from sand_sim.node.low_pass import LowPass

FRAME = 0.02


def gain_at(cutoff, frequency, interval, periods=200):
    """Amplitude that a sine has after the filter, from its projection once it has settled."""
    number = round(periods / (frequency * interval))
    time = np.arange(number) * interval
    low_pass = LowPass(cutoff)
    out = np.array([low_pass.filter(np.sin(2.0 * np.pi * frequency * t), interval) for t in time])
    kept = time > 10.0 / cutoff
    basis = np.column_stack([f(2.0 * np.pi * frequency * time[kept]) for f in (np.sin, np.cos)])
    return np.linalg.norm(np.linalg.lstsq(basis, out[kept], rcond=None)[0])


@pytest.mark.parametrize("interval", [0.001, 0.01, FRAME])
def test_half_the_power_passes_at_the_cutoff(interval):
    assert gain_at(10.0, 10.0, interval) == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-9)


@pytest.mark.parametrize("frequency", [1.0, 5.0, 20.0, 24.0])
def test_gain_is_butterworths(frequency):
    """1/sqrt(1 + (W/Wc)^4) with W = tan(pi f T), the bilinear transform's frequency."""
    warped = np.tan(np.pi * frequency * FRAME) / np.tan(np.pi * 8.0 * FRAME)
    assert gain_at(8.0, frequency, FRAME) == pytest.approx(1.0 / np.sqrt(1.0 + warped**4), rel=1e-6, abs=1e-9)


def test_constant_passes_unchanged():
    low_pass, wrench = LowPass(5.0), np.array([[1.0, -2.0, 300.0], [1e-9, 0.0, 7.0]])
    for interval in (FRAME, FRAME, 0.003, 0.05, 1.0, FRAME):  # sample times may change
        assert low_pass.filter(wrench, interval) == pytest.approx(wrench, rel=1e-15)
    for _ in range(400):
        found = low_pass.filter(2.0 * wrench, FRAME)
    assert found == pytest.approx(2.0 * wrench, rel=1e-12)


def test_step_response():
    """1 - sqrt(2) exp(-a) sin(a + pi/4) with a = w t / sqrt(2), overshooting by exp(-pi) at a = pi."""
    cutoff, interval = 5.0, 1e-4
    low_pass = LowPass(cutoff)
    low_pass.filter(0.0, interval)
    found = np.array([low_pass.filter(1.0, interval) for _ in range(10_000)])
    phase = 2.0 * np.pi * cutoff * interval * (np.arange(len(found)) + 0.5) / np.sqrt(2.0)  # steps half a sample early
    expected = 1.0 - np.sqrt(2.0) * np.exp(-phase) * np.sin(phase + 0.25 * np.pi)
    assert found == pytest.approx(expected, abs=1e-5)
    assert found.max() == pytest.approx(1.0 + np.exp(-np.pi), abs=1e-6)


def test_reset_forgets():
    low_pass = LowPass(1.0)
    low_pass.filter(np.ones(3), FRAME)
    low_pass.filter(np.zeros(3), FRAME)
    low_pass.reset()
    assert low_pass.filter(np.full(3, 5.0), FRAME) == pytest.approx(5.0)


def test_same_time_again_changes_nothing():
    low_pass, twin = LowPass(5.0), LowPass(5.0)
    for one in (low_pass, twin):
        one.filter(0.0, FRAME)
        one.filter(1.0, FRAME)
    once = low_pass.filter(99.0, 0.0)
    assert low_pass.filter(2.0, FRAME) == twin.filter(2.0, FRAME)
    assert 0.0 < once < 1.0


def test_samples_too_rare_to_filter_pass():
    assert LowPass(25.0).filter(3.0, FRAME) == 3.0
    for cutoff in (25.0, 100.0, np.inf):
        low_pass = LowPass(cutoff)
        low_pass.filter(0.0, FRAME)
        assert low_pass.filter(3.0, FRAME) == 3.0


@pytest.mark.parametrize("cutoff", [0.0, -1.0, np.nan])
def test_senseless_cutoffs_are_refused(cutoff):
    with pytest.raises(ValueError, match="cutoff: must be a positive frequency"):
        LowPass(cutoff)


@pytest.mark.parametrize("interval", [-0.1, np.nan, np.inf])
def test_senseless_intervals_are_refused(interval):
    low_pass = LowPass(1.0)
    low_pass.filter(0.0, FRAME)
    with pytest.raises(ValueError, match="interval"):
        low_pass.filter(0.0, interval)
