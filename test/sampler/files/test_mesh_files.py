"""Files: units, strips, and every kind of damage that readers pass over."""

import re
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import trimesh
from shapes import robot_mesh

from sampler import MeshError, read_mesh, repair_mesh, sample_body


@pytest.fixture
def box():
    return trimesh.creation.box((0.1, 0.06, 0.02))


def test_unit_and_node_transforms_of_dae_are_applied(tmp_path, box):
    path = tmp_path / "inches.dae"
    text = box.export(file_type="dae").decode()
    assert "<node" in text
    text = text.replace('<unit name="meter" meter="1"', '<unit name="inch" meter="0.0254"')
    if "0.0254" not in text:
        text = text.replace("</asset>", '<unit name="inch" meter="0.0254"/></asset>')
    head, _, tail = text.partition("<node")
    opening, _, rest = tail.partition(">")
    path.write_text(f"{head}<node{opening}><matrix>0 -2 0 3 2 0 0 0 0 0 2 0 0 0 0 1</matrix>{rest}")
    for ending in (".zae", ".zip"):
        with zipfile.ZipFile(path.with_suffix(ending), "w") as archive:
            archive.write(path, path.name)
    for ending in (".dae", ".zae", ".zip"):
        mesh = read_mesh(path.with_suffix(ending))
        assert mesh.extents == pytest.approx(np.array([0.12, 0.2, 0.04]) * 0.0254, rel=1e-6)
        assert mesh.bounds.mean(axis=0) == pytest.approx([3 * 0.0254, 0, 0], abs=1e-7)


def test_materials_of_obj_need_no_pillow(tmp_path, box):
    path = tmp_path / "painted.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices] + ["vt 0 0", "vt 1 0", "vt 0 1"]
    lines += ["usemtl red", *(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3" for a, b, c in box.faces)]
    path.write_text("\n".join(["mtllib missing.mtl", *lines, ""]))
    code = "import sys; sys.modules['PIL'] = None; from sampler import read_mesh; print(len(read_mesh(sys.argv[1]).faces))"
    result = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=60, check=False)
    assert result.stdout.strip() == "12", result.stderr


def test_triangles_of_dae_whose_material_is_missing_are_kept(tmp_path, box):
    path = tmp_path / "painted.dae"
    text = box.export(file_type="dae").decode()
    assert "<instance_effect" in text
    path.write_text(re.sub(r"<library_effects>.*?</library_effects>", "", text, flags=re.DOTALL))
    assert len(read_mesh(path).faces) == 12


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_triangle_strips_are_read(tmp_path, kind):
    # Two strips: a band of four triangles, and one triangle; every second triangle of a strip is turned.
    points = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]
    strip = [1, 0, 3, 2, 5, 4, -1, 6, 7, 8]
    header = f"ply\nformat {kind} 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    order = ">" if "big" in kind else "<"
    if kind == "ascii":
        body = "\n".join(" ".join(map(str, p)) for p in points) + f"\n{len(strip)} " + " ".join(map(str, strip)) + "\n"
        body = body.encode()
    else:
        body = np.array(points, order + "f4").tobytes() + np.array([len(strip), *strip], order + "i4").tobytes()
    (tmp_path / "strips.ply").write_bytes(header.encode() + body)
    mesh = read_mesh(tmp_path / "strips.ply", scale=0.5)
    assert len(mesh.faces) == 5
    assert mesh.area == pytest.approx(0.25 * (2.0 + 0.5))
    assert mesh.face_normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (5, 1)))


ANGLE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]  # a hollow polygon; upright, with a height of one, volume 3 and area 14


def angle_prism(first):
    """Corners and faces of six and of four corners, in the order of the file."""
    sides = [(k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6)]
    points = [(x, y, z) for z in (0, 1) for x, y in np.roll(ANGLE, first, axis=0)]
    return points, [(5, 4, 3, 2, 1, 0), *sides[:3], (6, 7, 8, 9, 10, 11), *sides[3:]]


def rows_of(table):
    return "".join(" ".join(map(str, row)) + "\n" for row in table)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian", "off"])
