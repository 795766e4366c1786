"""Contacts of a tool, one by one, against its wrench and against Hertz."""

import numpy as np
import pytest
import trimesh
from scenes import SceneMaker, write_small_scene

from sand_sim import CommandError, ToolPose, World, load_scene, read_scene, rotation

YOUNG, POISSON, RADIUS, PARTICLE = 1e7, 0.25, 0.005, 0.002


def dig(tmp_path, **further):
    """The small scene with the plate pressed into its bed and drawn along it."""
    world = World(load_scene(write_small_scene(tmp_path, **further)))
    for at, position in ((0.1, [0.015, 0.015, 0.0222]), (0.12, [0.02, 0.015, 0.022])):
        world.apply(ToolPose("plate", np.array(position), np.array([0.0, 0.0, 0.0, 1.0]), at))
        world.step(round((at - world.time) / world.time_step))
    return world


@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("single", 1e-5)])
@pytest.mark.parametrize("rolling", ["none", "spring"])
def test_contacts_add_up_to_the_wrench(tmp_path, precision, tolerance, rolling):
    pair = {"restitution": 0.3, "friction": 0.5}
    if rolling != "none":
        pair |= {"rolling_friction": 0.2}
    pairs = [{"between": ["sand", other]} | pair for other in ("sand", "steel")]
    world = dig(tmp_path, solver={"precision": precision}, pairs=pairs, contact={"rolling": rolling})
    contacts = world.tool_contacts("plate")
    wrench = world.assembly.solver.arrays.tools.wrench.numpy()[0]
    assert len(contacts) > 10
    assert np.linalg.norm(wrench[0]) > 1.0
    assert contacts.wrench[0] == pytest.approx(wrench[0], abs=tolerance * np.abs(contacts.force).sum())
    moments = np.abs(np.cross(contacts.point - contacts.origin, contacts.force)).sum()
    assert contacts.wrench[1] == pytest.approx(wrench[1], abs=tolerance * moments)
    assert contacts.couple.any() == (rolling != "none")
    report = world.observe().tool("plate")
    assert contacts.origin == pytest.approx(report.position, abs=1e-9)


def test_the_wrench_is_told_in_the_axes_of_the_tool(tmp_path):
    world = World(load_scene(write_small_scene(tmp_path)))
    world.apply(ToolPose("plate", np.array([0.015, 0.015, 0.023]), rotation.from_rpy(0.1, -0.05, 1.0), 0.2))
    world.step(round(0.2 / world.time_step))
    world.observe()
    report = world.observe().tool("plate")  # of this moment, as no time has passed in between
    back = rotation.to_matrices(report.orientation).T
    for told, wrench in zip((report.force, report.torque), world.tool_contacts("plate").wrench, strict=True):
        size = np.linalg.norm(wrench)
        assert told == pytest.approx(back @ wrench, abs=1e-4 * size)
        assert np.linalg.norm(told - wrench) > 0.05 * size


