"""Robot descriptions: links, joints and geometries, read so that a stranger's can do no harm.

Source: http://wiki.ros.org/urdf/XML.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from sand_sim import rotation
from sand_sim.assembly.joint import FIXED, FLOATING, JOINTS, Joint
from sand_sim.border import Frame
from sand_sim.scene.types import SceneError
from sand_sim.showing import shown

_LARGEST = 10_000_000  # bytes
_MOST_ELEMENTS, _DEEPEST = 200_000, 100
_XACRO = "is not expanded yet; run: xacro file.xacro > file.urdf"


@dataclass(frozen=True)
class Geometry:
    """One part of a link.

    Attributes:
        where: which part it is, for messages.
        kind: ``mesh``, ``box``, ``cylinder`` (along z) or ``sphere``, all around their own origins.
        numbers: factors of a mesh along x, y, z [1]; edges of a box; radius and length of a cylinder; radius of a sphere [m].
        uri: address of a mesh.
        position: of its origin in the link's frame, shape (3,) [m].
        orientation: own frame to the link's, shape (4,).
    """

    where: str
    kind: str
    numbers: np.ndarray
    uri: str
    position: np.ndarray
    orientation: np.ndarray


@dataclass(frozen=True)
class Robot:
    """A robot description whose links form a tree.

    Attributes:
        root: name of the link that hangs on no other.
        joints: by the name of the link that hangs on it; all but the root have one.
        links: elements of the file by name.
    """

    root: str
    joints: dict[str, Joint]
    links: dict[str, ElementTree.Element]

    def fixed_frames(self) -> list[Frame]:
        """Frames of all links that hang on the root by fixed joints only, parents first.

        A link behind a movable joint is not among them, even where the joint happens to be at zero.
        """
        fixed = {name: joint for name, joint in self.joints.items() if joint.kind == FIXED}
        hung = [(name, fixed[name]) for name in _below(self.root, fixed)]
        return [Frame(name, joint.parent, joint.position, joint.orientation) for name, joint in hung]

    def frames_at(self, values: dict[str, float], times: dict[str, float]) -> list[Frame]:
        """Frames of all links whose place on their parents is known.

        Args:
            values: of joints, by their names [rad or m].
            times: they are of, by the same names [s].
        """
        named, frames = {joint.name: joint for joint in self.joints.values()}, []
        for link, joint in self.joints.items():
            source, factor, offset = joint, 1.0, 0.0
            for _ in range(_DEEPEST):  # of joints that mimic others, which may mimic others again
                if source.name in values or source.mimics not in named:
                    break
                factor, offset = factor * source.factor, offset + factor * source.offset
                source = named[source.mimics]
            if joint.kind == FIXED or source.name in values:
                pose = joint.pose_at(factor * values.get(source.name, 0.0) + offset)
                if pose is not None:
                    frames.append(Frame(link, joint.parent, *pose, None if joint.kind == FIXED else times[source.name]))
        return frames

    def geometries(self, link: str) -> list[Geometry]:
        """What a link collides with, or looks like if that is not told.

        Raises:
            SceneError: if there is no such link, it has no geometry, or a field of one is wrong.
        """
        if link not in self.links:
            known = ", ".join(map(shown, sorted(self.links)[:30])) + (", ..." if len(self.links) > 30 else "")
            raise SceneError(f"there is no link '{shown(link)}'; known are {known}")
        for kind in ("collision", "visual"):
            elements = self.links[link].findall(kind)
            if elements:
                return [
                    _geometry(element, f"link '{shown(link)}', {kind} {index}") for index, element in enumerate(elements, start=1)
                ]
        raise SceneError(f"link '{shown(link)}' has neither collision nor visual geometry")


def load_robot(path: Path) -> Robot:
    """Read a URDF file.

    Raises:
        SceneError: if it cannot be read, or as ``parse_robot``.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        return parse_robot(content)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def parse_robot(content: str | bytes) -> Robot:
    """Read a robot description.

    Args:
        content: expanded URDF; more than 10 MB, document types and entities are refused.

    Raises:
        SceneError: if it is no URDF, a joint is wrong, or the links form no tree; the message names what is wrong.
    """
    top = _parse(content)
    if top.tag != "robot":
        raise SceneError(f"is no URDF: its outermost element is '{shown(top.tag)}', not 'robot'")
    links, joints = {}, {}
    for element in top.findall("link"):
        name = _attribute(element, "name", "link")
        if name in links:
            raise SceneError(f"there are two links '{shown(name)}'")
        links[name] = element
    for element in top.findall("joint"):
        child, joint = _joint(element, links)
        if child in joints:
            raise SceneError(f"link '{shown(child)}' hangs on two joints")
        joints[child] = joint
    if not links:
        raise SceneError("has no links")
    roots = [name for name in links if name not in joints]
    if len(roots) != 1:
        named = f": {', '.join(map(shown, roots[:10]))}" if roots else ""
        raise SceneError(f"one link must hang on no other, there are {len(roots)}{named}")
    loose = set(joints) - set(_below(roots[0], joints))
    if loose:
        raise SceneError(f"link '{shown(min(loose))}' hangs on itself")
    return Robot(roots[0], joints, links)


