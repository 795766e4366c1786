"""glTF and 3MF files: all that puts triangles somewhere, and what cannot be read."""

import json
import re
import sys
import zipfile

import numpy as np
import pytest
import trimesh

from sampler import MeshError, read_mesh

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
HEAD = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
KINDS = {"<f4": 5126, "<u1": 5121, "<u2": 5123, "<i2": 5122}


def write_gltf(path, arrays, primitive, nodes=({"mesh": 0},), mesh=None, accessors=None, **more):
    """Arrays become accessors in their order; ``accessors`` adds to them by number."""
    views, described, data = [], [], b""
    for k, array in enumerate(arrays):
        width = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[array.shape[1] if array.ndim > 1 else 1]
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        kind = {"componentType": KINDS[array.dtype.str.replace("|", "<")], "count": len(array), "type": width}
        described.append({"bufferView": k} | kind | (accessors or {}).get(k, {}))
        data += array.tobytes() + bytes(-array.nbytes % 4)
    (path.parent / "its buffer.bin").write_bytes(data)
    tree = HEAD | {"buffers": [{"uri": "its%20buffer.bin", "byteLength": len(data)}], "bufferViews": views}
    tree |= {"accessors": described, "nodes": list(nodes), "meshes": [{"primitives": [primitive]} | (mesh or {})]} | more
    path.write_text(json.dumps(tree))
    return path


@pytest.fixture
def path(tmp_path):
    return tmp_path / "robot.gltf"


@pytest.mark.parametrize(("mode", "order"), [(4, [0, 1, 2, 0, 2, 3]), (5, [1, 2, 0, 3]), (6, [0, 1, 2, 3])])
def test_triangles_strips_and_fans_of_gltf_are_read(path, mode, order):
    write_gltf(path, [SQUARE, np.array(order, "<u2")], {"attributes": {"POSITION": 0}, "indices": 1, "mode": mode})
    mesh = read_mesh(path)
    assert mesh.area == pytest.approx(1.0)
    assert mesh.face_normals[:, 2] == pytest.approx(1.0)


def test_gltf_coordinates_in_whole_numbers_mean_shares(path):
    write_gltf(
        path, [(32767 * SQUARE).astype("<i2")[[0, 1, 2]]], {"attributes": {"POSITION": 0}}, accessors={0: {"normalized": True}}
    )
    assert read_mesh(path).extents == pytest.approx([1, 1, 0], abs=1e-6)


def test_gltf_coordinates_that_are_given_for_some_vertices_only_are_read(path):
    sparse = {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}}
    arrays = [SQUARE[:3], np.array([1], "<u2"), np.array([[5, 0, 0]], "<f4")]
    write_gltf(path, arrays, {"attributes": {"POSITION": 0}}, accessors={0: {"sparse": sparse}})
    assert read_mesh(path).bounds[1] == pytest.approx([5, 1, 0])


def test_gltf_nodes_place_their_meshes_also_below_cameras(path):
    turned = {"children": [1], "camera": 0, "translation": [0, 0, 3], "rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)]}
    nodes = [turned, {"mesh": 0, "scale": [2, 1, -1]}]
    write_gltf(path, [SQUARE[:3]], {"attributes": {"POSITION": 0}}, nodes, cameras=[{"type": "perspective", "perspective": {}}])
    mesh = read_mesh(path)
    assert mesh.bounds == pytest.approx(np.array([[-1, 0, 3], [0, 2, 3]]), abs=1e-6)
    assert mesh.face_normals[0, 2] == pytest.approx(-1.0)  # mirrored with its node, what was in front is behind


def test_joints_of_gltf_place_vertices_instead_of_the_node(path):
    """A joint two up for the upper vertices; the place of the skinned node itself does not count."""
    arrays = [SQUARE[:3], np.array([[0, 1, 0, 0]] * 3, "<u1"), np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], "<f4")]
    primitive = {"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}
    nodes = [{"mesh": 0, "skin": 0, "scale": [9, 9, 9]}, {"children": [2]}, {"translation": [0, 2, 0]}]
    write_gltf(path, arrays, primitive, nodes, skins=[{"joints": [1, 2]}], scenes=[{"nodes": [0, 1]}])
    assert read_mesh(path).vertices == pytest.approx(np.array([[0, 0, 0], [1, 0, 0], [1, 3, 0]]))


def test_morph_targets_of_gltf_move_vertices_by_their_weight(path):
    primitive = {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}]}
    write_gltf(path, [SQUARE[:3], SQUARE[:3]], primitive, mesh={"weights": [0.5]})
    assert read_mesh(path).extents == pytest.approx([1.5, 1.5, 0])


