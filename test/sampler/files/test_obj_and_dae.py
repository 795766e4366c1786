"""OBJ and DAE files of cubes: written in every way, and with what readers would leave out or take for something else."""

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


def angle_obj(first, written="{0}"):
    """A prism over a polygon that is not convex, whose last face it is, too."""
    angle = np.roll([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], first, axis=0)
    sides = [(k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6)]
    vertices = [f"v {x} {y} {z}" for z in (0, 1) for x, y in angle]
    faces = [" ".join(["f", *(written.format(k + 1) for k in face)]) for face in (*sides, [*range(5, -1, -1)], [*range(6, 12)])]
    return "\n".join([*vertices, "vt 0 0", "vn 0 0 1", *faces, ""])


@pytest.mark.parametrize("written", ["{0}", "{0}/1/1", "{0}//1"])
@pytest.mark.parametrize("first", range(6))
def test_hollow_polygons_of_obj_do_not_reach_over_their_edge(tmp_path, first, written):
    (tmp_path / "angle.obj").write_text(angle_obj(first, written))
    mesh = read_mesh(tmp_path / "angle.obj")
    assert len(mesh.faces) == 20
    assert mesh.area == pytest.approx(14.0)
    assert mesh.volume == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("old", "new"),
    [(r"\n\Z", ""), (r"(?<=\d) (?=\d)", "\t"), (r"(?<=\d)\n", "\t\n"), (r"(v \d) ", r"\1\t")],
    ids=["no-last-break", "tabs-between", "tabs-at-the-end", "a-tab-in-vertices"],
)
@pytest.mark.parametrize("first", range(6))
def test_hollow_polygons_of_obj_are_found_however_lines_are_written(tmp_path, first, old, new):
    (tmp_path / "angle.obj").write_text(re.sub(old, new, angle_obj(first)))
    assert read_mesh(tmp_path / "angle.obj").area == pytest.approx(14.0)


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


def test_corners_of_obj_with_and_without_texture_and_normal_are_read(tmp_path):
    forms = ["{}", "{}/2", "{}//3", "{}/2/3"]
    mixed = [[forms[(row + k) % 4].format(corner) for k, corner in enumerate(square)] for row, square in enumerate(SQUARES)]
    (tmp_path / "mixed.obj").write_text("vt 0 0\nvt 1 1\n" + 3 * "vn 0 0 1\n" + obj_cube(0, mixed))
    assert read_mesh(tmp_path / "mixed.obj").volume == pytest.approx(1.0)


def test_a_face_of_obj_without_corners_is_refused(tmp_path):
    (tmp_path / "bare.obj").write_text(obj_cube().replace("f 1 2 4 3\n", "f\n"))
    with pytest.raises(MeshError, match="the face 'f' has too few corners"):
        read_mesh(tmp_path / "bare.obj")


def test_a_face_of_obj_that_is_not_of_numbers_is_refused(tmp_path):
    (tmp_path / "float.obj").write_text(obj_cube().replace("f 1 2", "f 1.0 2"))
    with pytest.raises(MeshError, match=r"'f 1\.0 2 4 3' refers to a vertex that is not among the 8"):
        read_mesh(tmp_path / "float.obj")


def dae_cube(name):
    positions = " ".join(f"{x} {y} {z}" for x, y, z in CORNERS)
    indices = " ".join(f"{corner - 1} 0 0" for square in SQUARES for corner in square)
    named = "<technique_common><accessor source='#{0}' count='{1}' stride='3'>{2}</accessor></technique_common>"
    axes = "".join(f"<param name='{axis}' type='float'/>" for axis in "XYZ")
    return (
        f"<geometry id='{name}'><mesh>"
        f"<source id='{name}-p'><float_array id='{name}-pa' count='24'>{positions}</float_array>"
        f"{named.format(name + '-pa', 8, axes)}</source>"
        f"<source id='{name}-n'><float_array id='{name}-na' count='3'>0 0 1</float_array>"
        f"{named.format(name + '-na', 1, axes)}</source>"
        f"<vertices id='{name}-v'><input semantic='POSITION' source='#{name}-p'/></vertices>"
        f"<polylist count='6'><input semantic='VERTEX' source='#{name}-v' offset='0'/>"
        f"<input semantic='NORMAL' source='#{name}-n' offset='2'/><input semantic='COLOR' source='#{name}-n' offset='1'/>"
        f"<vcount>4 4 4 4 4 4</vcount><p>{indices}</p></polylist>"
        "</mesh></geometry>"
    )


