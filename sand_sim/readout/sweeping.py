"""Volume of ground that tools sweep: cells below the bed's surface at time zero that a tool's body has passed through."""

from dataclasses import replace

import numpy as np

from sampler import SignedDistance
from sand_sim import rotation
from sand_sim.assembly.tool_model import ToolModel
from sand_sim.border import GrainCloud
from sand_sim.readout.height_map import footprint_grid, make_height_map

_FINEST = 0.25  # of a cell, at most a particle's radius: what a middle that grazes a tool may cut off unseen
_THINNEST = 0.02  # of a cell: how near to a surface that grains touch itself a middle counts as met
_PARTS = 4  # along the edge of a cell, over which its height is averaged


class SweptGround:
    """Ground in cells of about one median grain diameter, and which of them each tool has passed through.

    A cell is ground if its middle lies between the bottom and the top of the bed there at time zero, and in no tool.
    It has been swept once its middle has been inside the hull of a tool's particles. Middles are followed along the tool's path
    from pose to pose, each step as long as its distance from the hull allows, so thin blades and fast tools jump over nothing.

    Args:
        cloud: spheres at time zero.
        tools: in the order of the scene.
        poses: position [m] and orientation of each tool at time zero.

    Attributes:
        cell: edge [m].
        low: lower corner of the grid, shape (3,) [m].
        ground: shape (columns, rows, layers), along x, y, z; bool.
        swept: shape (tools, columns, rows, layers), bool.
    """

    def __init__(self, cloud: GrainCloud, tools: list[ToolModel], poses: list):
        self._surfaces = [SignedDistance(tool.mesh) for tool in tools]
        self._tools, self._poses = list(tools), list(poses)
        self._passed = [[] for _ in tools]
        self.cell, self.low, self.ground = 1.0, np.zeros(3), np.zeros((0, 0, 0), bool)
        if len(cloud) and tools:
            self.cell, self.low, self.ground = _find_ground(cloud)
        for index in range(len(tools)):
            inside = self._inside(index, np.argwhere(self.ground))
            self.ground[tuple(inside.T)] = False
        self.swept = np.zeros((len(tools), *self.ground.shape), bool)

    @property
    def volumes(self) -> np.ndarray:
        """Swept by each tool so far, shape (tools,) [m^3]."""
        return self.swept.sum(axis=(1, 2, 3)) * self.cell**3

    def pass_by(self, tool: int, position: np.ndarray, orientation: np.ndarray) -> None:
        """Note a pose at which the path of a tool bends."""
        self._passed[tool].append((position, orientation))

    def advance(self, poses: list) -> np.ndarray:
        """Follow all tools to where they are now; returns ``volumes``."""
        for index, pose in enumerate(poses):
            for stop in (*self._passed[index], pose):
                self._sweep(index, *self._poses[index], *stop)
                self._poses[index] = stop
            self._passed[index] = []
        return self.volumes

    def jump(self, tool: int, position: np.ndarray, orientation: np.ndarray) -> None:
        """Put a tool somewhere else, on no way there; what it lies in has been swept."""
        self._poses[tool], self._passed[tool] = (position, orientation), []
        self._stand(tool)

    def set_tools(self, tools: list[ToolModel]) -> None:
        """Give tools other bodies where they are; what these lie in has been swept."""
        for index, model in enumerate(tools):
            if model is not self._tools[index]:
                self._tools[index], self._surfaces[index] = model, SignedDistance(model.mesh)
                self._stand(index)

    def save(self) -> dict[str, np.ndarray]:
        """What has been swept, as plain arrays."""
        return {
            "swept.low": self.low,
            "swept.cell": np.array(self.cell),
            "swept.shape": np.array(self.swept.shape),
            "swept.ground": np.packbits(self.ground),
            "swept.swept": np.packbits(self.swept),
            "swept.position": np.array([position for position, _ in self._poses]),
            "swept.orientation": np.array([orientation for _, orientation in self._poses]),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Put what ``save`` gave back."""
        shape = tuple(state["swept.shape"].tolist())
        self.low, self.cell = state["swept.low"], float(state["swept.cell"])
        self.ground, self.swept = (
            np.unpackbits(state[f"swept.{name}"], count=int(np.prod(full))).astype(bool).reshape(full)
            for name, full in (("ground", shape[1:]), ("swept", shape))
        )
        self._poses = list(zip(state["swept.position"], state["swept.orientation"], strict=True))
        self._passed = [[] for _ in self._poses]

    def _stand(self, index: int) -> None:
        """Mark the cells that a tool lies in."""
        inside = self._inside(index, np.argwhere(self.ground & ~self.swept[index]))
        self.swept[index][tuple(inside.T)] = True

    def _inside(self, index: int, cells: np.ndarray) -> np.ndarray:
        """Those of some cells, shape (n, 3), whose middles are inside a tool now."""
        model, (position, orientation) = self._tools[index], self._poses[index]
        middles = self.low + (cells + 0.5) * self.cell
        near = np.linalg.norm(middles - position, axis=1) < model.extent
        local = rotation.rotate(rotation.inverse(orientation), middles[near] - position)
        return cells[near][self._surfaces[index].query(local)[0] < model.margin] if near.any() else cells[:0]

    def _sweep(self, index: int, begin: np.ndarray, turn: np.ndarray, end: np.ndarray, end_turn: np.ndarray) -> None:
        """Mark the cells that a tool passes through as it moves evenly from one pose to another."""
        model, way = self._tools[index], np.asarray(end) - begin
        spin = rotation.to_vector(rotation.multiply(end_turn, rotation.inverse(turn)))
        angle, radius = float(np.linalg.norm(spin)), max(model.margin, _THINNEST * self.cell)
        if angle == 0.0 and not way.any():
            return
        cells = self._candidates(index, [(begin, turn), (end, end_turn)], radius + model.extent * angle**2 / 8.0)
        middles, straight = self.low + (cells + 0.5) * self.cell, np.linalg.norm(way)
        length = straight + angle * (np.linalg.norm(middles - begin, axis=1) + straight)  # at most, of its way past the tool
        share = np.zeros(len(cells))
        while len(cells):
            local = middles - begin - share[:, None] * way
            local = rotation.rotate(rotation.inverse(turn), _turned(local, spin, -share))
            closest, face = self._surfaces[index].surface.closest(local, (1.0 - share) * length + radius)
            distance = np.linalg.norm(closest - local, axis=1)
            hit = (face >= 0) & (distance <= radius)
            self.swept[index][tuple(cells[hit].T)] = True
            share += np.maximum(distance - radius, min(_FINEST * self.cell, radius)) / length
            left = (face >= 0) & ~hit & (share <= 1.0)
            cells, middles, length, share = cells[left], middles[left], length[left], share[left]

    def _candidates(self, index: int, poses: list, margin: float) -> np.ndarray:
        """Ground cells not yet swept in a box around a tool at two poses, shape (n, 3)."""
        low, high = self._tools[index].mesh.bounds
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        both = np.concatenate([position + rotation.rotate(turn, corners) for position, turn in poses])
        shape = self.ground.shape
        first = np.clip(np.floor((both.min(axis=0) - margin - self.low) / self.cell), 0, shape).astype(int)
        last = np.clip(np.ceil((both.max(axis=0) + margin - self.low) / self.cell), 0, shape).astype(int)
        box = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
        return np.argwhere(self.ground[box] & ~self.swept[index][box]) + first


def _turned(vectors: np.ndarray, spin: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Vectors, shape (n, 3), each turned by its share of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(spin))
    if angle == 0.0:
        return vectors
    axis, sine, cosine = spin / angle, np.sin(share * angle)[:, None], np.cos(share * angle)[:, None]
    return vectors * cosine + np.cross(axis, vectors) * sine + np.outer(vectors @ axis, axis) * (1.0 - cosine)


def _find_ground(cloud: GrainCloud) -> tuple[float, np.ndarray, np.ndarray]:
    """Cell [m], lower corner [m] and ground of a bed."""
    cell, reach = 2.0 * float(np.median(cloud.radius)), cloud.radius[:, None].astype(float)
    bottom, top = (cloud.position - reach).min(axis=0), (cloud.position + reach).max(axis=0)
    corner, shape = footprint_grid(bottom, top, cell)
    mirrored = replace(cloud, position=cloud.position * [1.0, 1.0, -1.0])
    upper, lower = _mean_height(cloud, corner, cell, shape), -_mean_height(mirrored, corner, cell, shape)
    layers = int(np.ceil((top[2] - bottom[2]) / cell - 1e-3))
    middles = bottom[2] + (np.arange(layers) + 0.5) * cell
    ground = (middles > lower[:, :, None]) & (middles < upper[:, :, None])  # false where there is no grain
    return cell, np.array([*corner, bottom[2]]), ground


def _mean_height(cloud: GrainCloud, corner: np.ndarray, cell: float, shape: tuple[int, int]) -> np.ndarray:
    """Mean height of the grains over each cell, shape (columns, rows) [m]; NaN where they cover less than half of it."""
    rows, columns = shape
    heights = make_height_map(cloud, corner, cell / _PARTS, (rows * _PARTS, columns * _PARTS)).heights
    parts = heights.reshape(rows, _PARTS, columns, _PARTS).transpose(2, 0, 1, 3).reshape(columns, rows, -1).astype(float)
    covered = np.isfinite(parts)
    number = covered.sum(axis=2)
    return np.where(number >= 0.5 * _PARTS**2, np.where(covered, parts, 0.0).sum(axis=2) / np.maximum(number, 1), np.nan)
