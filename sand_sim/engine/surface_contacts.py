"""Contacts of grains with boundaries: the list of grains near them, and the forces they exert."""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_drifting, build_meeting, memory_type
from sand_sim.engine.act import build_act, build_acts
from sand_sim.engine.cells import cell_functions, level_type
from sand_sim.engine.contact_list import build_note
from sand_sim.engine.kernel import kernel, sure
from sand_sim.engine.plungers import PlungerState
from sand_sim.engine.prefetch import build_fetch_grain
from sand_sim.engine.recipe import CYLINDER, PANEL, PLUNGER, ROUGH, SHELL, Recipe
from sand_sim.engine.roughness import build_columns_near, build_rows_near, build_sphere_at
from sand_sim.engine.surfaces import KINDS, Surface, build_nearest, build_surface_of
from sand_sim.precision import Precision

_AHEAD = 16  # contacts; the grains at a wall lie far from each other in memory


@cache
def build_from_anchor(precision: Precision, surfaces: frozenset[str]) -> wp.Function:
    """Warp function: vector from a surface's anchor, which a plunger takes along, to a grain's centre [quantum]."""
    whole4, moving = precision.whole4, PLUNGER in surfaces

    @wp.func
    def from_anchor(here: whole4, wall: Surface, plungers: wp.array(dtype=PlungerState)) -> wp.vec3d:
        away = wp.vec3d(wp.float64(here[0]), wp.float64(here[1]), wp.float64(here[2])) - wall.anchor
        if wp.static(moving):
            if wall.plunger >= 0:
                away -= wall.direction * plungers[wall.plunger].shift
        return away

    return from_anchor


@cache
def build_surface_search(recipe: Recipe, filling: bool) -> wp.Kernel:
    """Kernel that counts or, ``filling``, lists the surfaces and virtual spheres within reach of each grain."""
    precision, surfaces = recipe.precision, recipe.surfaces
    whole4, memory_vector = precision.whole4, memory_type(recipe.contact, precision)
    from_anchor, nearest = build_from_anchor(precision, surfaces), build_nearest(surfaces, listing=True)
    rows_near, columns_near, (_, _, sphere_at) = build_rows_near(), build_columns_near(), build_sphere_at()
    rough, shell, note = ROUGH in surfaces, SHELL in surfaces, build_note(recipe, filling)
    level, (level_of, _) = level_type(precision), cell_functions(precision)

    @kernel
    def surface_search(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        walls: wp.array(dtype=Surface),
        plungers: wp.array(dtype=PlungerState),
        skin: wp.array(dtype=wp.float64),
        levels: wp.array(dtype=level),
        counts: wp.array(dtype=int),
        starts: wp.array(dtype=int),
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        memory: wp.array(dtype=memory_vector),
        came_from: wp.array(dtype=int),
        old_starts: wp.array(dtype=int),
        old_partner: wp.array(dtype=int),
        old_memory: wp.array(dtype=memory_vector),
    ):
        for i in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            found = int(0)
            if wp.static(filling):
                found = starts[i]
                if starts[i + 1] == found:
                    continue  # none was counted
            here = place[i]
            gap = skin[0] + wp.float64(levels[level_of(levels, here[3])].across)
            reach = wp.float64(here[3]) + gap
            for w in range(walls.shape[0]):
                wall = walls[w]
                away = from_anchor(here, wall, plungers)
                smooth = True
                if wp.static(rough):
                    if wall.ball > wp.float64(0.0):
                        smooth = False
                        farthest = reach + wall.ball
                        lowest, highest = rows_near(wall, away, farthest)
                        for row in range(lowest, highest + 1):
                            first, last, around = columns_near(wall, row, away, farthest)
                            for column in range(first, last + 1):
                                index = row * wall.columns + (column + 2 * around) % around
                                if wp.length(away - sphere_at(wall, index)) < farthest:
                                    found = note(
                                        found,
                                        i,
                                        wall.first + index,
                                        owner,
                                        partner,
                                        memory,
                                        came_from,
                                        old_starts,
                                        old_partner,
                                        old_memory,
                                    )
                if smooth:
                    sides = int(1)
                    if wp.static(shell):
                        if wall.kind == wp.static(KINDS[SHELL]):
                            sides = 2
                    for side in range(sides):
                        distance, _normal = nearest(wall, side, away)
                        if distance < reach:
                            found = note(
                                found,
                                i,
                                wall.first + side,
                                owner,
                                partner,
                                memory,
                                came_from,
                                old_starts,
                                old_partner,
                                old_memory,
                            )
            if wp.static(not filling):
                counts[i] = found

    return surface_search


