"""Models for other software: URDF, SDF, MJCF, and correction tables for controllers."""

from gtpin.export.export import SUFFIXES, Format, export
from gtpin.extras.controllers.controller import Box
from gtpin.extras.controllers.tables import TablesFor

__all__ = ["SUFFIXES", "Box", "Format", "TablesFor", "export"]
