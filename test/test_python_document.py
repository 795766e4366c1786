"""What ``docs/python.md`` shows is run as it stands there, and gives what it says."""

import re
from pathlib import Path

import numpy as np
import pytest

DOCUMENT = Path(__file__).parents[1] / "docs" / "python.md"


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The names that are there after all blocks have run, one after the other."""
    names, there = {}, pytest.MonkeyPatch()
    there.chdir(tmp_path_factory.mktemp("document"))
    for block in re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL):
        exec(block, names)
    there.undo()
    return names


def test_the_plate_feels_the_sand_that_it_is_pressed_into(shown):
    depth, force = np.array(shown["depth"]), np.array(shown["force"])
    assert depth[-1] == pytest.approx(0.013, abs=1e-9)
    assert np.all(force[depth < -0.005] == 0.0)
    assert force[-1] > 1.0
    assert not shown["seen"].health.doubts


def test_contacts_give_coordination_and_stress(shown):
    """Frictional spheres at rest have four contacts each or a little more; stress times volume is what the virial theorem says.

    Where nothing moves, forces times heights add up to nothing: those between grains balance weights, walls and plate.
    """
    assert 3.8 < shown["coordination"] < 5.0
    world, grains, stress, height = shown["world"], shown["grains"], shown["stress"], shown["centre"][:, 2]
    world.restore(shown["state"])
    borne = 9.81 * (grains.mass.astype(float) * grains.position[:, 2]).sum()
    arrays, plate = world.assembly.solver.arrays, world.tool_contacts("plate")
    walls, number = arrays.wall_list, arrays.wall_list.pairs.get()
    touched = world.assembly.grain_of_sphere[arrays.grains.identity.numpy()[walls.owner.numpy()[:number]]]
    borne -= (walls.force.numpy()[:number, 2] * height[touched]).sum() - (plate.force[:, 2] * height[plate.identity]).sum()
    assert stress[2, 2] * 0.08 * 0.08 * 0.04 == pytest.approx(borne, rel=0.01)
    assert np.abs(stress - stress.T).max() < 0.1 * stress[2, 2]


def test_trials_from_one_state_part_and_go_back_to_it(shown):
    world, state = shown["world"], shown["state"]
    assert shown["lifted"][0] != shown["lifted"][1]
    world.restore(state)
    again = world.save()
    assert all(np.array_equal(again[name], state[name]) for name in state)


def test_the_plate_sinks_until_the_sand_bears_its_load(shown):
    assert shown["borne"] == pytest.approx((1.0, 2.0, 4.0), rel=0.02)
    assert 0.0 < shown["sinkage"][0] < shown["sinkage"][1] < shown["sinkage"][2] < 0.03


def test_a_bed_without_its_walls_slumps(shown):
    """A block about as high as half its width reaches to about 1 + 1.24 times that ratio (Lube et al. 2004, for round ones)."""
    free, before = shown["free"].observe(), shown["grains"]
    assert len(free.grains) == len(before)
    assert not free.health.doubts
    ratio = before.position[:, 2].max() / 0.04
    reached = np.percentile(np.abs(free.grains.position[:, :2]).max(axis=1), 97) / 0.04  # some grains roll farther
    assert reached == pytest.approx(1.0 + 1.24 * ratio, rel=0.2)
