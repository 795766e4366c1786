"""The explicit DEM on Warp: arrays, kernels and the stages that run them."""

from sand_sim.engine import kernel  # noqa: F401  starts Warp before anything else touches it
