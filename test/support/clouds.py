"""Clouds of grains made by hand."""

import numpy as np

from sand_sim.border import GrainCloud


def cloud_of(position, radius):
    """Grains at rest at positions, shape (n, 3), with radii of one number or shape (n,); their masses mean nothing."""
    position = np.atleast_2d(np.asarray(position, float))
    number = len(position)
    radius = np.broadcast_to(np.asarray(radius, np.float32), number)
    still = np.zeros((number, 3), np.float32)
    return GrainCloud(np.arange(number), position, still, still, radius, radius, np.tile([0.0, 0.0, 0.0, 1.0], (number, 1)))
