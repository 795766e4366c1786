"""From a triangle mesh to a rigid body of evenly spaced surface particles. Knows neither ROS nor sand_sim."""

from sampler.body import ParticleBody
from sampler.distance import SignedDistance
from sampler.errors import MeshError
from sampler.location import locate_mesh
from sampler.reading import read_mesh
from sampler.repair import repair_mesh
from sampler.sampling import sample_body

__all__ = ["MeshError", "ParticleBody", "SignedDistance", "locate_mesh", "read_mesh", "repair_mesh", "sample_body"]
