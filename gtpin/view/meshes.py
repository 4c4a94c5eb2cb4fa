"""The mesh files of a URDF's shapes: their paths, and the URDF without the shapes whose mesh is missing."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import tostring

from gtpin.errors import warn
from gtpin.robot.description import Description, parse_xml
from gtpin.robot.examples import package_folder

SCHEMES = ("package://", "model://")


def mesh_folders(description: Description) -> list[Path]:
    """Folders in which ``package://`` paths are looked for: all those that contain the URDF, and that of example-robot-data."""
    found = list(Path(description.source).absolute().parents)
    shared = package_folder()
    return found if shared is None else [*found, shared]


def with_its_meshes(description: Description) -> str:
    """The URDF's text with absolute paths of its visual meshes, and without the shapes whose mesh is missing.

    Warns
    -----
    GtpinWarning
        If meshes are missing: their number, and the first one.
    """
    root = parse_xml(description.xml, description.source)
    folders = mesh_folders(description)
    missing = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = _found(name, folders)
            if file is None:
                missing.append(name)
                link.remove(visual)
            else:
                mesh.set("filename", str(file))
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        warn(f"{description.source}: shapes are left out, for their meshes are missing: {missing[0]}{more}")
    return tostring(root, encoding="unicode")


def _found(name: str, folders: list[Path]) -> Path | None:
    scheme = next((scheme for scheme in SCHEMES if name.startswith(scheme)), None)
    plain = name.removeprefix("file://") if scheme is None else name.removeprefix(scheme)
    places = folders[:1] if scheme is None else folders  # a relative path starts at the URDF
    return next((place / plain for place in places if plain and (place / plain).is_file()), None)
