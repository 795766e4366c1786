"""Sheets that get a thickness: closed forms of bent ones."""

import numpy as np
import pytest

from sampler.mass import integrate
from sampler.sheets import thicken

THICKNESS, LENGTH = 0.02, 1.0


def bent(opening):
    """Two squares that meet along the axis y with an angle between them."""
    along = np.array([[0.0, 0.0, 0.0], [0.0, LENGTH, 0.0]])
    ends = [LENGTH * np.array([np.cos(side * opening / 2.0), 0.0, np.sin(side * opening / 2.0)]) for side in (-1.0, 1.0)]
    vertices = np.concatenate([along, along + ends[0], along + ends[1]])
    return vertices, np.array([[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]])


@pytest.mark.parametrize("opening", np.radians([60.0, 90.0, 150.0, 180.0]))
def test_a_bent_sheet_keeps_half_its_thickness_on_both_sides_up_to_the_bend(opening):
    """What the outer corner adds is what the inner one takes away, so the volume is that of the flat sheet."""
    place, faces = thicken(*bent(opening), THICKNESS)
    assert integrate(place[faces])[0] == pytest.approx(2.0 * LENGTH**2 * THICKNESS, rel=1e-9)
    tip = 0.5 * THICKNESS / np.sin(opening / 2.0)
    assert place[:, 0].min() == pytest.approx(-tip, rel=1e-9)


@pytest.mark.parametrize("opening", np.radians([12.0, 30.0, 50.0]))
def test_a_sharp_bend_is_cut_off_at_twice_that_distance(opening):
    """A mitre of a fold of 12 degrees would stand out ten times as far as its sides."""
    place, _ = thicken(*bent(opening), THICKNESS)
    assert place[:, 0].min() == pytest.approx(-THICKNESS, rel=1e-9)


def test_where_a_sheet_is_folded_on_to_itself_the_fold_stays():
    """No place is away from both of its planes."""
    place, _ = thicken(*bent(np.radians(1.0)), THICKNESS)
    assert place[:, 0].min() == pytest.approx(0.0, abs=1e-9)
