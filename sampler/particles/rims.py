"""Places beyond rims, which hold particles back from these, as if their lattice went on there."""

import numpy as np

from sampler.geometry.surface import Surface, tangents
from sampler.geometry.topology import edges_of
from sampler.particles.skin import Skin

_OUT, _PER_SPACING = 0.5, 3.0  # beyond rims, in spacings: over half a lattice row, which covers them; so many per spacing
_ASKED, _WAYS, _FAR = 10.0, 8, 0.6  # places per squared spacing from which rims are sought, in so many ways, so far, in spacings
_GONE, _LEVEL = 0.05, 0.3  # how far from a layer, in spacings, it has ended, and how far out of its plane, by the sine


def beyond_edges(vertices: np.ndarray, faces: np.ndarray, around: Surface, spacing: float) -> np.ndarray:
    """Places beyond rims of sheets, where no other surface goes on, shape (n, 3) [m].

    Args:
        vertices: shape (k, 3) [m].
        faces: of the sheets, shape (m, 3).
        around: all that particles are to cover.
        spacing: of the particles [m].
    """
    edges = edges_of(faces)
    rim = edges.half[edges.of(1)[:, 0]]
    face, corner = np.divmod(rim, 3)
    tail, head = vertices[faces[face, corner]], vertices[faces[face, (corner + 1) % 3]]
    outward = np.cross(head - tail, Surface.normals_of(vertices[faces[face]]))
    length = np.linalg.norm(outward, axis=1)
    way = np.cumsum(length)
    at = np.arange(0.0, way[-1] if len(way) else 0.0, spacing / _PER_SPACING)
    k = np.searchsorted(way, at, side="right")
    share = ((at - way[k] + length[k]) / length[k])[:, None]
    places = tail[k] + share * (head - tail)[k] + (_OUT * spacing / length[k])[:, None] * outward[k]
    return _far_out(places, around, spacing)


def beyond_layers(layers: np.ndarray, around: Surface, spacing: float) -> np.ndarray:
    """The same for triangles, shape (k, 3, 3) [m], of which it is not known how they hang together."""
    if not len(layers):
        return np.zeros((0, 3))
    layers = Skin(layers, around.device)
    points, normals = layers.sample(1 + int(_ASKED * layers.areas.sum() / spacing**2), np.random.default_rng(0))
    aside, beside = tangents(normals)
    found = []
    for angle in 2.0 * np.pi * np.arange(_WAYS) / _WAYS:
        places = points + _FAR * spacing * (np.cos(angle) * aside + np.sin(angle) * beside)
        rim, face = layers.closest(places)
        out = places - rim
        length = np.linalg.norm(out, axis=1)
        level = np.abs(np.einsum("ij,ij->i", out, layers.normals[face])) < _LEVEL * length
        k = np.flatnonzero(level & (length > _GONE * spacing))
        found.append(rim[k] + _OUT * spacing * out[k] / length[k, None])
    places = np.concatenate(found)
    cells = np.floor(places * (_PER_SPACING / spacing)).astype(np.int64)
    return _far_out(places[np.unique(cells, axis=0, return_index=True)[1]], around, spacing)


def _far_out(places: np.ndarray, around: Surface, spacing: float) -> np.ndarray:
    return places[np.linalg.norm(around.closest(places)[0] - places, axis=1) > 0.9 * _OUT * spacing]