def dae_cubes():
    """Two cubes with edges of 0.5 m, 2 m apart."""
    nodes = "".join(f"<node><translate>{4 * k} 0 0</translate><instance_geometry url='#g{k}'/></node>" for k in range(2))
    return (
        "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'><asset><unit meter='0.5'/></asset>"
        f"<library_geometries>{dae_cube('g0')}{dae_cube('g1')}</library_geometries>"
        f"<library_visual_scenes><visual_scene id='s'>{nodes}</visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url='#s'/></scene></COLLADA>"
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("0 0 1</float_array>", "NaN 0 1</float_array>"),
        ("<p>0 0", "<p>0 7"),
        ("<p>0 0", "<p>0 -1"),
        ("'NORMAL'", "'SMELL'"),
        ("</polylist>", "</polylist><linestrips count='1'><p>0 7</p></linestrips>"),
        ("<node>", "<node><instance_light url='#lost'/><!-- dark -->"),
        ("xmlns='http://www.collada.org/2005/11/COLLADASchema'", ""),
        ("2005/11/COLLADASchema' version='1.4.1'", "2008/03/COLLADASchema' version='1.5.0'"),
    ],
    ids=["sound", "normal", "index-of-normal", "no-normal", "input", "lines", "light", "no-namespace", "version-1.5"],
)
def test_dae_is_read_whatever_else_is_broken(tmp_path, old, new):
    (tmp_path / "cubes.dae").write_text(dae_cubes().replace(old, new))
    mesh = read_mesh(tmp_path / "cubes.dae")
    assert mesh.volume == pytest.approx(2 * 0.125)
    assert mesh.bounds == pytest.approx(np.array([[0, 0, 0], [2.5, 0.5, 0.5]]))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("0 1 1 1</float_array>", "0 1 NaN 1</float_array>", "has vertices that are not finite"),
        ("0 1 1 1</float_array>", "0 1 INF 1</float_array>", "has vertices that are not finite"),
        ("0 1 1 1</float_array>", "0 1 1e400 1</float_array>", "has vertices that are not finite"),
        ("0 1 1 1</float_array>", "0 1 -1.#IND 1</float_array>", "'-1.#IND' in its coordinates"),
        ("0 1 1 1</float_array>", "0</float_array>", "promises 24 coordinates and holds 21"),
        ("<p>0 0", "<p>30 0", "maxindex=30"),
        ("<p>0 0", "<p>-8 0", "a vertex numbered below zero"),
        ("url='#g1'", "url='#lost'", "Geometry #lost not found"),
        ("source='#g1-p'", "source='#lost'", "names the coordinates 'lost' and does not hold them"),
        ("<instance_geometry url='#g1'/>", "<instance_controller url='#bones'/>", "has <instance_controller>"),
        ("<translate>4 0 0</translate>", "<skew>45 0 1 0 1 0 0</skew>", "has <skew>"),
        (
            "</polylist>",
            "</polylist><triangles count='2'><input semantic='VERTEX' source='#g0-v'/><p>0 1 2</p></triangles>",
            "holds 1",
        ),
        ("<vcount>4 4 ", "<vcount>4 ", "its polygons have 20 corners, it holds 24"),
        ("<vcount>4 4 ", "<vcount>4 4 4 ", "its polygons have 28 corners, it holds 24"),
        ("</polylist>", "</polylist><polygons><ph><p>0 0 0</p><h>1 0 0</h></ph></polygons>", "has <ph>"),
        ("count='8' stride='3'", "count='6' stride='4'", "something between its coordinates"),
        ("<instance_visual_scene url='#s'/>", "", "names no scene"),
        ("'0.5'", "'0,5'", "its unit is '0,5' metres, which is no number"),
        ("COLLADA", "html", "is no DAE file"),
    ],
)
def test_dae_of_which_a_part_would_be_lost_is_refused(tmp_path, old, new, reason):
    text = dae_cubes()
    assert old in text
    head, tail = text.rsplit(old, 1)  # where both cubes have it, only the second one is broken
    (tmp_path / "broken.dae").write_text(text.replace(old, new) if old == "COLLADA" else head + new + tail)
    with pytest.raises(MeshError, match=r"mesh broken\.dae: .*" + re.escape(reason)):
        read_mesh(tmp_path / "broken.dae")


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("tag", ["polylist", "polygons"])
def test_hollow_polygons_of_dae_do_not_reach_over_their_edge(tmp_path, first, tag):
    angle = np.roll([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], first, axis=0)
    positions = " ".join(f"{x} {y} {z}" for z in (0, 1) for x, y in angle)
    faces = [[*range(5, -1, -1)], [*range(6, 12)], *((k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6))]
    written = [" ".join(f"{corner} 0 0" for corner in face) for face in faces]
    loops = "".join(f"<p>{face}</p>" for face in written)
    if tag == "polylist":
        loops = f"<vcount>6 6{6 * ' 4'}</vcount><p>{' '.join(written)}</p>"
    text = re.sub("<vcount>.*?</p>", loops, dae_cubes()).replace("polylist", tag)
    text = re.sub("count='24'>[^<]*", f"count='36'>{positions}", text).replace("count='8'", "count='12'")
    (tmp_path / "angles.dae").write_text(text)
    mesh = read_mesh(tmp_path / "angles.dae")
    assert len(mesh.faces) == 2 * 20
    assert mesh.area == pytest.approx(2 * 14.0 / 4)
    assert mesh.volume == pytest.approx(2 * 3.0 / 8)
