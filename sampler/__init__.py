"""From a triangle mesh to a rigid body of evenly spaced surface particles. Knows neither ROS nor sand_sim."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sampler.body import ParticleBody
    from sampler.cache import sample_file, sample_mesh
    from sampler.distance import SignedDistance
    from sampler.errors import MeshError
    from sampler.field import DistanceField, make_field
    from sampler.files.location import locate_mesh, package_prefixes, package_share, split_address
    from sampler.files.reading import read_mesh
    from sampler.mending.repair import repair_mesh
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
    "split_address",
]

_HOMES = {
    "DistanceField": "field",
    "MeshError": "errors",
    "ParticleBody": "body",
    "SignedDistance": "distance",
    "load_body": "storage",
    "locate_mesh": "files.location",
    "make_field": "field",
    "package_prefixes": "files.location",
    "package_share": "files.location",
    "read_mesh": "files.reading",
    "repair_mesh": "mending.repair",
    "sample_body": "sampling",
    "sample_file": "cache",
    "sample_mesh": "cache",
    "save_body": "storage",
    "split_address": "files.location",
}


def __getattr__(name: str):
    """Import public names when they are first used, so that the command line can see to Ctrl-C before the long imports."""
    if name not in _HOMES:
        raise AttributeError(f"module 'sampler' has no attribute '{name}'")
    return getattr(import_module(f"sampler.{_HOMES[name]}"), name)
