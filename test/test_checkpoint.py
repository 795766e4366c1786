"""Checkpoints: to the bit, whole or not at all, and only where they belong."""

import hashlib
import io
import json
import threading

import numpy as np
import pytest
import yaml
from scenes import write_small_scene

from sand_sim import World, load_scene
from sand_sim.checkpoint import (
    Checkpoint,
    CheckpointError,
    DamagedCheckpointError,
    OtherSceneError,
    load_checkpoint,
    read_checkpoint,
    take_checkpoint,
    write_checkpoint,
)
from sand_sim.checkpoints import CheckpointFolder
from sand_sim.tool_motion.playing import commands_at, frame_times

BEFORE, AFTER = 0.2, 0.3  # [s] the plate is in the sand from 0.25 s on


def play(world, end):
    """Play the scene's trajectory up to a time; what the tool felt in each frame."""
    felt = []
    for time in frame_times(world.scene, end):
        if time > world.time + 0.5 * world.time_step:
            for command in commands_at(world.scene, time):
                world.apply(command)
            world.step(round((time - world.time) / world.time_step))
            felt.append(world.observe().tools[0].world_force)
    return np.array(felt)


def same(one, other):
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory):
    return write_small_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def world(scene_path):
    return World(load_scene(scene_path))


@pytest.fixture
def written(world, tmp_path):
    """A checkpoint at ``BEFORE``."""
    world.reset()
    play(world, BEFORE)
    path = tmp_path / "good.checkpoint"
    write_checkpoint(path, take_checkpoint(world, {"limited": 3}, {"row/time": np.arange(5.0)}))
    return path


def test_goes_on_to_the_bit_in_a_new_world(world, written, scene_path):
    felt, expected = play(world, AFTER), world.save()
    assert np.abs(felt).max() > 0.1, "the plate must touch the sand"
    other = World(load_scene(scene_path))
    load_checkpoint(written, other)
    assert other.time == pytest.approx(BEFORE)
    assert np.array_equal(play(other, AFTER), felt)
    assert same(other.save(), expected)


def test_what_is_read_is_what_was_written(written):
    read = read_checkpoint(written)
    assert read.commands == {"limited": 3}
    assert np.array_equal(read.history["row/time"], np.arange(5.0))
    assert read.time == pytest.approx(BEFORE)


def damage(content, kind):
    middle = len(content) // 2
    return {
        "empty": b"",
        "zeros": bytes(len(content)),
        "zero tail": content[:middle] + bytes(len(content) - middle),
        "cut": content[:-1],
        "cut early": content[:30],
        "one bit": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
        "first bit": bytes([content[0] ^ 1]) + content[1:],
        "header": content[:40] + b"#" + content[41:],
        "longer": content + b"\0",
    }[kind]


@pytest.mark.parametrize("kind", ["empty", "zeros", "zero tail", "cut", "cut early", "one bit", "first bit", "header", "longer"])
def test_damage_is_named_and_harms_nothing(world, written, kind):
    written.write_bytes(damage(written.read_bytes(), kind))
    before = world.save()
    with pytest.raises(DamagedCheckpointError, match=r"good\.checkpoint: .*(damaged|no checkpoint)"):
        load_checkpoint(written, world)
    assert same(world.save(), before)


def test_each_single_byte_counts(written):
    """Wherever a byte of a small file is wrong, it is seen."""
    small = written.with_name("small.checkpoint")
    write_checkpoint(small, Checkpoint({"time": 0.0}, {"one": np.arange(3)}))
    content = small.read_bytes()
    for place in range(len(content)):
        small.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        with pytest.raises(CheckpointError):
            read_checkpoint(small)


def test_another_format_is_named(written):
    written.write_bytes(written.read_bytes().replace(b"checkpoint 2", b"checkpoint 1", 1))
    with pytest.raises(CheckpointError, match="is of format 1, this sand_sim reads 2"):
        read_checkpoint(written)


@pytest.mark.parametrize(
    ("header", "shape"),
    [
        ({}, (10**30,)),
        ({}, (-1,)),
        ({"time": 10**400}, (1,)),
        ({"steps": None}, (1,)),
        ({"steps": float("inf")}, (1,)),
        ({"state": 3}, (1,)),
    ],
)
def test_what_a_sound_checksum_lets_through_is_refused_too(tmp_path, header, shape):
    array = io.BytesIO()
    np.lib.format.write_array_header_1_0(array, {"descr": "<f8", "fortran_order": False, "shape": shape})
    words = json.dumps({"time": 0.0, "steps": 0, "commands": {}, "state": ["one"], "history": []} | header).encode()
    content = b"sand_sim checkpoint 2\n" + len(words).to_bytes(8, "little") + words + array.getvalue() + bytes(8)
    path = tmp_path / "strange.checkpoint"
    path.write_bytes(content + hashlib.sha256(content).digest())
    with pytest.raises(DamagedCheckpointError, match="cannot be understood"):
        read_checkpoint(path)


