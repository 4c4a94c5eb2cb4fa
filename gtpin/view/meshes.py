"""The meshes of a URDF's shapes: where they are on this machine, and the URDF without those that are missing."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import tostring

import pinocchio as pin
from defusedxml.ElementTree import fromstring

from gtpin.errors import warn
from gtpin.robot.description import Description, parse_xml

SCHEMES = ("package://", "model://")


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
    scheme = next((scheme for scheme in SCHEMES if name.startswith(scheme)), None)
    if scheme is not None:
        places = [folder / name.removeprefix(scheme) for folder in _folders(source)]
    else:
        places = [Path(source).parent / name.removeprefix("file://")]
    return next((place for place in places if place.is_file()), None)


def missing_meshes(description: Description) -> tuple[list[str], int]:
    """Names of the meshes to be seen that are not on this machine, and how many visual shapes the URDF has."""
    shapes = fromstring(description.xml).findall("link/visual/geometry")
    names = [str(mesh.get("filename", "")) for shape in shapes for mesh in shape.findall("mesh")]
    return [name for name in names if mesh_file(name, description.source) is None], len(shapes)


def with_its_meshes(description: Description) -> str:
    """The URDF's text with the paths of its visual meshes, and without the shapes whose mesh is missing.

    Warns
    -----
    GtpinWarning
        Of missing meshes: how many, and the first one.
    """
    root = parse_xml(description.xml, description.source)
    missing = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = mesh_file(name, description.source)
            if file is None:
                missing.append(name)
                link.remove(visual)
            else:
                mesh.set("filename", str(file))
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        warn(f"{description.source}: shapes are left out, for their meshes are missing: {missing[0]}{more}")
    return tostring(root, encoding="unicode")


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
