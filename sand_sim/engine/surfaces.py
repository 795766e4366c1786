"""Boundaries as analytic surfaces: distance and normal at a grain, the list of grains near them, and the forces they exert."""

from functools import cache

import warp as wp

from sand_sim.contact.response import build_meeting, memory_type
from sand_sim.engine.act import build_act, build_acts
from sand_sim.engine.contact_list import listed_at
from sand_sim.engine.kernel import kernel
from sand_sim.engine.recipe import Recipe
from sand_sim.precision import Precision

PLANE = 0
CYLINDER = 1  # grains are inside


@cache
def surface_type(precision: Precision) -> type:
    """Warp struct of one boundary surface."""
    real, vec3, whole3 = precision.real, precision.vec3, precision.whole3

    @wp.struct
    class Surface:
        kind: int
        anchor: whole3  # [quantum] a point of the plane, or of the cylinder's axis
        direction: vec3  # [1] the plane's normal towards the grains, or the cylinder's axis
        radius: real  # [m] of the cylinder
        material: int

    return Surface


@cache
def build_surface_at(precision: Precision) -> wp.Function:
    """Warp function ``(surface, place, quantum) -> (distance from the grain's centre [m], normal towards the grain)``."""
    real, vec3, whole4 = precision.real, precision.vec3, precision.whole4
    surface = surface_type(precision)

    @wp.func
    def surface_at(wall: surface, place: whole4, quantum: real):
        away = vec3(real(place[0] - wall.anchor[0]), real(place[1] - wall.anchor[1]), real(place[2] - wall.anchor[2])) * quantum
        along = wp.dot(away, wall.direction)
        distance = along
        normal = wall.direction
        if wall.kind == wp.static(CYLINDER):
            radial = away - wall.direction * along
            length = wp.length(radial)
            distance = wall.radius - length
            normal = vec3(real(0.0))
            if length > real(0.0):
                normal = -radial / length
        return distance, normal

    return surface_at


@cache
def build_surface_search(recipe: Recipe, filling: bool) -> wp.Kernel:
    """Kernel that counts or, ``filling``, lists the surfaces within reach of each grain."""
    precision, history = recipe.precision, recipe.history
    real, whole4, memory_vector = precision.real, precision.whole4, memory_type(recipe.contact, precision)
    surface, surface_at = surface_type(precision), build_surface_at(precision)

    @kernel
    def surface_search(
        lane: int,
        spans: wp.array(dtype=int),
        stride: int,
        place: wp.array(dtype=whole4),
        walls: wp.array(dtype=surface),
        quantum: real,
        skin: real,
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
            here = place[i]
            found = int(0)
            if wp.static(filling):
                found = starts[i]
            for wall in range(walls.shape[0]):
                distance, _normal = surface_at(walls[wall], here, quantum)
                if distance < real(here[3]) * quantum + skin:
                    if wp.static(filling):
                        owner[found] = i
                        partner[found] = wall
                        if wp.static(history):
                            kept = memory_vector()
                            old = listed_at(old_starts, old_partner, came_from[i], wall)
                            if old >= 0:
                                kept = old_memory[old]
                            memory[found] = kept
                    found += 1
            if wp.static(not filling):
                counts[i] = found

    return surface_search


@cache
def build_surface_forces(recipe: Recipe, measuring: bool = False) -> wp.Kernel:
    """Kernel for the forces of surfaces on grains; a surface is flat for the law (R* is the grain's radius) and immovable."""
    precision, rotation, materials = recipe.precision, recipe.rotation, recipe.materials
    real, vec3, vec4, whole4 = precision.real, precision.vec3, precision.vec4, precision.whole4
    types, memory_vector = recipe.contact.types(precision), memory_type(recipe.contact, precision)
    surface, surface_at = surface_type(precision), build_surface_at(precision)
    meeting, acts = build_meeting(precision), build_acts(recipe)
    act, release = build_act(recipe, measuring)

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
        material: wp.array(dtype=int),
        table: wp.array(dtype=types.pair),
        kinds: int,
        quantum: real,
        dt: real,
        walls: wp.array(dtype=surface),
        memory: wp.array(dtype=memory_vector),
        force: wp.array(dtype=vec3),
        couple: wp.array(dtype=vec4),
        moment: wp.array(dtype=vec3),
        deepest: wp.array(dtype=real),
        energy: wp.array(dtype=real),
    ):
        for contact in range(spans[lane] + wp.tid(), spans[lane + 1], stride):
            i = owner[contact]
            wall = walls[partner[contact]]
            distance, normal = surface_at(wall, place[i], quantum)
            radius = real(place[i][3]) * quantum
            overlap = radius - distance
            if acts(contact, overlap > real(0.0), memory):
                of_i = motion[i]
                velocity = vec3(of_i[0], of_i[1], of_i[2])
                turning = vec3(real(0.0))
                if wp.static(rotation):
                    spin_i = spin[i]
                    turning = vec3(spin_i[0], spin_i[1], spin_i[2])
                    velocity -= wp.cross(turning, normal) * distance
                met = meeting(normal, overlap, velocity, turning, radius, radius, of_i[3])
                kind = int(0)
                if wp.static(materials):
                    kind = material[i]
                act(
                    contact,
                    met,
                    table[kind * kinds + wall.material],
                    dt,
                    overlap,
                    lane,
                    overlap / radius,
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
