"""OBJ files of cubes, written in every way."""

import re

import numpy as np
import pytest

from sampler import MeshError, read_mesh

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
SQUARES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]  # outward, counted from one


def obj_cube(at=0, indices=SQUARES):
    vertices = [f"v {x + at} {y} {z}" for x, y, z in CORNERS]
    return "\n".join([*vertices, *("f " + " ".join(map(str, square)) for square in indices), ""])


def test_indices_of_obj_count_back_from_their_line(tmp_path):
    backwards = np.array(SQUARES) - 9
    textured = [[f"{corner}/-1/-1" for corner in square] for square in backwards]
    (tmp_path / "two.obj").write_text(obj_cube(0, backwards) + "vt 0 0\nvn 0 0 1\n" + obj_cube(5, textured))
    mesh = read_mesh(tmp_path / "two.obj")
    assert mesh.volume == pytest.approx(2.0)
    assert mesh.bounds == pytest.approx(np.array([[0, 0, 0], [6, 1, 1]]))
    # Every square with vertices of its own.
    lines = [f"v {' '.join(map(str, CORNERS[corner - 1]))}" for square in SQUARES for corner in square]
    squares = [line for at in range(0, 24, 4) for line in [*lines[at : at + 4], "f -4 -3 -2 -1"]]
    (tmp_path / "apart.obj").write_text("\n".join(squares))
    assert read_mesh(tmp_path / "apart.obj").volume == pytest.approx(1.0)


def test_an_index_of_obj_that_counts_back_too_far_is_refused(tmp_path):
    # Enough vertices in the whole file, but not so far.
    (tmp_path / "far.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n" + obj_cube())
    with pytest.raises(MeshError, match="'f 3 2 -4' refers to a vertex that is not among the 11"):
        read_mesh(tmp_path / "far.obj")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (r"\A", "\ufeff"),
        (" ", "\t"),
        (r"(?m)^(?=[vf])", " \t"),
        (r"\n", "\r\n"),
        (r"\n", "\r"),
        (r"(f \d) (\d)", r"\1\\\n\2"),
        (r"(f \d) (\d)", r"\1 \\\r\n \2"),
        (r"\n", " # of a cube\n"),
    ],
    ids=["mark", "tabs", "indented", "crlf", "cr", "continued", "continued-crlf", "remarks"],
)
def test_obj_is_read_however_it_is_written(tmp_path, old, new):
    (tmp_path / "odd.obj").write_bytes(re.sub(old, new, obj_cube()).encode())
    mesh = read_mesh(tmp_path / "odd.obj", scale=0.5)
    assert len(mesh.faces) == 12
    assert mesh.volume == pytest.approx(0.125)


@pytest.mark.parametrize("old", ["v 1 1 1", "v 0 0 0"])
def test_vertices_without_three_coordinates_are_refused(tmp_path, old):
    (tmp_path / "flat.obj").write_text(obj_cube().replace(old, old[:-2]))
    with pytest.raises(MeshError, match=r"flat\.obj: has a vertex with fewer than three coordinates"):
        read_mesh(tmp_path / "flat.obj", scale=0.5)


def test_a_face_of_obj_that_is_not_of_numbers_is_refused(tmp_path):
    (tmp_path / "float.obj").write_text(obj_cube().replace("f 1 2", "f 1.0 2"))
    with pytest.raises(MeshError, match=r"'f 1\.0 2 4 3' refers to a vertex that is not among the 8"):
        read_mesh(tmp_path / "float.obj")
