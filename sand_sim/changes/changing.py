"""The part of a world that changes what is in it while it runs: grains come and go, tools and bodies get other places."""

from dataclasses import replace

import numpy as np

from sand_sim.assembly.assemble import Assembly
from sand_sim.border import Health, ToolPose
from sand_sim.changes.body_placing import put_body, read_body
from sand_sim.changes.body_pushing import push
from sand_sim.changes.carrying_over import carry_over, rebuild
from sand_sim.changes.exchange import check_room, find_grains, read_grains
from sand_sim.changes.plunger_driving import drive
from sand_sim.changes.tool_exchange import check_tool, read_tool
from sand_sim.changes.tool_placing import check_place, forget_motion
from sand_sim.grain_table import GrainTable
from sand_sim.readout.beforehand import find_coarseness, find_fine_surfaces
from sand_sim.readout.observing import balance_rounding, observe_grains, observe_spheres
from sand_sim.tool_motion.track import Track


class Changeable:
    """Methods of ``World``, whose attributes they use."""

    def add_grains(self, position, radius, material: str | None = None, velocity=0.0) -> np.ndarray:
        """Put spheres into the running world; all else goes on as it was, and ``reset`` takes them away again.

        Args:
            position: shape (n, 3) [m].
            radius: one number or shape (n,) [m].
            material: name; may be left out where the scene has grains of one material only.
            velocity: one number, shape (3,) or (n, 3) [m/s].

        Returns:
            Their identities, shape (n,), which follow the largest one ever used.

        Raises:
            CommandError: if they make no sense or overlap anything; the message says how many and where, nothing is changed.
        """
        self._health()
        rows = read_grains(self.assembly, position, radius, material, velocity)
        check_room(self.assembly, observe_spheres(self.assembly), self._poses, rows)
        table = self.assembly.table
        if len(rows):
            longer = rebuild(self.assembly, GrainTable.join([table, rows]), self.tools)
            carry_over(self.assembly, longer)
            self._go_on_with(longer)
        return np.arange(table.grains, table.grains + len(rows))

    def remove_grains(self, identity=None, box=None) -> np.ndarray:
        """Take grains out of the running world; ``reset`` brings them back.

        Args:
            identity: of the grains, shape (n,).
            box: instead of it, lowest and highest corner of a box, shape (3,) each [m]; grains whose centres are inside go, the
                scene's named bodies stay.

        Returns:
            Identities of the grains that are gone.

        Raises:
            CommandError: if there is no such grain; nothing is changed then.
        """
        self._health()
        cloud = observe_grains(self.assembly)
        gone = find_grains(self.assembly, cloud, identity, box)
        self._solver.remove(np.flatnonzero(np.isin(self.assembly.grain_of_sphere, gone)))
        self._go_on_with(self.assembly)
        return gone

    def set_tool_mesh(self, tool: str, mesh: str, scale: float = 1.0) -> None:
        """Give a tool another body at the pose it has; what it does and has done stays, ``reset`` brings the first one back.

        If it reaches farther than any tool before, positions are rounded anew, to a coarser lattice (see ``lattice.py``).

        Args:
            tool: name.
            mesh: file, or address as in a scene.
            scale: [m per mesh unit].

        Raises:
            CommandError: if the mesh cannot be used, or cuts deeper into grains by a tenth of a radius; nothing is changed then.
        """
        index = self._index_of(tool)
        self._health()
        model = read_tool(self.assembly, self.tools[index].tool, mesh, scale)
        tools = [*self.tools[:index], model, *self.tools[index + 1 :]]
        check_tool(self.assembly, tools, index, self._poses[index], observe_spheres(self.assembly))
        self._sweep()
        self._models[index, model.tool.mesh, model.tool.scale] = model
        other = rebuild(self.assembly, self.assembly.table, tools)
        carry_over(self.assembly, other, replaced=index)
        self._go_on_with(other)

    def place_tool(self, tool: str, position, orientation=None) -> None:
        """Put a tool somewhere else at once, where it rests: for a trial that begins there, or to begin where a robot is.

        It sweeps nothing on the way and needs no time; where it was told to go is forgotten. ``reset`` brings it back.

        Args:
            tool: name.
            position: of the tool frame's origin, shape (3,) [m].
            orientation: of the tool frame, quaternion x y z w of any length but zero, shape (4,); as it is if None.

        Raises:
            CommandError: if the pose makes no sense, or the tool would cut deeper into grains there by a tenth of a radius;
                nothing is changed then.
        """
        index = self._index_of(tool)
        now = self._poses[index]
        place = self.check(ToolPose(tool, position, now[1] if orientation is None else orientation))
        self._health()
        check_place(self.assembly, index, now, place, observe_spheres(self.assembly))
        self._sweep()
        forget_motion(self.assembly, index)
        self._set_tracks([*self._tracks[:index], Track.rest(place), *self._tracks[index + 1 :]])
        self._swept.jump(index, place.position, place.orientation)
        self._go_on_with(self.assembly)

    def place_body(self, body: str, position, orientation=None, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)) -> None:
        """Put a free rigid body somewhere else at once, also one that has left the domain; ``reset`` brings it back.

        Nothing pushes it there until it is told so anew.

        Args:
            body: name.
            position: of the origin of its own frame, shape (3,) [m].
            orientation: of its own frame, quaternion x y z w of any length but zero, shape (4,).
            velocity: of its centre of mass, shape (3,) [m/s].
            spin: shape (3,) [rad/s], world frame; of all of them, what is None stays as it is.

        Raises:
            CommandError: if they make no sense, or it would overlap anything by a tenth of a radius; the message says what, and
                nothing is changed then.
        """
        self._health()
        spheres = observe_spheres(self.assembly)
        rows = read_body(self.assembly, spheres, body, position, orientation, velocity, spin)
        put_body(self.assembly, body, rows, spheres, self._poses)
        self._go_on_with(self.assembly)

    def push_body(self, body: str, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)) -> None:
        """Push a free rigid body from now on, until it is told otherwise: a load, a drive, or what a controller asks for.

        The force acts at the origin of the body's own frame, wherever it moves; work that is done so is accounted for. ``reset``
        ends it.

        Args:
            body: name.
            force: world frame, shape (3,) [N].
            torque: about the origin of the body's own frame, world frame, shape (3,) [N m].

        Raises:
            CommandError: if there is no such body, it has left the domain, or the numbers make no sense or would tear it away;
                nothing is changed then.
        """
        push(self.assembly, body, force, torque)

    def drive_plunger(
        self, plunger: str, force: float | None = None, velocity: float | None = None, max_speed: float | None = None
    ) -> None:
        """Press a plunger with another force, or move or hold it at a velocity, from now on; ``reset`` brings the first one back.

        Args:
            plunger: name.
            force: along its normal [N]; its mass is the scene's, that of all grains where none is given there.
            velocity: instead of it, along its normal [m/s]; 0 holds it.
            max_speed: with a force, how fast the plunger gets at most [m/s]; as it is if None.

        Raises:
            CommandError: if there is no such plunger, or the numbers make no sense; nothing is changed then.
        """
        self._health()
        drive(self.assembly, plunger, force, velocity, max_speed)

    def _go_on_with(self, assembly: Assembly) -> None:
        """Go on with other grains or tools, after a moment in which no time has passed.

        So all energy that is there now and was not before has come with them, and what is missing has gone with them.
        """
        was, start = self._health(), replace(self._start)
        self.assembly = assembly
        self._look_anew()
        now = self._health()
        start.total += was.dissipated - now.dissipated
        start.height += now.potential - was.potential
        start.grains += was.retired - now.retired
        start.rounding = max(start.rounding, balance_rounding(assembly))
        self._start, self._measured = start, None
        self._good_health, self._good, self._kept_steps = self._health(), self.save(), self._solver.steps_done

    def _look_anew(self) -> None:
        """Forget what has been found out about other grains or tools."""
        self._swept.set_tools(self.tools)
        self._beforehand = self._overlap + find_fine_surfaces(self.assembly) + find_coarseness(self.assembly)
        self._measured: tuple[int, Health] | None = None