@cache
def build_surface_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces of surfaces on grains.

    A surface is immovable for the law (m* is the grain's mass) unless a force moves it. A smooth one is flat there (R* is the
    grain's radius), also where it is curved or ends in a rim; the spheres of a rough one are spheres.
    """
    precision, rotation, materials, surfaces = recipe.precision, recipe.rotation, recipe.materials, recipe.surfaces
    real, vec3, vec4, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    from_anchor, nearest = build_from_anchor(precision, surfaces), build_nearest(surfaces)
    surface_of, (_, _, sphere_at) = build_surface_of(recipe), build_sphere_at()
    meeting, acts = build_meeting(precision), build_acts(recipe)
    drifting, springs, halves = build_drifting(precision), recipe.springs, recipe.halves
    act, release, fetch_grain = *build_act(recipe, measuring), build_fetch_grain(recipe)
    rough, moving, curved = ROUGH in surfaces, PLUNGER in surfaces, bool(surfaces & {CYLINDER, SHELL, PANEL})

    @kernel
    def surface_forces(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        owner: wp.array(dtype=int),
        partner: wp.array(dtype=int),
        place: wp.array(dtype=whole4),
        motion: wp.array(dtype=vec4),
        spin: wp.array(dtype=vec4),
        half_motion: wp.array(dtype=vec3),
        half_spin: wp.array(dtype=vec3),
        material: wp.array(dtype=int),
        table: wp.array(dtype=types.pair),
        kinds: int,
        quantum: real,
        dt: real,
        walls: wp.array(dtype=Surface),
        plungers: wp.array(dtype=PlungerState),
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec4),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec4),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        end = spans[lane + 1]
        for contact in range(spans[lane] + wp.tid(), end, stride):
            fetch_grain(
                sure(owner[sure(wp.min(contact + wp.static(_AHEAD), end - 1))]), place, motion, spin, half_motion, half_spin
            )
            i = owner[contact]
            here = place[i]
            wall = walls[surface_of(walls, partner[contact])]
            number = partner[contact] - wall.first
            away = from_anchor(here, wall, plungers)
            radius = real(here[3]) * quantum
            law_radius = radius
            least = radius
            share = real(1.0)  # of the overlap that lies on the grain's side of the contact point
            distance = wp.float64(0.0)
            way = wp.vec3d(wp.float64(0.0))
            smooth = True
            if wp.static(rough):
                if wall.ball > wp.float64(0.0):
                    smooth = False
                    apart = away - sphere_at(wall, number)
                    centres = wp.length(apart)
                    distance = centres - wall.ball
                    way = wall.direction
                    if centres > wp.float64(0.0):
                        way = apart / centres
                    ball = real(wall.ball) * quantum
                    law_radius = radius * ball / (radius + ball)
                    least = wp.min(radius, ball)
                    share = real(0.5)
            if smooth:
                distance, way = nearest(wall, number, away)
            overlap = real(wp.float64(here[3]) - distance) * quantum
            if acts(contact, overlap > real(0.0), memory):
                normal = vec3(real(way[0]), real(way[1]), real(way[2]))
                of_i = motion[i]
                of_wall = vec3(real(0.0))
                mass = of_i[3]
                if wp.static(moving):
                    mass = mass / (real(1.0) + mass * real(wall.ease))
                    if wall.plunger >= 0:
                        along = vec3(real(wall.direction[0]), real(wall.direction[1]), real(wall.direction[2]))
                        of_wall = along * real(plungers[wall.plunger].seen)
                velocity = vec3(of_i[0], of_i[1], of_i[2]) - of_wall
                turning = vec3(real(0.0))
                if wp.static(rotation):
                    spin_i = spin[i]
                    turning = vec3(spin_i[0], spin_i[1], spin_i[2])
                    velocity -= wp.cross(turning, normal) * (radius - share * overlap)
                met = meeting(normal, overlap, velocity, turning, law_radius, least, radius, mass)
                if wp.static(springs):
                    past = vec3(of_i[0], of_i[1], of_i[2]) - of_wall
                    turned = turning
                    if wp.static(halves):
                        past = half_motion[i] - of_wall
                        turned = half_spin[i]
                    lag = vec3(real(0.0))
                    if wp.static(curved):
                        half_way = past * (real(0.5) * dt / quantum)
                        before = away - wp.vec3d(wp.float64(half_way[0]), wp.float64(half_way[1]), wp.float64(half_way[2]))
                        if smooth:
                            _distance, was = nearest(wall, number, before)
                            lag = vec3(real(way[0] - was[0]), real(way[1] - was[1]), real(way[2] - was[2]))
                    if wp.static(rough):
                        if not smooth:
                            lag = (past - normal * wp.dot(past, normal)) * (real(0.5) * dt / (radius + real(wall.ball) * quantum))
                    past -= wp.cross(turned, normal - lag) * (radius - share * overlap)
                    met = drifting(met, past, turned, lag)
                kind = int(0)
                if wp.static(materials):
                    kind = material[i]
                act(
                    contact,
                    met,
                    table[kind * kinds + wall.material],
                    dt,
                    share * overlap,
                    lane,
                    overlap / least,
                    memory,
                    force,
                    couple,
                    moment,
                    deepest,
                    energy,
                )
            else:
                release(contact, memory, force, couple, moment, energy)

    return surface_forces