@pytest.mark.parametrize("first", [0, 1, 2])
def test_polygons_of_any_size_are_read_and_stay_within_their_edge(tmp_path, kind, first):
    points, faces = angle_prism(first)
    counted = [(len(face), *face) for face in faces]
    path = tmp_path / f"angle.{'off' if kind == 'off' else 'ply'}"
    if kind == "off":
        path.write_text("OFF # of an angle\n12 8 0\n" + rows_of(points) + rows_of(counted))
    else:
        header = f"ply\nformat {kind} 1.0\nelement vertex 12\nproperty float x\nproperty float y\nproperty float z\n"
        header += "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
        header += "element face 8\nproperty list uchar int vertex_indices\nproperty uchar flags\nend_header\n"
        order = ">" if "big" in kind else "<"
        body = b"".join(struct.pack(f"{order}B{len(face)}iB", len(face), *face, 7) for face in faces)
        body = np.array(points, order + "f4").tobytes() + struct.pack(order + "2i", 0, 1) + body
        text = rows_of(points) + "0 1\n" + rows_of([(*row, 7) for row in counted])
        path.write_bytes(header.encode() + (text.encode() if kind == "ascii" else body))
    mesh = read_mesh(path)
    assert len(mesh.faces) == 20
    assert mesh.area == pytest.approx(14.0)
    assert mesh.volume == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("3 6 7 5", "3 6 7 8", "refers to vertex 8 of 8"),
        ("3 6 7 5", "3 6 -7 5", "refers to vertex -7 of 8"),
        ("3 6 7 5", "4 6 7 5", "is cut off"),
        ("OFF", "BOFF", "is no OFF file but begins with 'BOFF'"),
        ("8 12", "8", "is no OFF file"),
    ],
)
def test_off_that_makes_no_sense_is_refused(tmp_path, old, new, reason):
    points, faces = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], trimesh.creation.box().faces
    text = "OFF\n8 12\n" + rows_of(points) + rows_of([(3, *face) for face in faces[:-1]]) + "3 6 7 5\n"
    assert old in text
    (tmp_path / "odd.off").write_text(text.replace(old, new, 1))
    with pytest.raises(MeshError, match=rf"mesh odd\.off: .*{reason}"):
        read_mesh(tmp_path / "odd.off")


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "ply_ascii", "off", "glb", "obj"])
@pytest.mark.parametrize("share", [0.35, 0.6, 0.9])
def test_files_cut_off_are_refused(tmp_path, kind, share):
    ball = trimesh.creation.icosphere(subdivisions=2)
    options = {"encoding": "ascii"} if kind == "ply_ascii" else {}
    data = ball.export(file_type=kind.replace("ply_ascii", "ply"), **options)
    data = data.encode() if isinstance(data, str) else data
    path = tmp_path / f"cut.{kind.split('_')[0]}"
    cut = data[: int(share * len(data))]
    path.write_bytes(cut[: cut.rindex(b" ")] if kind == "obj" else cut)  # an OBJ is seen to be cut only within a line
    with pytest.raises(MeshError, match=r"mesh cut\."):
        sample_body(read_mesh(path), radius=0.1)


@pytest.mark.parametrize("line", ["element vertex", "element vertex many", "property", "property float"])
def test_headers_of_ply_that_make_no_sense_are_refused(tmp_path, box, line):
    head, end, body = box.export(file_type="ply").partition(b"end_header")
    (tmp_path / "odd.ply").write_bytes(head + line.encode() + b"\n" + end + body)
    with pytest.raises(MeshError, match=rf"mesh odd\.ply: is corrupt: its header says '{line}'"):
        read_mesh(tmp_path / "odd.ply")


def test_stl_with_bytes_to_spare_is_read(tmp_path, box):
    path = tmp_path / "spare.stl"
    path.write_bytes(box.export(file_type="stl") + b"made by a careless program")
    assert read_mesh(path).volume == pytest.approx(box.volume, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "told"), [("box.obj", "is no OBJ file but binary"), ("box", "has no ending that tells its format")]
)
def test_wrong_endings_are_told(tmp_path, box, name, told):
    (tmp_path / name).write_bytes(box.export(file_type="stl"))
    with pytest.raises(MeshError, match=f"mesh {name}: {told}"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("promised", [0, 7])
def test_binary_stl_of_more_triangles_than_it_promises_is_refused(tmp_path, box, promised):
    data = box.export(file_type="stl")
    (tmp_path / "more.stl").write_bytes(data[:80] + struct.pack("<I", promised) + data[84:])
    with pytest.raises(MeshError, match=rf"more\.stl: is damaged: it promises {promised} triangles and holds 12"):
        read_mesh(tmp_path / "more.stl")


def stl_of(triangles):
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0) for t in triangles)
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + rows


