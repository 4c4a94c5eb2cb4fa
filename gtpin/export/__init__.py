"""Models for other software: URDF, SDF, MJCF, and correction tables for controllers."""

from gtpin.compensation.controller import Box
from gtpin.export.export import SUFFIXES, Format, export
from gtpin.export.tables import TablesFor

__all__ = ["SUFFIXES", "Box", "Format", "TablesFor", "export"]
