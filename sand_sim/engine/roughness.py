"""Rough boundaries: a lattice of virtual spheres over a surface, each known by its number alone and stored nowhere.

A plane carries straight rows. A surface of revolution carries rings, evenly spaced along its line from end to end, each with the
fewest spheres that are no farther apart than asked. In a triangular lattice every other row is shifted by half a spacing.

Source: virtual particles on a chart of an implicit surface, as in the source document on four-sphere grains.
"""

from functools import cache
from math import pi

import warp as wp

from sand_sim.engine.recipe import PLANE
from sand_sim.engine.surfaces import KINDS, Surface

_SLACK = 1.0e-9  # of a spacing, so that rounding loses no sphere that is exactly within reach


@cache
def build_sphere_at() -> tuple[wp.Function, wp.Function]:
    """Warp functions ``ring_count(wall, row)`` and ``sphere_at(wall, index) -> centre from the anchor [quantum]``."""
    turn = wp.float64(2.0 * pi)

    @wp.func
    def ring_at(wall: Surface, row: int) -> wp.vec2d:
        share = wp.float64(0.0)
        if wall.rows > 1:
            share = wp.float64(row) / wp.float64(wall.rows - 1)
        return wall.begin + (wall.end - wall.begin) * share

    @wp.func
    def ring_count(wall: Surface, row: int) -> int:
        ring = ring_at(wall, row)
        return wp.max(1, int(wp.ceil(wp.static(turn) * ring[0] / wall.spacing - wp.static(wp.float64(_SLACK)))))

    @wp.func
    def sphere_at(wall: Surface, index: int) -> wp.vec3d:
        row = index / wall.columns
        column = index - row * wall.columns
        up = wp.cross(wall.direction, wall.across)
        shift = wall.stagger * wp.float64(row % 2)
        centre = wp.vec3d(wp.float64(0.0))
        if wall.kind == wp.static(KINDS[PLANE]):
            u = (wp.float64(wall.first_column + column) + shift) * wall.spacing
            v = wp.float64(wall.first_row + row) * wall.row_spacing
            centre = wall.across * u + up * v
        else:
            ring = ring_at(wall, row)
            angle = (wp.float64(column) + shift) * wp.static(turn) / wp.float64(ring_count(wall, row))
            radial = wall.across * wp.cos(angle) + up * wp.sin(angle)
            centre = radial * ring[0] + wall.direction * ring[1]
        return centre

    return ring_at, ring_count, sphere_at


@cache
def build_rows_near() -> wp.Function:
    """Warp function ``(wall, away, reach) -> (first, last row)`` that may have spheres within reach [quantum] of a point."""
    slack = wp.float64(_SLACK)

    @wp.func
    def rows_near(wall: Surface, away: wp.vec3d, reach: wp.float64):
        first = int(0)
        last = int(-1)
        along = wp.dot(away, wall.direction)
        if wall.kind == wp.static(KINDS[PLANE]):
            if wp.abs(along) <= reach:
                v = wp.dot(away, wp.cross(wall.direction, wall.across))
                span = wp.sqrt(reach * reach - along * along)
                first = int(wp.ceil((v - span) / wall.row_spacing - wp.static(slack))) - wall.first_row
                last = int(wp.floor((v + span) / wall.row_spacing + wp.static(slack))) - wall.first_row
        else:
            line = wall.end - wall.begin
            length = wp.length(line)
            here = wp.vec2d(wp.length(away - wall.direction * along), along) - wall.begin
            level = wp.dot(here, line) / length
            gap = length / wp.float64(wp.max(wall.rows - 1, 1))
            first = int(wp.ceil((level - reach) / gap - wp.static(slack)))
            last = int(wp.floor((level + reach) / gap + wp.static(slack)))
        lowest = int(0)
        highest = wall.rows - 1
        # Where a neighbour carries the ring at a seam this surface leaves it out.
        if wall.answers_begin == 0:
            lowest = 1
        if wall.answers_end == 0:
            highest = wall.rows - 2
        return wp.max(first, lowest), wp.min(last, highest)

    return rows_near


@cache
def build_columns_near() -> wp.Function:
    """Warp function ``(wall, row, away, reach) -> (first, last column, columns around)``.

    On a ring the columns wrap around and the first may be negative.
    """
    ring_at, ring_count, _ = build_sphere_at()
    slack, turn = wp.float64(_SLACK), wp.float64(2.0 * pi)

    @wp.func
    def columns_near(wall: Surface, row: int, away: wp.vec3d, reach: wp.float64):
        first = int(0)
        last = int(-1)
        around = wall.columns
        shift = wall.stagger * wp.float64(row % 2)
        along = wp.dot(away, wall.direction)
        up = wp.cross(wall.direction, wall.across)
        u = wp.dot(away, wall.across)
        v = wp.dot(away, up)
        if wall.kind == wp.static(KINDS[PLANE]):
            off = v - wp.float64(wall.first_row + row) * wall.row_spacing
            square = reach * reach - along * along - off * off
            if square >= wp.float64(0.0):
                half = wp.sqrt(square) / wall.spacing
                middle = u / wall.spacing - shift
                first = wp.max(int(wp.ceil(middle - half - wp.static(slack))) - wall.first_column, 0)
                last = wp.min(int(wp.floor(middle + half + wp.static(slack))) - wall.first_column, wall.columns - 1)
        else:
            ring = ring_at(wall, row)
            around = ring_count(wall, row)
            off = along - ring[1]
            from_axis = wp.sqrt(u * u + v * v)
            square = from_axis * from_axis + ring[0] * ring[0] + off * off - reach * reach
            twice = wp.float64(2.0) * from_axis * ring[0]
            if square <= -twice:
                last = around - 1
            elif square <= twice:
                step = wp.static(turn) / wp.float64(around)
                middle = wp.atan2(v, u) / step - shift
                half = wp.acos(wp.clamp(square / twice, wp.float64(-1.0), wp.float64(1.0))) / step
                first = int(wp.ceil(middle - half - wp.static(slack)))
                last = int(wp.floor(middle + half + wp.static(slack)))
                if last - first + 1 >= around:
                    first = 0
                    last = around - 1
        return first, last, around

    return columns_near
