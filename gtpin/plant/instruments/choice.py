"""Which instruments there are, and the gauges of those that are asked for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
import numpy.typing as npt

from gtpin.errors import GtpinError
from gtpin.plant.instruments.encoder import Encoder
from gtpin.plant.instruments.gauge import Gauge
from gtpin.plant.instruments.layout import Layout
from gtpin.plant.instruments.plane import Plane
from gtpin.plant.instruments.range import Range
from gtpin.plant.instruments.socket import Socket
from gtpin.plant.instruments.tilt import Tilt
from gtpin.plant.instruments.tracker import Camera, Tracker
from gtpin.plant.poses import Poses
from gtpin.plant.tracker import Noise

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]

KINDS = ("tracker", "camera", "range", "plane", "socket", "tilt", "encoder", "ballbar")
"""What can be asked for: the dataset's kinds, a camera, which is a tracker of several targets, and a ball bar: a range."""
TOUCHED: dict[str, Callable[[Layout, Ints, bool, np.random.Generator], Gauge]] = {
    "plane": Plane.drawn,
    "socket": Socket.drawn,
}
"""Those to which the machine is brought; the others read wherever it stops."""


def checked(kinds: Sequence[str]) -> tuple[str, ...]:
    """The kinds in the order of KINDS.

    Raises
    ------
    GtpinError
        For one that is not known, or comes twice.
    """
    for i, kind in enumerate(kinds):
        if kind not in KINDS:
            raise GtpinError(f"no instrument is called {kind!r}", hint=f"use {', '.join(KINDS)}")
        if kind in kinds[:i]:
            raise GtpinError(f"the instrument {kind} comes twice", hint="name it once")
    return tuple(kind for kind in KINDS if kind in kinds)


BAR = "ballbar"
"""It has stops of its own as well: along circles."""


def reads(kinds: Collection[str]) -> bool:
    """Whether any of the instruments reads wherever the machine stops."""
    return bool(set(kinds) - set(TOUCHED) - {BAR})


def stream(seed: int, kind: str) -> np.random.Generator:
    """For what is drawn of an instrument: it is the same whatever others there are."""
    return np.random.default_rng(np.random.SeedSequence([seed, 6, KINDS.index(kind)]))


def noises(seed: int, gauges: Sequence[Gauge]) -> list[np.random.Generator]:
    """For the errors of each gauge's readings: the same whatever others there are."""
    return [np.random.default_rng(np.random.SeedSequence([seed, 8, *gauge.name.encode()])) for gauge in gauges]


def reading(kind: str, layout: Layout, poses: Poses, stops: Ints, noise: Noise, rng: np.random.Generator) -> Gauge:
    """An instrument that reads at stops (M,), at which the machine has some poses (M).

    Raises
    ------
    GtpinError
        For an encoder, if no joint comes with the poses; for a tilt sensor that is never near level.
    """
    if kind == "tracker":
        return Tracker.drawn(poses, stops, noise, rng)
    if kind == "camera":
        return Camera.drawn(layout, poses, stops, noise.declared, rng)
    if kind == "range":
        return Range.drawn(layout, stops, noise.declared, rng)
    if kind == "tilt":
        return Tilt.drawn(layout, poses, stops, noise.declared, rng)
    return Encoder.drawn(poses, stops, noise.declared, rng)


def errors(gauge: Gauge, noise: Noise, rng: np.random.Generator) -> Floats:
    """(M, c) errors of a gauge's readings: by its sigma, with the tails and gross errors of ``noise``."""
    found = gauge.sigma * noise.drawn(rng, gauge.sigma.shape)
    off = rng.random(len(found)) < noise.gross
    size = np.exp(rng.uniform(np.log(10.0), np.log(100.0), (len(found), 1)))
    way = rng.standard_normal(found.shape)
    return np.asarray(
        found + gauge.sigma * np.where(off[:, None], size * way / np.linalg.norm(way, axis=1, keepdims=True), 0.0)
    )


def held_readings(gauges: Sequence[Gauge], poses: Poses) -> dict[str, tuple[Floats, Floats]]:
    """What gauges read at poses (H) without noise, with ids in turn, and their sigmas, by name; see ``InstrumentCase``.

    Left out is what is touched: nothing is touched at these commands.
    """
    found = {}
    for gauge in (gauge for gauge in gauges if not gauge.touches):
        one = gauge.in_turn(len(poses))
        found[gauge.name] = one.readings(poses, one.truth)[:, :3], one.sigma[:, :3]
    return found
