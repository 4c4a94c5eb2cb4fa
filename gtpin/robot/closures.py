"""Reads the YAML of example-parallel-robots, which says how the loops of the URDF beside it close and which joints are driven.

``closed_loop: [[FRAME, FRAME], ...]`` are pairs of links or joints whose frames coincide, ``type: [3d, ...]`` whether only
their origins do (``3d``, a spherical loop) or their axes too (``6d``), and ``name_mot: [JOINT, ...]`` the driven joints in the
order of q. The values are lists on one line each, as that project and gtpin's export write them.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard
from xml.etree.ElementTree import Element, SubElement, tostring

from gtpin.data.files import read_text
from gtpin.errors import RobotError
from gtpin.robot.tree import own_element

SUFFIX = ".yaml"
READ = ("closed_loop", "type", "name_mot")
SPHERICAL = "3d"
ENDS = ("_A", "_B")
"""Ends of the names of the two links at a loop that gtpin's export adds."""


def urdf_with_loops(file: Path, parse: Callable[[str, str], Element]) -> str:
    """The text of the URDF of the same name beside a YAML file, with its loops and its driven joints as gtpin's elements.

    A URDF that gtpin exported has these elements; then both files must say the same.

    Raises `RobotError` if one of the files is missing or damaged, a loop is not spherical, or the files do not belong
    together.
    """
    values = _Values.read(file)
    urdf = file.with_suffix(".urdf")
    text = read_text(urdf, RobotError, hint=f"put the URDF of {file.name} beside it, under this name")
    root = parse(text, str(urdf))
    if root.tag != "robot":
        raise RobotError(f"the outer element is <{root.tag}>", file=urdf, hint="a URDF's is <robot>")
    pairs, drives = values.pairs(), values.names("name_mot")
    if written := root.findall("loop_joint"):
        _check_written(file, [loop.get("name", "") for loop in written], pairs)
    else:
        for number, pair in enumerate(pairs):
            _add_loop(file, root, f"loop{number + 1}", pair)
    own = own_element(root)
    driven = [element.get("joint", "") for element in own.findall("actuator")]
    if driven and driven != drives:
        raise values.error("name_mot", f"the URDF's driven joints are {', '.join(driven)}", "write these")
    if not driven:
        for joint in drives:
            SubElement(own, "actuator", joint=joint)
    return tostring(root, encoding="unicode")


@dataclass(frozen=True)
class _Values:
    """The value of each key of a YAML file, with its row."""

    file: Path
    rows: Mapping[str, tuple[int, object]]

    @staticmethod
    def read(file: Path) -> _Values:
        found: dict[str, tuple[int, object]] = {}
        for row, line in enumerate(read_text(file, RobotError).splitlines(), 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            key, colon, value = line.partition(":")
            key = key.strip()
            try:
                if not colon or line[0].isspace() or key in found:
                    raise ValueError
                found[key] = row, ast.literal_eval(value.strip())  # these lists are the same in YAML, JSON and Python
            except (ValueError, SyntaxError, MemoryError, RecursionError):
                keys = ", ".join(READ)
                hint = f"write {keys}, each once, with a list on the same line: name_mot: ['joint1', 'joint2']"
                raise RobotError("no key with a list", file=file, row=row, hint=hint) from None
        for key in READ:
            if key not in found:
                hint = "give the robot.yaml of the robot"
                raise RobotError(f"the key {key} is missing", file=file, column=key, hint=hint)
        values = _Values(file, found)
        if other := sorted(found.keys() - set(READ)):
            several = other[0].startswith("joint_")
            hint = "write joints of several axes into the URDF (type spherical)" if several else "leave it out"
            raise values.error(other[0], f"{other[0]}: gtpin reads {', '.join(READ)} only", hint)
        return values

    def error(self, key: str, what: str, hint: str) -> RobotError:
        return RobotError(what, file=self.file, row=self.rows[key][0], column=key, hint=hint)

    def names(self, key: str) -> list[str]:
        value = self.rows[key][1]
        if not _are_names(value):
            raise self.error(key, f"{key} is no list of names", "write it as ['a', 'b']")
        return value

    def pairs(self) -> list[tuple[str, str]]:
        """Frames of each loop that is closed."""
        value, kinds = self.rows["closed_loop"][1], self.names("type")
        if not isinstance(value, list) or not all(_are_names(pair) and len(pair) == 2 for pair in value):
            hint = "write it as [['a', 'b'], ['c', 'd']]"
            raise self.error("closed_loop", "closed_loop is no list of pairs", hint)
        if len(kinds) != len(value):
            what = f"{len(kinds)} types for {len(value)} loops"
            raise self.error("type", what, "give one for each pair of closed_loop")
        for (one, other), kind in zip(value, kinds, strict=True):
            if kind.lower() != SPHERICAL:
                what = f"the loop of {one} and {other} is closed by {kind[:20]!r}, so it is no spherical joint"
                hint = f"gtpin closes loops by {SPHERICAL}: leave the axes of one joint of it free"
                raise self.error("type", what, hint)
        return [(one, other) for one, other in value]


def _are_names(value: object) -> TypeGuard[list[str]]:
    return isinstance(value, list) and all(isinstance(name, str) and name for name in value)


def _check_written(file: Path, loops: list[str], pairs: list[tuple[str, str]]) -> None:
    """Check that the pairs are those of a URDF that gtpin exported, which has the loops too."""
    expected = [tuple(f"{loop}{end}" for end in ENDS) for loop in loops]
    if sorted(pairs) != sorted(expected):
        what = f"closed_loop is not what the URDF's <loop_joint>s are: {', '.join(loops)}"
        raise RobotError(
            what, file=file, column="closed_loop", hint="leave <loop_joint> out of the URDF, or export both"
        )


def _add_loop(file: Path, root: Element, name: str, pair: tuple[str, str]) -> None:
    """Write a loop: both origins coincide."""
    loop = SubElement(root, "loop_joint", name=name, type="spherical")
    links = {link.get("name", "") for link in root.findall("link")}
    children = {joint.get("name", ""): joint.find("child") for joint in root.findall("joint")}
    for tag, frame in zip(("link1", "link2"), pair, strict=True):
        child = children.get(frame)
        # A joint's frame is that of its child.
        link = frame if frame in links or child is None else child.get("link", "")
        if link not in links:
            what = f"the URDF has no link and no joint {frame!r}"
            raise RobotError(what, file=file, column="closed_loop", hint="name two frames for each loop")
        SubElement(loop, tag, link=link)
