"""Models for other software: URDF, SDF, MJCF, and what a controller can correct."""

from gtpin.export.export import SUFFIXES, Format, export

__all__ = ["SUFFIXES", "Format", "export"]
