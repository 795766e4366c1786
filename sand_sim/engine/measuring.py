"""What an observer wants to know, beside the steps and without a trace in them."""

from sand_sim.engine import body_motion, energy, finish, motion, stages
from sand_sim.engine.arrays import DemArrays
from sand_sim.integrator import VERLET


def record_measurement(arrays: DemArrays, _, recorder) -> None:
    """Record what an observer wants: forces and velocities of now, energies, top speed, touching contacts."""
    grains, setting, recipe = arrays.grains, arrays.setting, arrays.recipe
    gravity = recipe.precision.vec3(*setting.gravity)
    stages.pair_stage(arrays, recorder, measuring=True)
    if arrays.walls:
        stages.wall_stage(arrays, recorder, measuring=True)
    if arrays.tools:
        stages.tool_stage(arrays, recorder, measuring=True)
        recorder.once(finish.sum_wrenches, [arrays.tool_list.pairs.spans, arrays.wrench_blocks, arrays.tools.wrench])
    if recipe.integrator == VERLET:
        inputs = [grains.place, grains.motion, grains.spin, grains.half_motion, grains.half_spin, *stages.gathered(arrays)]
        inputs += [
            grains.member,
            arrays.felt_force,
            arrays.felt_torque,
            gravity,
            setting.dt,
            arrays.lattice.quantum,
            arrays.flags.starting,
            arrays.seen_motion,
            arrays.seen_spin,
        ]
        complete = motion.build_complete_step(recipe, bool(arrays.walls), bool(arrays.tools))
        recorder.each(complete, grains.active, inputs)
    if arrays.bodies:
        _see_bodies(arrays, recorder)
    inputs = [grains.active.spans, grains.place, arrays.seen_motion, arrays.seen_spin, grains.spin, grains.member]
    inputs += [gravity, arrays.lattice.quantum, arrays.grain_blocks, arrays.fastest]
    recorder.share(energy.build_grain_energy(recipe), inputs)
    for name, contacts in arrays.lists.items():
        inputs = [contacts.pairs.spans, arrays.energy[name], arrays.energy_blocks[name]]
        recorder.share(energy.build_contact_energy(arrays.recipe.precision), inputs)


def _see_bodies(arrays: DemArrays, recorder) -> None:
    """Velocities and energies of the rigid bodies now."""
    grains, bodies, setting, precision = arrays.grains, arrays.bodies, arrays.setting, arrays.recipe.precision
    gravity, quantum = precision.vec3(*setting.gravity), arrays.lattice.quantum
    inputs = [bodies.starts, bodies.sphere_at, bodies.offset, bodies.place, bodies.motion, bodies.half_motion]
    inputs += [bodies.turn, bodies.momentum, bodies.inertia, grains.place, arrays.felt_force, arrays.felt_torque]
    inputs += [bodies.pushes, bodies.unpushed, gravity, setting.dt, quantum, arrays.flags.starting, arrays.seen_motion]
    # Only a half step completed writes the spheres' spin anew; where there is none it is left alone.
    inputs += [arrays.seen_spin if bodies.half_motion is not None else None, bodies.seen_velocity, bodies.seen_spin]
    recorder.each(body_motion.build_see_bodies(arrays.recipe), bodies.count, inputs)
    inputs = [bodies.count.capacity, bodies.place, bodies.motion, bodies.seen_velocity, bodies.seen_spin]
    inputs += [bodies.turn, bodies.inertia, gravity, quantum, arrays.body_energy]
    recorder.share(energy.build_body_energy(precision), inputs)