@pytest.mark.parametrize(
    "write",
    [
        str.upper,
        lambda text: text.replace("solid ", "solid " + 3000 * "x", 1),
        lambda text: text.replace("solid ", "solid one facet of a vertex ", 1),
        lambda text: text.replace("\n", "\r"),
    ],
)
def test_text_stl_is_told_however_it_begins(tmp_path, box, write):
    text = box.export(file_type="stl_ascii")
    assert "solid " in text
    (tmp_path / "text.stl").write_text(write(text))
    assert read_mesh(tmp_path / "text.stl").volume == pytest.approx(box.volume, rel=1e-6)
    (tmp_path / "cut.stl").write_text(write(text)[: -len(text) // 2])
    with pytest.raises(MeshError, match="does not end with 'endsolid'"):
        read_mesh(tmp_path / "cut.stl")


def test_normals_that_are_no_numbers_are_passed_over_without_words(tmp_path, box):
    text = re.sub("normal .*", "normal -1.#IND -1.#IND -1.#IND", box.export(file_type="stl_ascii"))
    (tmp_path / "normals.stl").write_text(text)
    command = "from sampler import read_mesh; print(len(read_mesh('normals.stl').faces))"
    run = subprocess.run([sys.executable, "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.stdout, run.stderr) == ("12\n", "")


def test_binary_stl_is_told_though_its_header_says_facet(tmp_path, box):
    (tmp_path / "binary.stl").write_bytes(b"solid of facets".ljust(80) + box.export(file_type="stl")[80:])
    assert read_mesh(tmp_path / "binary.stl").volume == pytest.approx(box.volume, rel=1e-6)


@pytest.mark.parametrize("kind", ["stl_ascii", "obj"])
def test_names_in_other_letters_do_no_harm(tmp_path, box, kind):
    text = box.export(file_type=kind)
    text = text.replace("solid ", "solid Grundkörper ") if kind == "stl_ascii" else "o Löffel\n" + text
    path = tmp_path / f"loeffel.{kind[:3]}"
    path.write_bytes(text.encode("latin-1"))
    assert len(read_mesh(path).faces) == 12


@pytest.mark.parametrize("kind", ["wrl", "usd", "fbx", "3ds"])
def test_files_that_are_not_read_are_told_with_what_is(tmp_path, kind):
    path = tmp_path / f"robot.{kind}"
    path.write_bytes(b"#VRML V2.0 utf8")
    with pytest.raises(
        MeshError, match=rf"cannot be read: \.{kind} files are not known; export it as STL, OBJ, PLY, DAE, glTF or 3MF"
    ):
        read_mesh(path)


@pytest.mark.parametrize("text", ["<html><body>404 not found</body></html>\n", "solid advice, but no mesh\n"])
def test_text_that_is_no_stl_is_told(tmp_path, text):
    (tmp_path / "page.stl").write_text(10 * text)
    with pytest.raises(MeshError, match=rf"page\.stl: is no STL file but other text: '{text[:5]}"):
        read_mesh(tmp_path / "page.stl")


def test_vertices_that_are_not_finite_are_refused(tmp_path, box):
    triangles = np.array(box.triangles)
    triangles[3, 1, 2] = np.nan
    (tmp_path / "nan.stl").write_bytes(stl_of(triangles))
    with pytest.raises(MeshError, match=r"nan\.stl: has vertices that are not finite"):
        read_mesh(tmp_path / "nan.stl")


def test_faces_of_missing_vertices_are_refused(tmp_path):
    (tmp_path / "short.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 4\n")
    with pytest.raises(MeshError, match="'f 2 3 4' refers to a vertex that is not among the 3"):
        read_mesh(tmp_path / "short.obj")


def test_triangle_soup_has_no_inside():
    random = np.random.default_rng(0)
    corners = random.uniform(size=(60, 1, 3)) + 0.2 * random.normal(size=(60, 3, 3))
    soup = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3), process=False)
    with pytest.raises(MeshError, match="60 of its 60 triangles are loose and enclose nothing"):
        repair_mesh(soup)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("bad_empty_bin.stl", "has no triangles"),
        ("bad_not_enough_indices.obj", "'f 1// 2//' has too few corners"),
        ("bad_truncated.stl", "promises 194 triangles and holds 115"),
        ("bad_triangle_soup.stl", "loose and enclose nothing"),
    ],
)
def test_bad_robot_meshes_are_refused(name, reason):
    with pytest.raises(MeshError, match=reason):
        sample_body(read_mesh(robot_mesh(name)), radius=0.01)


@pytest.mark.parametrize(("kind", "module"), [("step", "cascadio")])
def test_the_module_that_a_kind_of_file_needs_is_named(tmp_path, kind, module):
    (tmp_path / f"part.{kind}").write_bytes(b"PK")
    code = "import sys; sys.modules[sys.argv[2]] = None; from sampler import read_mesh; read_mesh(sys.argv[1])"
    command = [sys.executable, "-c", code, str(tmp_path / f"part.{kind}"), module]
    last = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stderr.splitlines()[-1]
    assert "needs what is not installed: " in last
    assert module in last
