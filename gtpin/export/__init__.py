"""Models for other software: URDF, and the formats that are registered as ``gtpin.writers``."""

from gtpin.export.box import Box
from gtpin.export.export import export
from gtpin.export.writer import TablesFor, Writer

__all__ = ["Box", "TablesFor", "Writer", "export"]
