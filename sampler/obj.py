"""OBJ files as trimesh reads them: an element a line, its keyword first, vertices counted from the beginning of the file."""

import re

_MARK = b"\xef\xbb\xbf"  # of UTF-8, which some editors put first
_ODD = re.compile(rb"\n(?:[ \t]+[vf]|[vf]n?\t|f[^\n-]*-)")  # indented, followed by a tab, counted backwards


def plain_obj(data: bytes) -> bytes:
    """Write the vertices and faces of an OBJ file anew where trimesh would not read them, or read others than are meant.

    Indices below zero count back from their line; trimesh counts them back from the end of the file.

    Returns:
        The data with a line break before it, so that every line follows one.
    """
    data = b"\n" + data.removeprefix(_MARK)
    continued = b"\\\n" in data or b"\\\r" in data
    broken = b"\r" in data and data.count(b"\r") != data.count(b"\r\n")
    remarks = any(data[data.rfind(b"\n", 0, found.start()) + 1] in b"vf" for found in re.finditer(rb"#[^\n]*", data))
    if not (continued or broken or remarks or _ODD.search(data)):
        return data
    data = re.sub(rb"#[^\r\n]*", b"", data)
    lines, vertices = [b""], 0
    for line in re.sub(rb"\\(?:\r\n?|\n)", b" ", data).splitlines():
        keyword, *words = line.split() or [b""]
        if keyword == b"v":
            vertices += 1
        elif keyword == b"f":
            words = [_counted_forwards(word.split(b"/")[0], vertices) for word in words]
        else:
            continue
        lines.append(b" ".join([keyword, *words]))
    return b"\n".join([*lines, b""])


def _counted_forwards(index: bytes, vertices: int) -> bytes:
    """The index of a vertex counted from the first one, as it is where it is no number or counts back too far."""
    back = index[1:]
    return b"%d" % (vertices + 1 - int(back)) if index[:1] == b"-" and back.isdigit() and 0 < int(back) <= vertices else index
