"""Meshes come from allowed folders and ROS packages only, whatever address a stranger gives."""

import os
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sand_sim import SceneError
from sand_sim.assembly.mesh_roots import allowed_mesh, mesh_roots
from sand_sim.config_folder import config_folder


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Folders ``root`` and ``other``, a package with its source, and a file outside of all."""
    for name in (
        "root/meshes/a b.stl",
        "other/o.stl",
        "outside/secret.stl",
        "src/digger/meshes/linked.stl",
        "src/x/meshes/x.stl",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(name)
    share = tmp_path / "install" / "share" / "digger"
    (share / "meshes").mkdir(parents=True)
    (share / "meshes" / "tool.stl").write_text("tool")
    for package, folder in (("digger", share), ("digger", tmp_path / "src" / "digger"), ("x", tmp_path / "src" / "x")):
        (folder / "package.xml").write_text(f"<package><name>{package}</name></package>")
    (share / "meshes" / "linked.stl").symlink_to(tmp_path / "src" / "digger" / "meshes" / "linked.stl")
    (share / "meshes" / "stray.stl").symlink_to(tmp_path / "outside" / "secret.stl")
    (share / "meshes" / "x.stl").symlink_to(tmp_path / "src" / "x" / "meshes" / "x.stl")
    (tmp_path / "root" / "link.stl").symlink_to(tmp_path / "outside" / "secret.stl")
    (tmp_path / "root" / "inner.stl").symlink_to("meshes/a b.stl")
    (tmp_path / "root" / "circle").symlink_to("circle")
    (tmp_path / "root" / "folder").symlink_to(tmp_path / "outside")
    os.mkfifo(tmp_path / "root" / "pipe.stl")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    return tmp_path


@pytest.mark.parametrize(
    ("uri", "found"),
    [
        ("meshes/a b.stl", "root/meshes/a b.stl"),
        ("o.stl", "other/o.stl"),
        ("inner.stl", "root/meshes/a b.stl"),
        ("meshes/../meshes/a b.stl", "root/meshes/a b.stl"),
        ("file://{}/root/meshes/a%20b.stl", "root/meshes/a b.stl"),
        ("file://localhost{}/other/o.stl", "other/o.stl"),
        ("{}/other/o.stl", "other/o.stl"),
        ("package://digger/meshes/tool.stl", "install/share/digger/meshes/tool.stl"),
        ("package://digger/urdf/../meshes/tool.stl", "install/share/digger/meshes/tool.stl"),
        ("file://{}/install/share/digger/meshes/tool.stl", "install/share/digger/meshes/tool.stl"),
        ("package://digger/meshes/linked.stl", "src/digger/meshes/linked.stl"),
    ],
)
def test_what_is_allowed_is_found(tree, uri, found):
    assert allowed_mesh(uri.format(tree), [tree / "root", tree / "other"], True) == (tree / found).resolve()


OUTSIDE = "lies outside the folders that meshes may come from"


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("/etc/passwd", OUTSIDE),
        ("file:///etc/passwd", OUTSIDE),
        ("file:///etc/no_such_file", OUTSIDE),
        ("../outside/secret.stl", OUTSIDE),
        ("file://{}/root/../outside/secret.stl", OUTSIDE),
        ("file://{}/root/%2e%2e/outside/secret.stl", OUTSIDE),
        ("file://{}/rooted/secret.stl", OUTSIDE),
        ("link.stl", OUTSIDE),
        ("folder/secret.stl", OUTSIDE),
        ("package://digger/../../../outside/secret.stl", OUTSIDE),
        ("package://digger/%2e%2e/%2e%2e/%2e%2e/outside/secret.stl", OUTSIDE),
        ("package://digger/..", OUTSIDE),
        ("package://digger/meshes/stray.stl", OUTSIDE),
        ("package://digger/meshes/x.stl", OUTSIDE),
        ("file://{}/install/share/digger/../../../outside/secret.stl", OUTSIDE),
        ("file://{}/install/share/../../outside/secret.stl", OUTSIDE),
        ("file://{}/install/share", OUTSIDE),
        ("~/secret.stl", "there is no file"),
        ("missing.stl", "there is no file"),
        ("meshes", "there is no file"),
        ("pipe.stl", "there is no file"),
        ("circle", "loop"),
        ("package://../outside/secret.stl", "no ROS package '..'"),
        ("package:///digger/meshes/tool.stl", "names no package; write package://NAME/path, with two slashes"),
        ("package://no_such/a.stl", "no ROS package 'no_such'"),
        ("package://numpy/__init__.py", "no ROS package 'numpy'"),
        ("package://os.path/a.stl", "no ROS package 'os.path'"),
        ("package://__main__/a.stl", "no ROS package '__main__'"),
        ("file://host/etc/passwd", "lies on another machine"),
        ("https://192.0.2.1/a.stl", "unknown scheme 'https://'"),
        ("model://digger/a.stl", "unknown scheme 'model://'"),
        ("file://[", "mesh 'file://[': "),
        ("", "is empty, too long"),
        ("a\0b", "is empty, too long"),
        ("file:///a%00b", "is empty, too long"),
        ("line\nbreak", "is empty, too long"),
        ("x" * 10_000_000, "is empty, too long"),
        ("x" * 4000, "mesh 'xxx"),
    ],
)
def test_everything_else_is_refused_by_name(tree, uri, reason):
    with pytest.raises(SceneError) as caught:
        allowed_mesh(uri.format(tree) if "{}" in uri else uri, [tree / "root", tree / "other"], True)
    assert str(caught.value).startswith("mesh '")
    assert reason in str(caught.value)
    assert str(caught.value).isprintable()


def test_packages_may_be_left_out(tree):
    with pytest.raises(SceneError, match=OUTSIDE):
        allowed_mesh("package://digger/meshes/tool.stl", [tree / "root"], False)
    share = tree / "install" / "share"
    assert allowed_mesh("package://digger/meshes/tool.stl", [share], False) == share / "digger" / "meshes" / "tool.stl"
    with pytest.raises(SceneError, match="\\(none\\)"):
        allowed_mesh("/etc/passwd", [], False)


def test_no_module_is_imported_for_its_name(tree):
    with pytest.raises(SceneError):
        allowed_mesh("package://antigravity/a.stl", [], True)
    assert "antigravity" not in sys.modules


def test_the_package_itself_is_found_from_its_source_tree():
    found = allowed_mesh("package://sand_sim/config/meshes/bucket.stl", [], True)
    assert found == (config_folder() / "meshes" / "bucket.stl").resolve()


def test_an_empty_name_stands_for_the_usual_folders(tmp_path):
    meshes = config_folder() / "meshes"
    assert mesh_roots([""], tmp_path) == ([tmp_path, meshes], True)
    assert mesh_roots([str(tmp_path)], tmp_path / "scene") == ([tmp_path], False)
    assert mesh_roots([str(tmp_path), ""], tmp_path / "scene") == ([tmp_path, tmp_path / "scene", meshes], True)
    with pytest.raises(SceneError, match="mesh_roots: there is no folder '/no/such'"):
        mesh_roots(["/no/such"])


@settings(max_examples=2000, deadline=None)
@given(
    st.text(max_size=30)
    | st.lists(
        st.sampled_from(
            ["package:", "file:", "//", "/", "..", ".", "%2e", "%00", "etc", "passwd", "sand_sim", "config", "\\", ":", "?", "#"]
        )
    ).map("".join)
)
def test_whatever_address_comes_leads_into_a_root_or_nowhere(uri):
    root = config_folder() / "meshes"
    try:
        found = allowed_mesh(uri, [root], False)
    except SceneError as error:
        assert str(error).isprintable()
    else:
        assert found.is_relative_to(root.resolve())


def test_a_refusal_names_each_folder_once_and_where_to_put_the_file(tmp_path):
    """The folder of a scene and that of its URDF are mostly one, and only the node has the parameter."""
    with pytest.raises(SceneError) as caught:
        allowed_mesh("/etc/passwd", [tmp_path, tmp_path], True)
    assert str(caught.value).count(str(tmp_path)) == 1
    assert "put it there, use package://, or name its folder in the parameter mesh_roots" in str(caught.value)


def test_a_file_that_is_missing_is_named_once(tmp_path):
    with pytest.raises(SceneError, match=rf"there is no file {tmp_path}/none\.stl$"):
        allowed_mesh(f"{tmp_path}/none.stl", [tmp_path, tmp_path / "meshes"], False)
