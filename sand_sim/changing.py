"""The part of a world that changes what is in it while it runs: grains come and go, tools get other bodies."""

from dataclasses import replace

import numpy as np

from sand_sim.assemble import Assembly
from sand_sim.beforehand import find_coarseness, find_fine_tools
from sand_sim.border import Health
from sand_sim.carrying_over import carry_over, rebuild
from sand_sim.exchange import admit, check_room, dismiss, find_grains, read_grains
from sand_sim.grain_table import GrainTable
from sand_sim.observing import StartEnergy, observe_grains, observe_spheres
from sand_sim.scene.stable_step import DEEP
from sand_sim.tool_exchange import check_tool, read_tool


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
            start = admit(self._start, self.assembly, rows)
            self._go_on_with(rebuild(self.assembly, GrainTable.join([table, rows]), self.tools), start)
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
        start = dismiss(self._start, self.assembly, cloud, gone)
        self._solver.remove(np.flatnonzero(np.isin(self.assembly.grain_of_sphere, gone)))
        self._go_on_with(self.assembly, start)
        return gone

    def set_tool_mesh(self, tool: str, mesh: str, scale: float = 1.0, overlap: float = DEEP) -> None:
        """Give a tool another body at the pose it has; what it does and has done stays, ``reset`` brings the first one back.

        Args:
            tool: name.
            mesh: file, or address as in a scene.
            scale: [m per mesh unit].
            overlap: share of a grain's radius that the new body may cut into at most [1].

        Raises:
            CommandError: if the mesh cannot be used, or overlaps grains by more; nothing is changed then.
        """
        index, before = self._index_of(tool), self._health()
        model = read_tool(self.assembly, self.tools[index].tool, mesh, scale)
        tools = [*self.tools[:index], model, *self.tools[index + 1 :]]
        check_tool(self.assembly, tools, index, self._poses[index], observe_spheres(self.assembly), overlap)
        self._sweep()
        self._models[index, model.tool.mesh, model.tool.scale] = model
        self._go_on_with(rebuild(self.assembly, self.assembly.table, tools), self._start, replaced=index)
        # What is stored in its contacts now has been brought by the exchange, not by motion.
        self._start = replace(self._start, total=self._start.total + self._health().elastic - before.elastic)
        self._measured = None
        self._keep_anyway()

    def _go_on_with(self, assembly: Assembly, start: StartEnergy, replaced: int | None = None) -> None:
        """Go on from here with other grains or tools."""
        if assembly is not self.assembly:
            carry_over(self.assembly, assembly, replaced)
        self.assembly, self._start = assembly, start
        self._look_anew()
        self._keep_anyway()

    def _look_anew(self) -> None:
        self._swept.set_tools(self.tools)
        self._beforehand = self._overlap + find_fine_tools(self.assembly) + find_coarseness(self.assembly)
        self._measured: tuple[int, Health] | None = None

    def _keep_anyway(self) -> None:
        self._good_health, self._good, self._kept_steps = self._health(), self.save(), self._solver.steps_done
