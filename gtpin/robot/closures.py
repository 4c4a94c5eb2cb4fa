"""Reads the YAML of example-parallel-robots, which says how the loops of the URDF beside it close and which joints are driven.

``closed_loop: [[FRAME, FRAME], ...]`` are pairs of links or joints, ``type: [3d, ...]`` whether their origins coincide (``3d``,
a spherical loop) or their axes too (``6d``), and ``name_mot: [JOINT, ...]`` the driven joints in the order of q. The values are
lists in brackets, as that project and gtpin's export write them.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element, SubElement, tostring

from gtpin.data.files import read_text
from gtpin.errors import RobotError
from gtpin.robot.urdf_elements import own_element

SUFFIX = ".yaml"
READ = ("closed_loop", "type", "name_mot")
JOINTS = ("joint_name", "joint_type")
"""Keys with joints of which the URDF has another type, and these types."""
TYPES = {"3d": "spherical", "6d": "fixed"}
"""Types of loops, with those of ``<loop_joint>``."""
ENDS = ("_A", "_B")
"""Ends of the names of the two links at a loop that gtpin's export adds."""


def urdf_with_loops(file: Path, parse: Callable[[str, str], Element]) -> str:
    """The text of the URDF of the same name beside a YAML file, with its loops and its driven joints as gtpin's elements.

    A URDF that gtpin exported has these elements; then both files must say the same.

    Raises `RobotError` if one of the files is missing or damaged, or the files do not belong together.
    """
    rows = _values(file)
    urdf = file.with_suffix(".urdf")
    text = read_text(urdf, RobotError, hint=f"put the URDF of {file.name} beside it, under this name")
    root = parse(text, str(urdf))
    if root.tag != "robot":
        raise RobotError(f"the outer element is <{root.tag}>", file=urdf, hint="a URDF's is <robot>")
    pairs = _pairs(file, rows)
    _replace_joints(file, root, rows)
    drives = _names(file, rows, "name_mot")
    if written := [loop.get("name", "") for loop in root.findall("loop_joint")]:
        if sorted(pairs) != sorted((f"{loop}{ENDS[0]}", f"{loop}{ENDS[1]}") for loop in written):
            what = f"closed_loop is not what the URDF's <loop_joint>s are: {', '.join(written)}"
            hint = "leave <loop_joint> out of the URDF, or export both"
            raise RobotError(what, file=file, column="closed_loop", hint=hint)
    else:
        for number, (pair, kind) in enumerate(pairs.items()):
            _add_loop(file, root, f"loop{number + 1}", pair, TYPES[kind])
    own = own_element(root)
    driven = [element.get("joint", "") for element in own.findall("actuator")]
    if driven and driven != drives:
        _refuse(file, rows, "name_mot", f"the URDF's driven joints are {', '.join(driven)}", "write these")
    if not driven:
        for joint in drives:
            SubElement(own, "actuator", joint=joint)
    return tostring(root, encoding="unicode")


def closes(file: Path) -> bool:
    """Whether there is a file of this name that says how the loops of a URDF close."""
    return file.is_file() and any(line.startswith("closed_loop:") for line in read_text(file, RobotError).splitlines())