def test_what_is_no_file_is_refused(world, tmp_path):
    for path in (tmp_path, tmp_path / "nothing", "/dev/zero"):
        with pytest.raises(CheckpointError, match=f"{path}: "):
            load_checkpoint(type(tmp_path)(path), world)


def rewritten(path, change):
    """The file with a change of its state, and a checksum that fits."""
    checkpoint = read_checkpoint(path)
    change(checkpoint.state)
    write_checkpoint(path, checkpoint)


def put(name, value):
    def change(state):
        state[name][...] = value

    return change


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (put("pair.partner", 2**30), "pair.partner"),
        (put("pair.owner", -1), "pair.owner"),
        (put("pair.starts", 7), "pair.starts"),
        (put("wall.number", 2**40), "wall"),
        (put("grains.identity", 0), "grains.identity"),
        (put("grains.number", 10**6), "grains.number"),
        (put("grains.motion", np.nan), "grains.motion"),
        (put("met.order", 10**8), "met.order"),
        (put("tools.travelled", np.inf), "tools.travelled"),
        (put("swept.shape", 10**6), "swept.shape"),
        (lambda state: state.pop("grains.spin"), "grains.spin"),
        (lambda state: state.update({"grains.place": state["grains.place"][:5]}), "grains.place"),
        (lambda state: state.update({"grains.place": state["grains.place"].astype(float)}), "grains.place"),
    ],
)
def test_a_strangers_state_is_refused_before_a_kernel_sees_it(world, written, change, word):
    rewritten(written, change)
    before = world.save()
    with pytest.raises(DamagedCheckpointError, match=rf"holds no state of this scene: .*{word}"):
        load_checkpoint(written, world)
    assert same(world.save(), before)


def changed(scene_path, folder, **changes):
    parsed = yaml.safe_load(scene_path.read_text())
    for name, value in changes.items():
        *where, last = name.split("__")
        place = parsed
        for key in where:
            place = place[int(key) if key.isdigit() else key]
        place[last] = value
    for file in ("plate.stl", "bed.npz"):
        if not (folder / file).exists():
            (folder / file).write_bytes((scene_path.parent / file).read_bytes())
    path = folder / "other.yaml"
    path.write_text(yaml.safe_dump(parsed, sort_keys=False))
    return load_scene(path)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"materials__sand__young": 2e7}, "another scene: materials.sand.young is 10000000.0 there and 20000000.0 here"),
        ({"pairs__0__friction": 0.4}, "pairs.sand and sand.friction"),
        ({"gravity": [0.0, 0.0, -1.6]}, "gravity.2"),
        (
            {"contact": {"rolling": "spring"}, "pairs__0__rolling_friction": 0.1, "pairs__1__rolling_friction": 0.1},
            "contact.rolling",
        ),
        ({"solver": {"precision": "double"}}, "was made in single precision, this world has double"),
        ({"solver": {"time_step": 1e-5}}, "time steps of .* s, this world's are 1e-05 s"),
        ({"solver": {"integrator": "symplectic_euler"}}, "solver.integrator"),
    ],
)
def test_another_scene_is_refused_by_field(written, scene_path, tmp_path, changes, reason):
    other = World(changed(scene_path, tmp_path, **changes))
    before = other.save()
    with pytest.raises(OtherSceneError, match=reason):
        load_checkpoint(written, other)
    assert same(other.save(), before)


def test_contents_of_files_count(written, scene_path, tmp_path):
    mesh = (scene_path.parent / "plate.stl").read_bytes()
    (tmp_path / "plate.stl").write_bytes(mesh[:-20] + b"\x3c" + mesh[-19:])
    with pytest.raises(OtherSceneError, match=r"tools\.plate\.mesh is sha256"):
        load_checkpoint(written, World(changed(scene_path, tmp_path)))
    (tmp_path / "plate.stl").write_bytes(mesh)
    with np.load(scene_path.parent / "bed.npz") as bed:
        np.savez(tmp_path / "bed.npz", position=bed["position"] + [0.0, 0.0, 1e-4], radius=bed["radius"])
    with pytest.raises(OtherSceneError, match=r"fills\.0\.file is sha256"):
        load_checkpoint(written, World(changed(scene_path, tmp_path)))


def test_paths_order_of_keys_and_what_a_run_may_change_do_not_count(written, scene_path, tmp_path):
    parsed = yaml.safe_load(scene_path.read_text())
    turned = {name: dict(reversed(part.items())) if isinstance(part, dict) else part for name, part in reversed(parsed.items())}
    turned["pairs"] = [{**rule, "between": rule["between"][::-1]} for rule in reversed(turned["pairs"])]
    turned |= {"name": "renamed", "duration": 3.0, "solver": {"threads": 2}}
    turned["tools"]["plate"] |= {"mesh": "elsewhere.stl"}
    turned["tools"]["plate"]["trajectory"][-1]["position"] = [0.05, 0.05, 0.05]
    (tmp_path / "elsewhere.stl").write_bytes((scene_path.parent / "plate.stl").read_bytes())
    (tmp_path / "bed.npz").write_bytes((scene_path.parent / "bed.npz").read_bytes())
    path = tmp_path / "turned.yaml"
    path.write_text(yaml.safe_dump(turned, sort_keys=False))
    other = World(load_scene(path))
    load_checkpoint(written, other)
    assert other.time == pytest.approx(BEFORE)


