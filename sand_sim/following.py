"""A world whose tools go along the trajectories of its scene."""

from sand_sim.tool_motion.playing import commands_at, pose_times
from sand_sim.world import World


def follow(world: World, end: float) -> None:
    """Step to a time, the tools on their trajectories all the way, through every waypoint.

    Args:
        world: before that time.
        end: [s]; ``frame_times(world.scene)`` gives those of frames.

    Raises:
        CommandError: if a tool is not where its trajectory goes on, and cannot be in time.
        UnstableError: as ``World.step``.
    """
    for moment in pose_times(world.scene, world.time, end):
        steps = round((moment - world.time) / world.time_step)
        if steps > 0:
            for command in commands_at(world.scene, moment):
                world.apply(command)
            world.step(steps)
