"""Instruments: what each reads of the robot, its unknowns with priors, and its noise."""

from __future__ import annotations

from gtpin.instruments.encoder import Encoder
from gtpin.instruments.instrument import Component, Instrument, Unknown
from gtpin.instruments.plane import Plane
from gtpin.instruments.range import Range
from gtpin.instruments.socket import Socket
from gtpin.instruments.tilt import Tilt
from gtpin.instruments.tracker import Tracker

BUILT_IN: dict[str, type[Instrument]] = {kind.kind: kind for kind in (Tracker, Range, Plane, Socket, Tilt, Encoder)}
"""The classes of the kinds of instruments that gtpin knows, by kind."""

__all__ = ["BUILT_IN", "Component", "Encoder", "Instrument", "Plane", "Range", "Socket", "Tilt", "Tracker", "Unknown"]
