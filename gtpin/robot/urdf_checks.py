"""What is wrong with a URDF that is well-formed XML: not expanded by xacro, masses that can not be, angles like degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from gtpin.errors import RobotError, warn

XACRO = "this is a xacro file"
EXPAND = "expand it first (xacro FILE > robot.urdf)"
UNEXPANDED = re.compile(r"\$\{|\$\((arg|cwd|dirname|env|eval|find|optenv) ")
FULL_TURN = 2.0 * math.pi


def refuse_xacro(root: Element, source: str) -> None:
    """Refuse a file that xacro has still to expand: with its elements or attributes, or ``${...}`` in a link or joint.

    A file that only declares the namespace of xacro is what xacro writes.

    Raises
    ------
    RobotError
        If it is one.
    """
    for element in root.iter():
        if any("xacro}" in str(name) for name in (element.tag, *element.attrib)):
            raise RobotError(XACRO, file=source, hint=EXPAND)
    for element in _parts(root):
        if any(UNEXPANDED.search(value) for value in element.attrib.values()):
            raise RobotError(XACRO, file=source, hint=EXPAND)


def refuse_masses(root: Element, source: str) -> None:
    """Refuse links with a mass that is negative or not finite.

    Raises
    ------
    RobotError
        If there is one, with its name. What is no number, Pinocchio reports.
    """
    for link in root.findall("link"):
        mass = link.find("inertial/mass")
        try:
            value = 0.0 if mass is None else float(mass.get("value", "0"))
        except ValueError:
            continue
        if not (math.isfinite(value) and value >= 0.0):
            what = f"the mass of link {link.get('name', '')} is {value:g}"
            raise RobotError(what, file=source, hint="give a mass of 0 or more, kg")


def warn_of_degrees(root: Element, source: str) -> None:
    """Warn of each ``rpy`` with an angle of more than a full turn: URDF has radians."""
    for part in root:
        for element in part.iter():
            try:
                angles = [float(word) for word in element.get("rpy", "").split()]
            except ValueError:
                continue
            if any(abs(angle) > FULL_TURN for angle in angles):
                where = f"{part.tag} {part.get('name', '')}".strip()
                warn(
                    f'{source}: {where}: rpy="{element.get("rpy")}" is more than a full turn: angles in a URDF are in rad'
                )


def _parts(root: Element) -> Iterator[Element]:
    yield root
    for part in root:
        if part.tag in ("link", "joint"):
            yield from part.iter()
