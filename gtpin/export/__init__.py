"""Models for other software: URDF, SDF, MJCF, and what a controller can correct."""

from gtpin.compensation.box import Box
from gtpin.export.export import SUFFIXES, Format, export
from gtpin.export.tables_for import TablesFor

__all__ = ["SUFFIXES", "Box", "Format", "TablesFor", "export"]
