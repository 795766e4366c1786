"""Boundaries as analytic surfaces: the point of a surface that is nearest to a grain.

All lengths are in quanta and double precision, so that overlaps, which are tiny differences of large numbers, are as exact as the
grains' own positions and a grain that slides over a surface feels no kicks.
"""

from functools import cache

import warp as wp

from sand_sim.engine.recipe import CYLINDER, PANEL, PLANE, ROUGH, SHELL, Recipe

KINDS = {PLANE: 0, CYLINDER: 1, SHELL: 2, PANEL: 3}
NO_SIDE, NEAR_SIDE, BOTH_SIDES = 0, 1, 2  # how many sides of a shell answer at an end of its line
_FAR = 1.0e18  # [quantum] where there is nothing to touch


@wp.struct
class Surface:
    """One boundary surface.

    A shell is a line in the half plane of distance from the axis and height along it, turned about the axis; it is thin and solid
    both ways. Where the lines of two shells meet, only one of them answers at the common point, so that a seam is no rim.

    A panel is a rectangle, thin and solid both ways, its edges numbered by bits as in ``scene.walls``. Where another panel stands
    on an edge, on the side of the normal, that is no rim either: before the other's face it does not answer, and outside of the
    corner that of one of the two does.
    """

    kind: int
    material: int
    plunger: int  # index of the one that moves it, or -1
    ease: wp.float64  # [1/kg] one over the mass that is moved by a force, zero if nothing moves it or at a velocity
    first: int  # its contacts are listed under partner numbers from here on
    anchor: wp.vec3d  # [quantum] a point of the plane, or height zero on the axis
    direction: wp.vec3d  # [1] the plane's normal towards the grains, the panel's, or the axis
    across: wp.vec3d  # [1] a unit vector at right angles to it
    begin: wp.vec2d  # [quantum] of the line: distance from the axis, height; of the panel: along ``across``, and across both
    end: wp.vec2d  # [quantum]
    beyond_begin: wp.vec2d  # [1] way of the line that goes on there, zero at a free rim
    beyond_end: wp.vec2d  # [1]
    answers_begin: int
    answers_end: int
    joined: int  # edges of the panel that another one stands on
    answers: int  # those of them at which this one answers
    ball: wp.float64  # [quantum] radius of the virtual spheres, zero if smooth
    spacing: wp.float64  # [quantum] of virtual spheres in a row, at most
    row_spacing: wp.float64  # [quantum]
    stagger: wp.float64  # [1] shift of every other row, in spacings
    first_row: int  # of a plane, counted from the anchor
    first_column: int
    rows: int
    columns: int  # in the longest row


@cache
def build_nearest_on_shell(listing: bool = False) -> wp.Function:
    """Warp function ``(wall, side, away) -> (distance [quantum], normal)`` for a shell.

    Side 0 is the line in the grain's own half plane, side 1 that opposite, which a grain as wide as the hole touches, too. For
    ``listing`` every shell answers at a seam, because the grain may be over the other one before lists are made anew.
    """
    zero, one, far = wp.float64(0.0), wp.float64(1.0), wp.float64(_FAR)

    @wp.func
    def nearest_on_shell(wall: Surface, side: int, away: wp.vec3d):
        along = wp.dot(away, wall.direction)
        radial = away - wall.direction * along
        from_axis = wp.length(radial)
        outward = wall.across
        if from_axis > zero:
            outward = radial / from_axis
        if side == 1:
            outward = -outward
            from_axis = -from_axis
        here = wp.vec2d(from_axis, along) - wall.begin
        line = wall.end - wall.begin
        share = wp.dot(here, line) / wp.dot(line, line)
        apart = here - line * wp.clamp(share, zero, one)
        distance = wp.length(apart)
        way = wp.vec2d(-line[1], line[0]) / wp.length(line)
        if distance > zero:
            way = apart / distance
        normal = outward * way[0] + wall.direction * way[1]
        answers = int(wp.static(BOTH_SIDES))
        beyond = wp.float64(0.0)
        if share <= zero:
            answers = wall.answers_begin
            beyond = wp.dot(apart, wall.beyond_begin)
        elif share >= one:
            answers = wall.answers_end
            beyond = wp.dot(apart, wall.beyond_end)
        if wp.static(not listing):
            if beyond > zero or side >= answers:
                distance = far
        return distance, normal

    return nearest_on_shell


@cache
def build_nearest_on_panel(listing: bool = False) -> wp.Function:
    """Warp function ``(wall, away) -> (distance [quantum], normal)`` for a panel; ``listing`` as of shells."""
    zero, far = wp.float64(0.0), wp.float64(_FAR)

    @wp.func
    def nearest_on_panel(wall: Surface, away: wp.vec3d):
        beside = wp.cross(wall.direction, wall.across)
        here = wp.vec2d(wp.dot(away, wall.across), wp.dot(away, beside))
        height = wp.dot(away, wall.direction)
        beyond = here - wp.min(wp.max(here, wall.begin), wall.end)
        apart = wall.direction * height + wall.across * beyond[0] + beside * beyond[1]
        distance = wp.length(apart)
        normal = wall.direction
        if distance > zero:
            normal = apart / distance
        if wp.static(not listing):
            edges = int(0)
            for axis in range(2):
                if beyond[axis] < zero:
                    edges |= 1 << (2 * axis)
                elif beyond[axis] > zero:
                    edges |= 2 << (2 * axis)
            edges &= wall.joined
            if edges != 0 and (height > zero or (edges & ~wall.answers) != 0):
                distance = far
        return distance, normal

    return nearest_on_panel


@cache
def build_nearest(surfaces: frozenset[str], listing: bool = False) -> wp.Function:
    """Warp function ``(wall, side, away) -> (distance [quantum], normal)`` for the smooth surfaces of a recipe.

    ``away`` is from the anchor to the grain's centre [quantum]; only shells have a side 1. For ``listing`` see the shells.
    """
    cylinder, shell, panel = CYLINDER in surfaces, SHELL in surfaces, PANEL in surfaces
    nearest_on_shell, nearest_on_panel = build_nearest_on_shell(listing), build_nearest_on_panel(listing)

    @wp.func
    def nearest(wall: Surface, side: int, away: wp.vec3d):
        along = wp.dot(away, wall.direction)
        distance = along
        normal = wall.direction
        if wp.static(cylinder):
            if wall.kind == wp.static(KINDS[CYLINDER]):
                radial = away - wall.direction * along
                from_axis = wp.length(radial)
                distance = wall.begin[0] - from_axis
                if from_axis > wp.float64(0.0):
                    normal = -radial / from_axis
        if wp.static(shell):
            if wall.kind == wp.static(KINDS[SHELL]):
                distance, normal = nearest_on_shell(wall, side, away)
        if wp.static(panel):
            if wall.kind == wp.static(KINDS[PANEL]):
                distance, normal = nearest_on_panel(wall, away)
        return distance, normal

    return nearest


@cache
def build_surface_of(recipe: Recipe) -> wp.Function:
    """Warp function ``(walls, partner) -> index of the surface`` that a contact is listed under."""
    plain = not recipe.surfaces & {SHELL, ROUGH}

    @wp.func
    def surface_of(walls: wp.array(dtype=Surface), partner: int) -> int:
        wall = partner
        if wp.static(not plain):
            wall = int(0)
            while wall + 1 < walls.shape[0] and walls[wall + 1].first <= partner:
                wall += 1
        return wall

    return surface_of