def _parse(content: str | bytes) -> ElementTree.Element:
    """The outermost element; the text between elements, of which URDF has none, is dropped."""
    declared = None
    try:
        if isinstance(content, str):  # whatever encoding it declares
            content, declared = content.encode(), "utf-8"
    except UnicodeEncodeError:
        raise SceneError("is not valid XML: it holds letters that are none") from None
    if len(content) > _LARGEST:
        raise SceneError(f"is larger than {_LARGEST // 10**6} MB")
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate(declared)
    number = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal number, depth
        number, depth = number + 1, depth + 1
        if tag.startswith("xacro:"):
            raise SceneError(_XACRO)
        if number > _MOST_ELEMENTS or depth > _DEEPEST:
            raise SceneError(f"has more than {_MOST_ELEMENTS} elements, or more than {_DEEPEST} inside one another")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_) -> None:
        raise SceneError("has a document type; a robot description needs none, and entities are refused")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise error if isinstance(error, SceneError) else SceneError(f"is not valid XML: {error}") from None
    return builder.close()


def _joint(element: ElementTree.Element, links: dict) -> tuple[str, Joint]:
    name = shown(element.get("name", ""))
    where = f"joint '{name}'"
    kind = element.get("type", "")
    if kind not in JOINTS:
        raise SceneError(f"{where}: unknown type '{shown(kind)}'; known are {', '.join(JOINTS)}")
    ends = []
    for role in ("parent", "child"):
        found = element.find(role)
        if found is None:
            raise SceneError(f"{where}: the element '{role}' is missing")
        link = _attribute(found, "link", f"{where}, {role}")
        if link not in links:
            raise SceneError(f"{where}, {role}: there is no link '{shown(link)}'")
        ends.append(link)
    parent, child = ends
    axis = element.find("axis")
    along = np.array([1.0, 0.0, 0.0]) if axis is None else _numbers(axis, "xyz", 3, f"{where}, axis", "1 0 0")
    if kind not in (FIXED, FLOATING) and not along.any():
        raise SceneError(f"{where}, axis: must not be the zero vector")
    joint = Joint(kind, parent, *_origin(element, where), element.get("name", ""), along / max(np.linalg.norm(along), 1e-300))
    mimic = element.find("mimic")
    if mimic is None:
        return child, joint
    where = f"{where}, mimic"
    factor, offset = (float(_numbers(mimic, key, 1, where, usual)[0]) for key, usual in (("multiplier", "1"), ("offset", "0")))
    return child, replace(joint, mimics=_attribute(mimic, "joint", where), factor=factor, offset=offset)


def _below(root: str, joints: dict[str, Joint]) -> list[str]:
    """The links that hang on a root by the given joints, parents first."""
    children: dict[str, list[str]] = {}
    for name, joint in joints.items():
        children.setdefault(joint.parent, []).append(name)
    found = [root]
    for name in found:
        found += children.get(name, [])
    return found[1:]


def _geometry(element: ElementTree.Element, where: str) -> Geometry:
    held = element.find("geometry")
    parts = [] if held is None else list(held)
    if len(parts) != 1 or parts[0].tag not in ("mesh", "box", "cylinder", "sphere"):
        got = ", ".join(shown(part.tag) for part in parts[:5]) or "none"
        raise SceneError(f"{where}: its geometry must be one mesh, box, cylinder or sphere, got {got}")
    part, kind = parts[0], parts[0].tag
    where_part, uri = f"{where}, {kind}", ""
    if kind == "mesh":
        uri = _attribute(part, "filename", where_part)
        numbers = _numbers(part, "scale", 3, where_part, "1 1 1")
        if not np.all(numbers):
            raise SceneError(f"{where_part}: scale must not be zero, got '{shown(part.get('scale'))}'")
    else:
        sizes = {"box": [("size", 3)], "cylinder": [("radius", 1), ("length", 1)], "sphere": [("radius", 1)]}[kind]
        numbers = np.concatenate([_numbers(part, name, count, where_part) for name, count in sizes])
        if not np.all(numbers > 0.0):
            raise SceneError(
                f"{where_part}: {' and '.join(name for name, _ in sizes)} must be positive [m], got {numbers.tolist()}"
            )
    return Geometry(where, kind, numbers, uri, *_origin(element, where))


def _origin(element: ElementTree.Element, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Position and orientation, zero unless told."""
    origin = element.find("origin")
    origin = ElementTree.Element("origin") if origin is None else origin
    unknown = set(origin.keys()) - {"xyz", "rpy"}
    if unknown:
        raise SceneError(f"{where}, origin: unknown attribute '{shown(min(unknown))}'; known are xyz, rpy")
    where = f"{where}, origin"
    return _numbers(origin, "xyz", 3, where, "0 0 0"), rotation.from_rpy(*_numbers(origin, "rpy", 3, where, "0 0 0"))


def _numbers(element: ElementTree.Element, name: str, count: int, where: str, default: str | None = None) -> np.ndarray:
    """Finite numbers of an attribute, shape (count,)."""
    text = element.get(name, default)
    if text is None:
        raise SceneError(f"{where}: the attribute '{name}' is missing")
    if "${" in text or "$(" in text:
        raise SceneError(f"{where}: {name} '{shown(text)}' {_XACRO}")
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        numbers = np.empty(0)
    if numbers.shape != (count,) or not np.all(np.isfinite(numbers)):
        many = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SceneError(f"{where}: {name} must be {many}, got '{shown(text)}'")
    return numbers


def _attribute(element: ElementTree.Element, name: str, where: str) -> str:
    value = element.get(name, "")
    if not value:
        raise SceneError(f"{where}: the attribute '{name}' is missing")
    return value
