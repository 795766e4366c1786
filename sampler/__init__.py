"""From a triangle mesh to a rigid body of evenly spaced surface particles. Knows neither ROS nor sand_sim."""

from sampler.body import ParticleBody
from sampler.cache import sample_file, sample_mesh
from sampler.distance import SignedDistance
from sampler.errors import MeshError
from sampler.field import DistanceField, make_field
from sampler.location import locate_mesh, package_prefixes, package_share
from sampler.reading import read_mesh
from sampler.repair import repair_mesh
from sampler.sampling import sample_body
from sampler.storage import load_body, save_body

__all__ = [
    "DistanceField",
    "MeshError",
    "ParticleBody",
    "SignedDistance",
    "load_body",
    "locate_mesh",
    "make_field",
    "package_prefixes",
    "package_share",
    "read_mesh",
    "repair_mesh",
    "sample_body",
    "sample_file",
    "sample_mesh",
    "save_body",
]
