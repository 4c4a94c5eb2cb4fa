"""Extras: files of other programs, controllers and simulators, certificates, a 3-D view, a history of checks.

Each folder registers its commands, file formats and presentations by entry points of ``pyproject.toml``. Nothing outside this
folder imports it.
"""