def test_points_lie_where_grain_and_tool_meet(tmp_path):
    world = dig(tmp_path)
    contacts, shown = world.tool_contacts("plate"), world.observe()
    cloud = shown.grains
    row = np.searchsorted(cloud.identity, contacts.identity)
    away = cloud.position[row] - contacts.point
    assert np.linalg.norm(contacts.normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    assert np.einsum("ij,ij->i", away, contacts.normal) == pytest.approx(cloud.radius[row] - 0.5 * contacts.overlap, abs=1e-9)
    assert (contacts.overlap > 0.0).all()
    assert (contacts.overlap / cloud.radius[row]).max() <= shown.health.deepest * (1.0 + 1e-4)
    assert (np.einsum("ij,ij->i", contacts.force, contacts.normal) < 0.0).mean() > 0.9  # grains push the plate away


def test_single_grain_pressed_on_a_particle_follows_hertz(tmp_path):
    """A grain held still 20 um deep above one particle of a plate: F = 4/3 E* sqrt(R*) d^(3/2) along the line of centres."""
    trimesh.creation.box((0.06, 0.06, 0.004)).export(tmp_path / "plate.stl")
    material = {"density": 2500.0, "young": YOUNG, "poisson": POISSON}
    tools = {"plate": {"mesh": "plate.stl", "material": "wall", "particle_radius": PARTICLE, "max_speed": 1.0}}
    maker, overlap = SceneMaker(tmp_path), 20e-6
    shared = {"tools": tools, "material": material, "wall": material, "domain": {"low": [-0.1] * 3, "high": [0.1] * 3}}
    far = World(read_scene(maker.scene([[0.0, 0.0, 0.05]], RADIUS, **shared), tmp_path))
    assert len(far.tool_contacts("plate")) == 0
    points = far.tools[0].body.points
    top = points[np.argmin(np.linalg.norm(points - [0.0, 0.0, points[:, 2].max()], axis=1))]
    place = top + [0.0, 0.0, RADIUS + PARTICLE - overlap]
    world = World(read_scene(maker.scene([place], RADIUS, **shared), tmp_path))
    contacts = world.tool_contacts("plate")
    stiff, round_ = 0.5 * YOUNG / (1.0 - POISSON**2), RADIUS * PARTICLE / (RADIUS + PARTICLE)
    force = 4.0 / 3.0 * stiff * np.sqrt(round_) * overlap**1.5
    assert len(contacts) == 1
    assert contacts.identity.tolist() == [0]
    assert contacts.overlap == pytest.approx([overlap], rel=1e-9)
    assert contacts.normal == pytest.approx(np.array([[0.0, 0.0, 1.0]]), abs=1e-9)
    assert contacts.force == pytest.approx(np.array([[0.0, 0.0, -force]]), rel=1e-3, abs=1e-9 * force)
    assert contacts.point == pytest.approx(place[None] - [[0.0, 0.0, RADIUS - 0.5 * overlap]], abs=1e-12)


def test_each_of_several_tools_is_as_hard_as_its_own_material(tmp_path):
    """Three plates of three materials, one of them smooth, and a grain 20 um deep in each: F = 4/3 E* sqrt(R*) d^(3/2)."""
    trimesh.creation.box((0.06, 0.06, 0.004)).export(tmp_path / "plate.stl")
    young, overlap, across = {"wall": 4.0 * YOUNG, "wood": 0.5 * YOUNG, "tin": 2.0 * YOUNG}, 20e-6, {}
    place = {name: np.array([0.0, 0.1 * k, 0.03 * k]) for k, name in enumerate(young)}
    plate = {"mesh": "plate.stl", "particle_radius": PARTICLE}
    tools = {f"of_{name}": plate | {"material": name, "pose": {"position": at.tolist()}} for name, at in place.items()}
    tools["of_tin"]["contact"] = "smooth"
    domain, maker = {"low": [-0.4] * 3, "high": [0.4] * 3}, SceneMaker(tmp_path)

    def make(position):
        content = maker.scene(position, RADIUS, tools=tools, domain=domain)
        for name, stiffness in young.items():
            content["materials"][name] = {"density": 2500.0, "young": stiffness, "poisson": POISSON}
        content["materials"]["grain"] = {"density": 2500.0, "young": YOUNG, "poisson": POISSON}
        content["pairs"] += [{"between": ["grain", name], "restitution": 0.5, "friction": 0.5} for name in ("wood", "tin")]
        return World(read_scene(content, tmp_path))

    position = []
    for model in make([[0.0, 0.0, -0.3]]).tools:
        name, points = model.tool.material, model.body.points
        top = points[np.argmin(np.linalg.norm(points - [0.0, 0.0, points[:, 2].max()], axis=1))]
        across[name] = RADIUS if model.smooth else RADIUS * PARTICLE / (RADIUS + PARTICLE)
        position.append(place[name] + (top + [0.0, 0.0, RADIUS + model.margin - overlap]))
    world = make(position)
    for k, name in enumerate(across):
        contacts, stiffness = world.tool_contacts(f"of_{name}"), young[name]
        effective = 1.0 / ((1.0 - POISSON**2) * (1.0 / YOUNG + 1.0 / stiffness))
        force = 4.0 / 3.0 * effective * np.sqrt(across[name]) * overlap**1.5
        assert contacts.identity.tolist() == [k]
        assert contacts.force[0] == pytest.approx([0.0, 0.0, -force], rel=1e-3, abs=1e-6 * force)


def test_unknown_tool_is_named(tmp_path):
    with pytest.raises(CommandError, match="'spade' is unknown; known are plate"):
        World(load_scene(write_small_scene(tmp_path))).tool_contacts("spade")