@pytest.mark.parametrize(
    "name", ["EXT_meshopt_compression", "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "NEW_thing"]
)
def test_gltf_that_needs_what_cannot_be_read_is_refused_with_the_reason(path, monkeypatch, name):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    primitive = {"attributes": {"POSITION": 0}, "extensions": {name: {"bufferView": 0, "attributes": {"POSITION": 0}}}}
    write_gltf(path, [SQUARE[:3]], primitive, extensionsRequired=[name])
    if "draco" in name:
        tree = json.loads(path.read_text())
        del tree["accessors"][0]["bufferView"]
        path.write_text(json.dumps(tree))
    with pytest.raises(MeshError, match="Draco" if "draco" in name else name):
        read_mesh(path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"asset": {"version": "1.0"}}, "is no glTF 2.0 file"),
        ({"buffers": [{"uri": "lost.bin"}]}, "keeps its triangles in lost.bin, which is not beside it"),
        ({"buffers": [{"uri": "data:,"}]}, "is cut off"),
        ({"scenes": []}, "names no scene"),
        ({"scenes": [{"nodes": [7]}]}, "is corrupt"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]}, "points or lines only"),
        ({"meshes": "none"}, "is corrupt"),
    ],
)
def test_gltf_that_makes_no_sense_is_refused(path, change, reason):
    write_gltf(path, [SQUARE[:3]], {"attributes": {"POSITION": 0}}, **change)
    with pytest.raises(MeshError, match=f"mesh robot.gltf: .*{re.escape(reason)}"):
        read_mesh(path)


def shape_3mf(mesh):
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*point) for point in mesh.vertices)
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in mesh.faces)
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def write_3mf(path, unit, parts):
    spaces = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
    spaces += ' xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, (objects, items) in parts.items():
            archive.writestr(name, f"<model {spaces}{unit}><resources>{objects}</resources><build>{items}</build></model>")
    return path


@pytest.fixture
def box():
    return trimesh.creation.box((0.1, 0.06, 0.02))


@pytest.mark.parametrize(
    ("unit", "metres"), [("", 1e-3), (' unit="millimeter"', 1e-3), (' unit="inch"', 0.0254), (' unit="micron"', 1e-6)]
)
def test_the_unit_of_3mf_is_applied(tmp_path, box, unit, metres):
    parts = {"3D/3dmodel.model": (f'<object id="1">{shape_3mf(box)}</object>', '<item objectid="1"/>')}
    mesh = read_mesh(write_3mf(tmp_path / "box.3mf", unit, parts), scale=2.0)
    assert mesh.extents == pytest.approx(2.0 * metres * box.extents, rel=1e-12)
    assert mesh.volume == pytest.approx((2.0 * metres) ** 3 * box.volume, rel=1e-9)


def test_objects_of_objects_of_3mf_are_where_they_are_wanted_also_from_other_parts(tmp_path, box):
    half = '<component p:path="/3D/half.model" objectid="4" transform="0 1 0 -1 0 0 0 0 1 {} 0 0"/>'
    whole = f'<object id="1"><components>{half.format(-1)}{half.format(1)}</components></object>'
    item = '<item objectid="1" transform="1 0 0 0 1 0 0 0 2 0 0 5"/>'
    parts = {"3D/half.model": (f'<object id="4">{shape_3mf(box)}</object>', ""), "3D/3dmodel.model": (whole, item)}
    mesh = read_mesh(write_3mf(tmp_path / "two.3mf", ' unit="meter"', parts))
    assert mesh.bounds == pytest.approx(np.array([[-1.03, -0.05, 4.98], [1.03, 0.05, 5.02]]))
    assert mesh.volume == pytest.approx(4.0 * box.volume)


def test_transforms_of_3mf_apply_from_the_inside_out_and_may_mirror(tmp_path, box):
    inner, outer = "0 1 0 -1 0 0 0 0 1 1 2 3", "2 0 0 0 0 1 0 1 0 0 0 5"  # of rows; neither may go before the other
    part = f'<object id="2">{shape_3mf(box)}</object>'
    whole = f'<object id="1"><components><component objectid="2" transform="{inner}"/></components></object>'
    parts = {"3D/3dmodel.model": (part + whole, f'<item objectid="1" transform="{outer}"/>')}
    mesh = read_mesh(write_3mf(tmp_path / "turned.3mf", ' unit="meter"', parts))
    expected = np.asarray(box.vertices)
    for transform in (inner, outer):
        rows = np.array(transform.split(), float).reshape(4, 3)
        expected = expected @ rows[:3] + rows[3]
    assert mesh.bounds == pytest.approx(np.array([expected.min(axis=0), expected.max(axis=0)]))
    assert mesh.volume == pytest.approx(2.0 * box.volume)  # not less than nothing


@pytest.mark.parametrize(
    ("objects", "item", "reason"),
    [
        ("", '<item objectid="3"/>', "does not hold its object '3'"),
        ('<object id="1"><components><component objectid="1"/></components></object>', '<item objectid="1"/>', "corrupt"),
        ('<object id="1"><mesh><vertices><vertex x="1" y="1"/></vertices></mesh></object>', '<item objectid="1"/>', "corrupt"),
        ("", "", "has no triangles"),
    ],
)
def test_3mf_that_makes_no_sense_is_refused(tmp_path, objects, item, reason):
    path = write_3mf(tmp_path / "odd.3mf", "", {"3D/3dmodel.model": (objects, item)})
    with pytest.raises(MeshError, match=f"mesh odd.3mf: .*{reason}"):
        read_mesh(path)


def test_3mf_that_is_cut_off_is_refused(tmp_path, box):
    parts = {"3D/3dmodel.model": (f'<object id="1">{shape_3mf(box)}</object>', '<item objectid="1"/>')}
    path = write_3mf(tmp_path / "box.3mf", "", parts)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(MeshError, match="is cut off or no 3MF file"):
        read_mesh(path)
