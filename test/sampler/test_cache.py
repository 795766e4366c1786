"""Bodies that were sampled before, and the command line."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sampler import MeshError, cache, load_body, sample_file, sample_mesh, save_body
from sampler.cache import cache_folder

BUCKET = Path(__file__).parents[2] / "config" / "meshes" / "bucket.stl"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SAMPLER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def box(tmp_path):
    trimesh.creation.box((0.1, 0.06, 0.02)).export(tmp_path / "box.stl")
    return tmp_path / "box.stl"


def test_second_load_is_the_first(box, folder, monkeypatch):
    first = sample_file(box, 0.004, grain=0.003)
    assert len(list(folder.iterdir())) == 1
    monkeypatch.delattr("sampler.cache.sample_body")
    second = sample_file(box, 0.004, grain=0.003)
    for name in ("points", "normals", "triangles", "inertia"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    assert (first.evenness, first.steps, first.warnings) == (second.evenness, second.steps, second.warnings)


def test_what_is_doubtful_of_the_mass_is_kept_too(tmp_path, folder):
    bars = [trimesh.creation.box(np.roll((0.1, 0.02, 0.02), k)) for k in range(2)]
    trimesh.util.concatenate(bars).export(tmp_path / "cross.stl")
    first, second = (sample_file(tmp_path / "cross.stl", 0.004) for _ in range(2))
    assert first.warnings == second.warnings == ()
    assert first.mass_warnings == second.mass_warnings
    assert "buried in others" in first.mass_warnings[0]


def test_other_content_or_options_are_sampled_anew(box, folder):
    sample_file(box, 0.004)
    sample_file(box, 0.005)
    sample_file(box, 0.004, scale=2.0)
    sample_file(box, 0.004, seed=1)
    trimesh.creation.box((0.1, 0.06, 0.03)).export(box)
    sample_file(box, 0.004)
    assert len(list(folder.iterdir())) == 5


def test_the_same_bytes_under_another_ending_are_another_content(box, tmp_path):
    sample_file(box, 0.004)
    other = tmp_path / "box.obj"
    other.write_bytes(box.read_bytes())
    with pytest.raises(MeshError):
        sample_file(other, 0.004)


def test_other_triangles_of_the_same_vertices_are_another_content():
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    corners = np.array([[*place, height] for height in (0, 1) for place in square]) * [0.1, 0.06, 0.02]
    volumes = []
    for ring in ([0, 1, 2, 3], [0, 1, 2]):  # a box, and the prism on the one side of its diagonal
        faces = [[0, j + 1, j] for j in ring[1:-1]] + [[4, 4 + j, 4 + j + 1] for j in ring[1:-1]]
        for j, k in zip(ring, [*ring[1:], 0], strict=True):
            faces += [[j, k, k + 4], [j, k + 4, j + 4]]
        volumes.append(sample_mesh(trimesh.Trimesh(corners, faces, process=False), 0.004).volume)
    assert volumes == pytest.approx([0.1 * 0.06 * 0.02, 0.5 * 0.1 * 0.06 * 0.02], rel=1e-6)


def test_another_sampler_samples_anew(box, folder, monkeypatch):
    sample_file(box, 0.004)
    monkeypatch.setattr("sampler.cache._code", lambda: b"of tomorrow")
    sample_file(box, 0.004)
    assert len(list(folder.iterdir())) == 2


def test_all_of_the_sampler_is_asked_whether_it_is_the_same():
    sources = list(Path(cache.__file__).parent.rglob("*.py"))
    assert len(sources) > 40
    assert all(source.read_bytes() in cache._code() for source in sources)


def test_meshes_whose_triangles_lie_in_another_file_are_known_by_that(tmp_path):
    for size in (0.1, 0.2):
        for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.creation.box((size, size, size)))).items():
            if name != "model.gltf" or size == 0.1:  # its bounds are for the eye only
                (tmp_path / name).write_bytes(content)
        body = sample_file(tmp_path / "model.gltf", 0.01)
        assert body.volume == pytest.approx(size**3, rel=1e-6)


def test_damaged_cache_files_are_replaced(box, folder):
    first = sample_file(box, 0.004)
    (kept,) = folder.iterdir()
    whole = kept.read_bytes()
    version = whole.index(b"PK\1\2") + 6  # of the ZIP format that is needed
    unknown = whole[:version] + b"\x63" + whole[version + 1 :]
    header = whole.replace(b"'descr'", b"\"descr'", 1)  # of which NumPy's own parser makes something of its own
    assert header != whole
    for broken in (b"", whole[: len(whole) // 2], b"\xff" + whole[1:], whole[:-40], unknown, header):
        kept.write_bytes(broken)
        assert np.array_equal(sample_file(box, 0.004).points, first.points)
        assert load_body(kept).radius == 0.004


def test_cache_survives_a_killed_writer(box, folder):
    code = (
        "import numpy as np, os, signal, sys; from sampler import sample_file\n"
        "save = np.savez\n"
        "def killed(file, **arrays):\n"
        "    file.write(b'half of it'); file.flush(); os.kill(os.getpid(), signal.SIGKILL)\n"
        "np.savez = killed\n"
        f"sample_file({str(box)!r}, 0.004)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, cwd=Path(__file__).parents[2], capture_output=True)
    assert done.returncode == -signal.SIGKILL
    (left,) = folder.iterdir()
    body = sample_file(box, 0.004)
    assert len(body) > 100
    assert len(list(folder.iterdir())) == 2
    os.utime(left, (0, 0))
    sample_file(box, 0.005)
    assert not left.exists()


def test_a_folder_that_cannot_be_written_does_no_harm(box, folder):
    folder.write_text("a file where the folder should be")
    assert cache_folder() == folder
    assert len(sample_file(box, 0.004)) > 100


def test_without_a_home_bodies_are_sampled_all_the_same(box, monkeypatch):
    def nobody():
        raise RuntimeError("Could not determine home directory.")

    for name in ("SAMPLER_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", nobody)
    assert len(sample_file(box, 0.004)) > 100


def test_a_file_that_may_not_be_read_is_named(box, monkeypatch):
    def forbidden(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_bytes", forbidden)
    with pytest.raises(MeshError, match=r"mesh box\.stl: cannot be read: Permission denied"):
        sample_file(box, 0.004)


def run(*arguments):
    command = [sys.executable, "-W", "ignore", "-m", "sampler", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])


def test_command_line(tmp_path):
    done = run(
        BUCKET, "--radius", 0.006, "--count", 500, "--density", 7800, "-o", tmp_path / "b.npz", "--rrd", tmp_path / "b.rrd"
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr  # no greeting, and no complaint about a missing GPU
    rows = dict(line.split("  ", 1) for line in done.stdout.splitlines() if "  " in line)
    for name in ("size", "mended", "particles", "spacing h", "coverage", "thinnest wall", "mass", "time"):
        assert name in rows
    body = load_body(tmp_path / "b.npz")
    assert abs(len(body) - 500) <= 5
    assert float(rows["mass"].split()[0]) == pytest.approx(7800 * body.volume, rel=1e-5)
    assert (tmp_path / "b.rrd").stat().st_size > 50_000


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing.stl", "--radius", 0.01], "there is no file"),
        ([BUCKET, "--radius", -1], "particle radius must be positive"),
        ([BUCKET, "--radius", 0.01, "--count", 10, "--spacing", 0.1], "either the spacing or the count"),
        ([BUCKET, "--radius", 0.002, "--count", 300, "--grain", 0.001], "could pass"),
        ([BUCKET, "--radius", 0.01, "--density", 0], "a density [kg/m^3] or a mass [kg], positive"),
        ([BUCKET, "--radius", 0.01, "-o", "nowhere/bucket.npz"], "cannot write nowhere/bucket.npz: there is no folder nowhere"),
        ([BUCKET, "--radius", 0.01, "-o", "."], "cannot write .: it is a folder"),
        ([BUCKET, "--radius", 0.01, "-o", BUCKET], "it is the mesh"),
    ],
)
def test_command_line_refuses_with_one_line_before_the_work(folder, arguments, reason):
    done = run(*arguments)
    assert done.returncode == 1
    assert not folder.exists()
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert reason in line


def test_on_a_terminal_reasons_have_a_line_of_their_own():
    """Below the bar, not behind it."""
    main, end = os.openpty()
    command = [sys.executable, "-m", "sampler", str(BUCKET), "--radius", "0.01", "--count", "5", "--grain", "0.001"]
    child = subprocess.Popen(command, stdout=end, stderr=end, cwd=Path(__file__).parents[2])
    os.close(end)
    text = b""
    with contextlib.suppress(OSError):  # as which the end of a terminal is told
        while more := os.read(main, 10_000):
            text += more
    os.close(main)
    assert child.wait() == 1
    lines = text.decode().splitlines()
    assert lines[-1].startswith("error: a grain of radius 0.001 m could pass")
    assert lines[-2].endswith("100 %")


def test_what_is_no_file_is_not_replaced_by_one(tmp_path):
    """As /dev/null, which root would take from everybody else."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for option in ("-o", "--rrd"):
        done = run(BUCKET, "--radius", 0.01, option, pipe)
        assert (done.returncode, done.stderr) == (1, f"error: cannot write {pipe}: it is no file\n")
    with pytest.raises(MeshError, match="cannot be written: it is no file"):
        save_body(pipe, sample_file(BUCKET, 0.01))
    assert pipe.is_fifo()