class Told(list):
    __call__ = list.append


def keep(folder, world, told, times):
    """Run and keep a checkpoint at each time."""
    checkpoints = CheckpointFolder(folder, "small", 0.0, told)
    for time in times:
        play(world, time)
        assert checkpoints.due(world.steps)
        checkpoints.offer(take_checkpoint(world))
        assert not checkpoints.due(world.steps), "nothing new"
        checkpoints._writer.submit(int).result()
    return checkpoints


def test_the_newest_are_kept_and_the_one_before_a_damaged_one_used(world, tmp_path):
    world.reset()
    told = Told()
    keep(tmp_path / "made" / "here", world, told, (0.02, 0.04, 0.06)).close()
    folder = tmp_path / "made" / "here"
    assert sorted(path.name for path in folder.iterdir()) == ["small.00000002.checkpoint", "small.00000003.checkpoint"]
    newest = folder / "small.00000003.checkpoint"
    newest.write_bytes(newest.read_bytes()[:-100])
    warned = Told()
    checkpoints = CheckpointFolder(folder, "small", 0.0, told, warned)
    assert checkpoints.resume(world).time == pytest.approx(0.04)
    assert world.time == pytest.approx(0.04)
    (warning,), (line,) = warned, told
    assert str(newest) in warning
    assert "checksum" in warning
    assert "resumed from" in line
    play(world, 0.08)
    checkpoints.offer(take_checkpoint(world))
    checkpoints.close()
    left = {path.name for path in folder.iterdir()}
    assert {"small.00000002.checkpoint", "small.00000003.checkpoint"} <= left
    assert "small.00000003.checkpoint.damaged" in left


def test_nothing_to_resume_from_is_said(world, tmp_path):
    told = Told()
    checkpoints = CheckpointFolder(tmp_path, "small", 0.0, told)
    assert checkpoints.resume(world) is None
    assert "starting from the beginning" in told[0]
    checkpoints.close()
    (tmp_path / "small.00000001.checkpoint").write_bytes(b"")
    warned = Told()
    checkpoints = CheckpointFolder(tmp_path, "small", 0.0, told, warned)
    assert checkpoints.resume(world) is None
    assert "starting from the beginning" in warned[1], "though there was something"
    checkpoints.close()


def test_a_folder_serves_one_run(tmp_path):
    first = CheckpointFolder(tmp_path, "small")
    with pytest.raises(CheckpointError, match="used by another process"):
        CheckpointFolder(tmp_path, "small")
    first.close()
    CheckpointFolder(tmp_path, "small").close()


def test_a_busy_writer_takes_the_newest_state_and_blocks_nobody(world, tmp_path, monkeypatch):
    going, on = threading.Event(), threading.Event()

    def write(path, checkpoint):
        going.set()
        on.wait(30.0)
        write_checkpoint(path, checkpoint)

    monkeypatch.setattr("sand_sim.checkpoints.write_checkpoint", write)
    checkpoints = CheckpointFolder(tmp_path, "small", 0.0)
    states = [Checkpoint({"time": float(k), "steps": k}, {}) for k in range(1, 6)]
    checkpoints.offer(states[0])
    assert going.wait(10.0)
    for state in states[1:]:
        checkpoints.offer(state)
    on.set()
    checkpoints.close()
    assert [read_checkpoint(path).time for path in checkpoints.files()] == [5.0, 1.0]


def test_a_full_disk_is_told_once_and_left_behind(world, tmp_path, monkeypatch):
    """A writer without room leaves the files that are there; it is heard of when it fails first and when it is back."""
    world.reset()
    told = Told()
    checkpoints = keep(tmp_path, world, told, (0.02, 0.04))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def no_room(handle):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("sand_sim.checkpoint.os.fsync", no_room)
        for _ in range(3):
            play(world, world.time + 0.02)
            checkpoints.offer(take_checkpoint(world))
            checkpoints._writer.submit(int).result()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert len(told) == 1
    assert "No space left on device" in told[0]
    play(world, world.time + 0.02)
    checkpoints.offer(take_checkpoint(world))
    checkpoints.close()
    assert len(told) == 2
    assert "written again" in told[1]
    assert read_checkpoint(checkpoints.files()[0]).time == pytest.approx(world.time)


def test_header_can_be_read_by_other_programs(written):
    content = written.read_bytes()
    line, rest = content.split(b"\n", 1)
    assert line == b"sand_sim checkpoint 2"
    header = json.loads(rest[8 : 8 + int.from_bytes(rest[:8], "little")])
    assert header["grains"] == 32
    assert header["precision"] == "single"
