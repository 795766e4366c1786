"""The surface that particles lie on: what can be touched from outside, without walls buried in other parts."""

import numpy as np

from sampler.geometry.surface import Surface
from sampler.geometry.topology import link_items
from sampler.geometry.vectors import extremes, lengths
from sampler.particles.crossing import count_layers, crossing_planes, cut_triangles, have_before

_STEP = 2e-5  # of the diagonal: how far before and behind a face is asked what is there
_TRIAL = 4000  # random places that show whether anything is buried at all
_DEEPEST = 400  # cuts through one triangle
_ISLAND = 1.5  # triangles longer than this are halved, others cut along the planes that cross them; in spacings
_SHORT, _TOGETHER = 0.5, 0.15  # how far places on a triangle are apart, and which count as one, in spacings
_NARROW = 1e-7  # of the diagonal: narrower triangles have no normal in single precision
_THIRDS = (np.ones((3, 3)) + 3.0 * np.eye(3)) / 6.0  # places of a triangle, the middles of parts of it
_CENTRE = np.ones((1, 3)) / 3.0
_CORNERS = 0.01 + 0.97 * np.eye(3)  # places near its corners
_MIDDLE = np.array([[0.36, 0.34, 0.3], [0.31, 0.36, 0.33]])  # near its middle, but hardly on edges of others
_SLIT, _LARGE = 0.1, 0.5  # longest edge of the pieces at the ends of slits, and of those inside or beside them, in spacings
_WIDE = 4.0  # triangles with longer edges, in roots of their area, are needles
_SHUT = 0.005  # width of slits whose walls are no skin, in spacings
_SPECK = 0.01  # area of a speck, in squared spacings
_MOST, _FINEST = 10, 0.5  # cuts per particle to come, after which only triangles longer than so many spacings are cut
_ENOUGH = 15_000  # cuts for a body of few particles, whose mass is to be right, too