def test_body_and_recording_are_two_files(tmp_path):
    done = run(BUCKET, "--radius", 0.01, "-o", tmp_path / "b", "--rrd", tmp_path / "." / "b")
    assert (done.returncode, done.stderr) == (1, f"error: cannot write {tmp_path / 'b'}: it is named twice\n")


def test_a_body_without_a_volume_is_written_all_the_same(tmp_path):
    flat = trimesh.creation.box((0.1, 0.1, 1e-9))
    flat.update_faces([True, False, *[True] * 10])
    flat.export(tmp_path / "flat.obj")
    done = run(tmp_path / "flat.obj", "--radius", 0.005, "--density", 7800, "-o", tmp_path / "flat.npz")
    assert done.returncode == 0, done.stderr
    assert "encloses no sound volume; mass and inertia must be given by hand" in done.stdout
    assert "kg" not in done.stdout
    assert len(load_body(tmp_path / "flat.npz")) > 0


def test_ctrl_c_while_modules_are_imported_is_no_error(tmp_path):
    (tmp_path / "warp.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nwhile True:\n    pass\n")
    command = [sys.executable, "-m", "sampler", str(BUCKET), "--radius", "0.01"]
    places = {**os.environ, "PYTHONPATH": f"{tmp_path}:{Path(__file__).parents[2]}"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=places)
    assert done.returncode == -signal.SIGINT, "as a shell is told that the user stopped it"
    assert not done.stderr


@pytest.mark.parametrize("buffered", ["", "1"])
def test_output_that_nobody_reads_is_no_error(buffered):
    command = f"{sys.executable} -m sampler {BUCKET} --radius 0.01 | true"
    places = {**os.environ, "PYTHONUNBUFFERED": buffered}
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, env=places)
    assert not done.stderr


def test_a_folder_for_kernels_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path / "file")}
    command = [sys.executable, "-m", "sampler", str(BUCKET), "--radius", "0.01"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: compiled kernels cannot be kept: [Errno 20] Not a directory")
    assert done.stderr.endswith("; set WARP_CACHE_PATH to a folder that can be written\n")
