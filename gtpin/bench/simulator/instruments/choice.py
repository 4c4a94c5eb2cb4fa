"""The kinds of instruments of the simulator, how one of each kind is drawn, and its noise."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Layout
from gtpin.bench.simulator.instruments.readers import (
    VirtualCamera,
    VirtualEncoder,
    VirtualRange,
    VirtualTilt,
    VirtualTracker,
)
from gtpin.bench.simulator.instruments.touch import VirtualPlane, VirtualSocket
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.errors import GtpinError
from gtpin.typing import Floats, Ints

KINDS = ("tracker", "camera", "range", "plane", "socket", "tilt", "encoder", "ballbar")
"""Kinds of instruments: those of a dataset, a camera (a tracker of several targets), and a ball bar (a range)."""
TOUCHED: dict[str, Callable[[Layout, Ints, bool, np.random.Generator], Gauge]] = {
    "plane": VirtualPlane.drawn,
    "socket": VirtualSocket.drawn,
}
"""Kinds of touched instruments: the machine moves to them. The others read at any pose."""
BAR = "ballbar"
"""This kind has its own stops, along circles."""


def checked(kinds: Sequence[str]) -> tuple[str, ...]:
    """The kinds in the order of KINDS. Raises GtpinError if a kind is not known, or given twice."""
    for i, kind in enumerate(kinds):
        if kind not in KINDS:
            raise GtpinError(f"no instrument is called {kind!r}", hint=f"use {', '.join(KINDS)}")
        if kind in kinds[:i]:
            raise GtpinError(f"the instrument {kind} comes twice", hint="name it once")
    return tuple(kind for kind in KINDS if kind in kinds)


def reading(kinds: Collection[str]) -> tuple[str, ...]:
    """Those of some kinds that read at any pose."""
    return tuple(kind for kind in kinds if kind not in (*TOUCHED, BAR))


def stream(seed: int, kind: str) -> np.random.Generator:
    """Random stream for the unknowns of an instrument: the same whatever other instruments there are."""
    return np.random.default_rng(np.random.SeedSequence([seed, 6, KINDS.index(kind)]))


def drawn(kind: str, layout: Layout, poses: VirtualPoses, stops: Ints, noise: SimulatedNoise, seed: int) -> Gauge:
    """An instrument that reads at ``stops`` (M,), at which the machine has ``poses`` (M), base frame.

    Raises GtpinError for an encoder, if the poses have no joint's coordinates; for a tilt sensor, if it is never near
    level.
    """
    rng = stream(seed, kind)
    if kind == "tracker":
        return VirtualTracker.drawn(poses, stops, noise, rng)
    if kind == "camera":
        return VirtualCamera.drawn(layout, poses, stops, noise.declared, rng)
    if kind == "range":
        return VirtualRange.wires(layout, stops, noise.declared, rng)
    if kind == "tilt":
        return VirtualTilt.drawn(layout, poses, stops, noise.declared, rng)
    return VirtualEncoder.drawn(poses, stops, noise.declared, rng)


def errors(gauge: Gauge, noise: SimulatedNoise, seed: int) -> Floats:
    """(M, c) random errors of an instrument's readings: with its sigma, and with the tails and gross errors of ``noise``.

    They are the same whatever other instruments there are.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 8, *gauge.name.encode()]))
    found = gauge.sigma * noise.drawn(rng, gauge.sigma.shape)
    return np.asarray(found + gauge.sigma * noise.drawn_gross(rng, found.shape))


def held_readings(gauges: Sequence[Gauge], poses: VirtualPoses) -> dict[str, tuple[Floats, Floats]]:
    """Readings of instruments at poses (H) without noise, with ids in turn, and their sigmas, by name; see ``InstrumentCase``.

    Touched instruments are left out: the machine does not touch them at these poses.
    """
    found = {}
    for gauge in (gauge for gauge in gauges if not gauge.touches):
        one = gauge.in_turn(len(poses))
        found[gauge.name] = one.readings(poses, one.truth)[:, :3], one.sigma[:, :3]
    return found