class Skin(Surface):
    """Triangles with what random sampling and Warp kernels need.

    Args:
        triangles: shape (n, 3, 3) [m].
        device: Warp device.
        layers: of triangles that lie on one another, all among these, shape (n,); together they count once.

    Attributes:
        areas: their shares of the area, shape (n,) [m^2].
    """

    def __init__(self, triangles: np.ndarray, device: str = "cpu", layers: np.ndarray | None = None):
        super().__init__(triangles, device)
        self.areas = self.areas if layers is None else self.areas / layers

    def scatter(self, number: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Random places, shape (2 n, 3) [m], and the normals there: so many over the area, and over longest edges, for strips."""
        edge = longest_edges(self.triangles)
        groups = self.sample(number, random), self.sample(number, random, edge + edge.mean())
        return tuple(map(np.concatenate, zip(*groups, strict=True)))

    def corners(self, spacing: float) -> tuple[np.ndarray, np.ndarray]:
        """Places near corners, where gaps are widest, and on triangles that random places may miss, however small or narrow.

        Args:
            spacing: of the particles [m]; places much nearer to one another than that on one side are one.

        Returns:
            Shape (n, 3) [m], and the normals there, shape (n, 3).
        """
        row, face = _middle_lines(self.triangles, _SHORT * spacing)
        points = np.concatenate([row, (_CORNERS @ self.triangles).reshape(-1, 3)])
        normals = self.normals[np.append(face, np.repeat(np.arange(len(self.triangles)), 3))]
        side = np.abs(normals).argmax(axis=1)
        up = np.take_along_axis(normals, side[:, None], axis=1)[:, 0] > 0.0
        cell = ((points - points.min(axis=0)) / (_TOGETHER * spacing)).astype(np.int64)
        key = np.ravel_multi_index((*cell.T, side, up), (*cell.max(axis=0) + 1, 3, 2))
        one = np.unique(key, return_index=True)[1]
        return points[one], normals[one]

    def sample(self, number: int, random: np.random.Generator, weight: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Random places, stratified over the area.

        Args:
            number: of places.
            random: where chance comes from.
            weight: of the triangles, instead of their areas.

        Returns:
            Points, shape (number, 3) [m], and the normals of their triangles, shape (number, 3).
        """
        share = np.cumsum(self.areas if weight is None else weight)
        at = (np.arange(number) + random.random(number)) / number * share[-1]
        ends = np.searchsorted(at, share, side="right")
        ends[-1] = number
        face = np.repeat(np.arange(len(share)), np.diff(ends, prepend=0))
        u, v = random.random((2, number, 1))
        turned = u + v > 1.0
        u, v = np.where(turned, 1.0 - u, u), np.where(turned, 1.0 - v, v)
        a, b, c = self.triangles.transpose(1, 0, 2)
        points = a[face] + u * (b - a)[face] + v * (c - a)[face]
        return points, self.normals[face]


def free_triangles(triangles: np.ndarray, around: Surface, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles, or parts of them, that have an outside on any side: walls as thin as paper, and sheets, have it on both.

    Args:
        triangles: shape (n, 3, 3) [m].
        around: all closed surfaces, these among them.
        spacing: of the particles to come [m].

    Returns:
        Outward, shape (m, 3, 3) [m]; the given triangle that each is part of, shape (m,); how many lie on one another there,
        shape (m,).
    """
    parent = np.flatnonzero(Surface.areas_of(triangles) > 0.0)
    triangles = triangles[parent]
    places, normals = Skin(triangles).sample(_TRIAL, np.random.default_rng(0))
    free, layers, inverted = _ask(places, normals, around)
    if free.all() and np.all(layers == 1) and not inverted.any():
        return triangles, parent, np.ones(len(parent), int)
    most = len(triangles) // 2 + max(_MOST * float(Surface.areas_of(triangles).sum()) / spacing**2, _ENOUGH)
    pieces, parents, cuts = [], [], 0
    for _ in range(_DEEPEST):
        edge = longest_edges(triangles)
        worth = np.flatnonzero(edge > (0.0 if cuts < most else _FINEST * spacing))
        crossed, normals, places = crossing_planes(triangles[worth], around, _STEP * around.unit)
        crossed = worth[crossed]
        sound = np.ones(len(triangles), bool)
        sound[crossed] = False
        cuts += len(crossed)
        pieces.append(triangles[sound])
        parents.append(parent[sound])
        triangles, parent, edge = triangles[crossed], parent[crossed], edge[crossed]
        if not len(triangles):
            break
        small = edge <= _ISLAND * spacing
        parts, origin = cut_triangles(triangles[small], normals[small], places[small])
        triangles = np.concatenate([halve_triangles(triangles[~small]), parts])
        parent = np.concatenate([np.tile(parent[~small], 2), parent[small][origin]])
    pieces.append(triangles)
    parents.append(parent)
    pieces, parents = np.concatenate(pieces), np.concatenate(parents)
    free, layers, inverted = _ask(pieces.mean(axis=1), Surface.normals_of(pieces), around)
    pieces[inverted] = pieces[inverted, ::-1]
    return pieces[free], parents[free], layers[free]


def touchable_parts(triangles: np.ndarray, solid: Surface | None, spacing: float) -> np.ndarray:
    """Parts of free triangles, shape (n, 3, 3) [m], that particles are to cover, shape (m, 3, 3) [m].

    Left out are triangles too narrow to have a normal; folds, on which more of the solid's faces look the other way, so that
    those are the skin there; the ends of slits; and specks, such as pinholes between parts, farther than a spacing from the rest.
    """
    low, high = extremes(triangles)
    narrow = _NARROW * np.linalg.norm(high - low) * longest_edges(triangles)
    triangles = triangles[2.0 * Surface.areas_of(triangles) > narrow]
    if solid is not None and len(triangles):
        triangles = np.delete(triangles, _folds(triangles, solid), axis=0)
        triangles = _outside_slits(triangles, solid, spacing) if len(triangles) else triangles
    if not len(triangles):
        return triangles
    island = _islands(triangles, 0.25 * spacing)
    speck = np.bincount(island, Surface.areas_of(triangles))[island] < _SPECK * spacing**2
    speck &= longest_edges(triangles) < 0.25 * spacing
    if speck.any() and not speck.all():
        middle = triangles[speck].mean(axis=1)
        speck[speck] = np.linalg.norm(Surface(triangles[~speck]).closest(middle)[0] - middle, axis=1) > spacing
        triangles = triangles[~speck]
    return triangles


def coinciding_layers(triangles: np.ndarray, solid: Surface) -> np.ndarray:
    """How many faces of a solid that look the same way lie on one another all over its free parts, shape (n,), at least 1."""
    layers, normals = np.full(len(triangles), np.iinfo(int).max), Surface.normals_of(triangles)
    several = np.arange(len(triangles))
    for weight in (*_CENTRE, *_THIRDS):
        found = count_layers(weight @ triangles[several], normals[several], solid, _STEP * solid.unit)
        layers[several] = np.clip(found, 1, layers[several])
        several = several[layers[several] > 1]
    return layers


def longest_edges(triangles: np.ndarray) -> np.ndarray:
    """Of each triangle, shape (n, 3, 3) [m]; shape (n,) [m]."""
    a, b, c = lengths(triangles - triangles[:, [1, 2, 0]]).T
    return np.maximum(np.maximum(a, b), c)


def _folds(triangles: np.ndarray, solid: Surface) -> np.ndarray:
    """Numbers of triangles on which more faces look the other way than theirs."""
    fold, normals = np.arange(len(triangles)), Surface.normals_of(triangles)
    for weight in _MIDDLE:
        places = np.einsum("nij,i->nj", triangles[fold], weight)
        fold = fold[count_layers(places, normals[fold], solid, _STEP * solid.unit) < 0]
    return fold[np.abs(winding_before(triangles[fold].mean(axis=1), normals[fold], solid)) > 0.5]  # else turned round before


def _outside_slits(triangles: np.ndarray, solid: Surface, spacing: float) -> np.ndarray:
    """Triangles without those parts before which there is no room; slits that narrow do not end where a plane could cut."""
    step = max(_STEP, _SHUT * spacing / solid.unit)
    places, normals = Skin(triangles).sample(_TRIAL, np.random.default_rng(0))
    if np.all(np.abs(winding_before(places, normals, solid, step)) < 0.5):
        return triangles
    parent = np.flatnonzero(have_before(triangles, solid, 0.5 * _STEP * solid.unit, step * solid.unit))
    pieces = triangles[parent]
    outside = pieces.mean(axis=1) + _STEP * solid.unit * Surface.normals_of(pieces)  # they were judged free there
    whole, parts = np.ones(len(triangles), bool), [(triangles[:0], parent[:0])]
    while len(pieces):
        size = np.minimum(longest_edges(pieces), _WIDE * np.sqrt(Surface.areas_of(pieces)))  # needles would become very many
        small, tiny, room = size <= _LARGE * spacing, size <= _SLIT * spacing, np.full(len(pieces), np.nan)
        for asked, weights in ((tiny, _CENTRE), (small & ~tiny, _THIRDS)):
            room[asked] = _room(pieces[asked], weights, outside[asked], solid, step)
        done = tiny | (room == 0.0) | (room == 1.0)
        stays = done & (room > 0.5)
        whole[parent[done & ~stays]] = False
        parts.append((pieces[stays], parent[stays]))
        pieces, parent, outside = halve_triangles(pieces[~done]), np.tile(parent[~done], 2), np.tile(outside[~done], (2, 1))
    pieces, parent = map(np.concatenate, zip(*parts, strict=True))
    return np.concatenate([triangles[whole], pieces[~whole[parent]]])


def _room(triangles: np.ndarray, weights: np.ndarray, outside: np.ndarray, solid: Surface, step: float) -> np.ndarray:
    """Share of places of triangles before which there is room, as there is at points near them; shape (n,)."""
    places = np.einsum("nij,ki->nkj", triangles, weights) + step * solid.unit * Surface.normals_of(triangles)[:, None]
    ways = np.repeat(outside, len(weights), axis=0), places.reshape(-1, 3)
    return (solid.leavings(*ways) == 0).reshape(-1, len(weights)).mean(axis=1)


def _islands(triangles: np.ndarray, cell: float) -> np.ndarray:
    """Numbers, alike for triangles whose middles lie in the same cube of a grid or in neighbouring ones, shape (n,)."""
    place = np.floor(triangles.mean(axis=1) / cell).astype(np.int64)
    place -= place.min(axis=0) - 1
    size = place.max(axis=0) + 2
    key, inverse = np.unique(np.ravel_multi_index(place.T, size), return_inverse=True)
    steps = np.indices((3, 3, 3)).reshape(3, -1).T[14:] - 1  # half of the neighbours; the others are theirs
    beside = key[:, None] + steps @ [size[1] * size[2], size[2], 1]
    found = np.minimum(np.searchsorted(key, beside), len(key) - 1)
    here, which = np.nonzero(key[found] == beside)
    return link_items(len(key), here, found[here, which])[0][inverse]


def winding_before(points: np.ndarray, normals: np.ndarray, around: Surface, step: float = _STEP) -> np.ndarray:
    """Rough winding numbers of a surface a step, of its diagonal, before places on it, shape (n, 3) [m], along their normals."""
    return around.winding(points + step * around.unit * normals, rough=True)


def _ask(points: np.ndarray, normals: np.ndarray, around: Surface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether places of a surface are free, how many faces lie on one another there, at least 1, and whether they look inward.

    Such are faces of parts that a surface which crosses itself turns inside out.
    """
    before, layers = winding_before(points, normals, around), count_layers(points, normals, around, _STEP * around.unit)
    free = np.abs(before) < 0.5
    turned = np.flatnonzero(~free & (np.abs(before + layers) < 0.5))  # faces inward, it seems; thin slits may feign that
    free[turned] = np.abs(winding_before(points[turned], -normals[turned], around)) < 0.5
    return free, np.maximum(layers, 1), free & (before < -0.5)


def _middle_lines(triangles: np.ndarray, apart: float) -> tuple[np.ndarray, np.ndarray]:
    """Places so far apart [m], or one, along triangles, halfway between their longest edge and the others.

    Returns:
        Shape (m, 3) [m]; the triangle that each lies on, shape (m,).
    """
    a, edge, rise, foot, face, rank, number = _columns(triangles, apart)
    along = (0.5 + rank) / number
    high = np.minimum(along / foot, (1.0 - along) / (1.0 - foot))
    return a + along[:, None] * edge + 0.5 * high[:, None] * rise, face


def _columns(triangles: np.ndarray, wide: float) -> tuple[np.ndarray, ...]:
    """Triangles, shape (n, 3, 3) [m], as columns on their longest edge, each no wider than so far [m].

    Returns:
        Of each column where that edge begins, the edge, and what leads from its foot to the third corner, shape (m, 3) [m]; the
        foot as a share of the edge, the triangle, which of its columns it is, and how many it has, shape (m,).
    """
    a, b, c = _longest_edge_first(triangles)
    long = np.linalg.norm(b - a, axis=1)
    foot = np.einsum("ij,ij->i", c - a, b - a) / long**2
    foot = np.clip(foot, 1e-9, 1.0 - 1e-9)
    number = np.ceil(long / wide).astype(int)
    face = np.repeat(np.arange(len(triangles)), number)
    rank = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
    a, edge, foot = a[face], (b - a)[face], foot[face]
    return a, edge, c[face] - a - foot[:, None] * edge, foot, face, rank, number[face]


def halve_triangles(triangles: np.ndarray) -> np.ndarray:
    """Cut at the middle of the longest edge, so that thin triangles do not breed."""
    a, b, c = _longest_edge_first(triangles)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def slices(triangles: np.ndarray, wide: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles, shape (n, 3, 3) [m], cut straight across their longest edge into slices no wider than so far [m].

    Returns:
        Centroids of the slices, shape (m, 3) [m]; their shares of the area, shape (m,); the triangle of each, shape (m,).
    """
    a, edge, rise, foot, face, rank, number = _columns(triangles, wide)
    # Moments of the height above the edge, which is 1 at the foot, from the edge's begin; from the foot on it falls.
    moments = np.zeros((3, len(face)))  # of the height itself, times the way along the edge, and half of its square
    for end, sign in ((rank / number, -1.0), ((rank + 1) / number, 1.0)):
        u, v = np.minimum(end, foot), 1.0 - np.maximum(end, foot)
        left, right = u**2 / foot, ((1.0 - foot) ** 2 - v**2) / (1.0 - foot)
        moments[0] += sign * 0.5 * (left + right)
        moments[1] += sign * (u**3 / foot / 3.0 + 0.5 * right - ((1.0 - foot) ** 3 - v**3) / (1.0 - foot) / 3.0)
        moments[2] += sign * (u**3 / foot**2 + ((1.0 - foot) ** 3 - v**3) / (1.0 - foot) ** 2) / 6.0
    along, high = moments[1:] / np.maximum(moments[0], 1e-300)
    return a + along[:, None] * edge + high[:, None] * rise, 2.0 * moments[0], face


def _longest_edge_first(triangles: np.ndarray) -> np.ndarray:
    """Corners of triangles, shape (n, 3, 3) [m], the longest edge from the first to the second; shape (3, n, 3)."""
    edge = lengths(triangles - triangles[:, [1, 2, 0]])
    turn = (edge.argmax(axis=1)[:, None] + np.arange(3)) % 3
    return np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
