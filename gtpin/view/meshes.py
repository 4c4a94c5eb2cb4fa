"""Where the meshes of a URDF are on this machine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pinocchio as pin
from defusedxml.ElementTree import fromstring

from gtpin.robot.description import Description

PACKAGE = "package://"


def mesh_file(name: str, source: str) -> Path | None:
    """The file of a mesh; None where there is none.

    ``package://`` names are looked for beside the URDF and above it, in ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and
    where example-robot-data has its files. Other names are relative to the URDF.

    Parameters
    ----------
    name
        As the URDF has it.
    source
        The URDF's file.
    """
    if name.startswith(PACKAGE):
        places = [folder / name.removeprefix(PACKAGE) for folder in _folders(source)]
    else:
        places = [Path(source).parent / name.removeprefix("file://")]
    return next((place for place in places if place.is_file()), None)


def missing_meshes(description: Description) -> tuple[list[str], int]:
    """Names of the meshes to be seen that are not on this machine, and how many visual shapes the URDF has."""
    shapes = fromstring(description.xml).findall("link/visual/geometry")
    names = [str(mesh.get("filename", "")) for shape in shapes for mesh in shape.findall("mesh")]
    return [name for name in names if mesh_file(name, description.source) is None], len(shapes)


def _folders(source: str) -> Iterator[Path]:
    """Folders that packages may be in."""
    yield from Path(source).resolve().parents
    for variable, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for folder in os.environ.get(variable, "").split(os.pathsep):
            if folder:
                yield Path(folder) / below
    # Pinocchio and example-robot-data share a prefix where pip installs them.
    for prefix in Path(pin.__file__).parents:
        yield prefix / "share"