def _values(file: Path) -> dict[str, tuple[int, object]]:
    """The value of each key, with its row."""
    texts: dict[str, tuple[int, str]] = {}
    key, lists = "", f"write {', '.join(READ)}, each once, with a list: name_mot: ['joint1', 'joint2']"
    for row, line in enumerate(read_text(file, RobotError).splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if line[0].isspace() and key:
            texts[key] = texts[key][0], texts[key][1] + line
            continue
        key, colon, value = line.partition(":")
        if not colon or line[0].isspace() or (key := key.strip()) in texts:
            raise RobotError("no key with a list", file=file, row=row, hint=lists)
        texts[key] = row, value
    found: dict[str, tuple[int, object]] = {}
    for key, (row, text) in texts.items():
        try:
            found[key] = row, ast.literal_eval(text.strip())  # these lists are the same in YAML, JSON and Python
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            raise RobotError("no key with a list", file=file, row=row, hint=lists) from None
    for key in READ:
        if key not in found:
            what, hint = f"the key {key} is missing", "give the robot.yaml of the robot"
            raise RobotError(what, file=file, column=key, hint=hint)
    if other := sorted(found.keys() - {*READ, *JOINTS}):
        _refuse(file, found, other[0], f"{other[0]}: gtpin reads {', '.join((*READ, *JOINTS))} only", "leave it out")
    return found


def _replace_joints(file: Path, root: Element, rows: dict[str, tuple[int, object]]) -> None:
    """Give joints of the URDF the types that the YAML says: fixed, or revolute joints about two or three axes."""
    if not rows.keys() & set(JOINTS):
        return
    rows = {**dict.fromkeys(JOINTS, (1, [])), **rows}
    names, kinds = (_names(file, rows, key) for key in JOINTS)
    if len(names) != len(kinds):
        _refuse(file, rows, JOINTS[1], f"{len(kinds)} types for {len(names)} joints", "give one for each of joint_name")
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for name, kind in zip(names, kinds, strict=True):
        joint, axes = joints.get(name), {"SPHERICAL": "XYZ", "FIXED": ""}.get(kind, kind.removeprefix("UJOINT_"))
        if joint is None:
            _refuse(file, rows, JOINTS[0], f"the URDF has no joint {name}", "mend the name")
        if not set(axes) <= set("XYZ"):
            what = f"joints of type {kind[:20]} are not read"
            _refuse(file, rows, JOINTS[1], what, "write SPHERICAL, UJOINT_XY or FIXED")
        for part in [part for part in joint if part.tag in ("axis", "limit", "mimic")]:
            joint.remove(part)
        joint.set("type", "continuous" if axes else "fixed")
        child = joint.find("child")
        for number, axis in enumerate(axes, 1):
            SubElement(joint, "axis", xyz=" ".join("1" if axis == letter else "0" for letter in "XYZ"))
            if number < len(axes) and child is not None:
                between, end = f"{name}_link{number}", child.get("link", "")
                child.set("link", between)
                SubElement(root, "link", name=between)
                joint = SubElement(root, "joint", name=f"{name}_{number + 1}", type="continuous")
                SubElement(joint, "parent", link=between)
                child = SubElement(joint, "child", link=end)


def _names(file: Path, rows: dict[str, tuple[int, object]], key: str) -> list[str]:
    value = rows[key][1]
    if not isinstance(value, list) or not all(isinstance(one, str) and one for one in value):
        _refuse(file, rows, key, f"{key} is no list of names", "write it as ['a', 'b']")
    return [str(one) for one in value]


def _pairs(file: Path, rows: dict[str, tuple[int, object]]) -> dict[tuple[str, str], str]:
    """The pairs of frames, with the type of each."""
    value, kinds = rows["closed_loop"][1], _names(file, rows, "type")
    pairs: list[tuple[str, str]] = []
    for pair in value if isinstance(value, list) else [None]:
        if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(name, str) and name for name in pair):
            what = "closed_loop is no list of pairs"
            _refuse(file, rows, "closed_loop", what, "write it as [['a', 'b'], ['c', 'd']]")
        pairs.append((pair[0], pair[1]))
    if len(kinds) != len(pairs):
        what = f"{len(kinds)} types for {len(pairs)} loops"
        _refuse(file, rows, "type", what, "give one for each pair of closed_loop")
    found = {pair: kind.lower() for pair, kind in zip(pairs, kinds, strict=True)}
    for pair, kind in found.items():
        if kind not in TYPES:
            what = f"the loop of {pair[0]} and {pair[1]} is closed by {kind[:20]!r}"
            _refuse(file, rows, "type", what, f"write one of {', '.join(TYPES)}")
    return found


def _add_loop(file: Path, root: Element, name: str, pair: tuple[str, str], kind: str) -> None:
    """Write a loop of a type of ``<loop_joint>``."""
    loop = SubElement(root, "loop_joint", name=name, type=kind)
    links = {link.get("name", "") for link in root.findall("link")}
    children = {joint.get("name", ""): joint.find("child") for joint in root.findall("joint")}
    for tag, frame in zip(("link1", "link2"), pair, strict=True):
        child = children.get(frame)  # a joint's frame is that of its child
        link = frame if frame in links or child is None else child.get("link", "")
        if link not in links:
            what = f"the URDF has no link and no joint {frame!r}"
            raise RobotError(what, file=file, column="closed_loop", hint="name two frames for each loop")
        SubElement(loop, tag, link=link)


def _refuse(file: Path, rows: dict[str, tuple[int, object]], key: str, what: str, hint: str) -> NoReturn:
    raise RobotError(what, file=file, row=rows[key][0], column=key, hint=hint)
