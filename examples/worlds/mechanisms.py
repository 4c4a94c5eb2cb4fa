"""The mechanisms: for each the catalogue's name at distance 0, from what distance it is unlisted, and what it moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapes
from arms import Arm
from motion import Array, Motion
from rods import GantryTau

Machine = GantryTau | Arm
Generator = np.random.Generator


@dataclass(frozen=True)
class Campaign:
    """What is known of each of the N stops, in the order of time."""

    q: Array  # (N, n) commands
    approach: Array  # (N, n), +1 or -1
    overrun: Array  # (N, n), the way of the approach
    time: Array  # (N,), s
    session: Array  # (N,), 0, 1, 2
    temp_link: Array  # (N,), degC
    temp_frame: Array
    payload: Array  # (N,), kg
    force: Array  # (N, 3), N
    tension: Array  # (N, r), N
    wrench: Array  # (N, n, 6) at each cart or joint

    def path(self, k: int) -> tuple[Array, Array]:
        """Waypoints of actuator k, and which of them are stops."""
        before = self.q[:, k] - self.approach[:, k] * self.overrun[:, k]
        return np.stack([before, self.q[:, k]], axis=1).ravel(), np.tile([False, True], len(self.q))


SUM = -1.0
Shape = Callable[[Machine, Campaign, int, float, Generator], Motion]


@dataclass(frozen=True)
class Mechanism:
    """A sum is the form of distance 0 and the form of distance 1, with cos^2 and sin^2 of a quarter turn times the distance
    as their shares of the energy; other mechanisms change their form with the distance, and `unlisted_from` is the least
    distance at which the catalogue's words no longer hold."""

    name: str
    listed: str  # the catalogue's name at distance 0
    unlisted_from: float
    shape: Shape
    needs: tuple[str, ...] = ()
    family: str = "both"  # both | rods | arms
    sites: str = "each"  # each actuator | links | arm | frame | platform
    least: float = 0.0  # smallest distance drawn

    def forms(self, distance: float) -> list[tuple[str, float, float]]:
        """Effects that are true at this distance, each with the distance of its form and its share of the energy."""
        if self.unlisted_from != SUM:
            return [(self.listed if distance < self.unlisted_from else "unlisted_" + self.name, distance, 1.0)]
        far = float(np.sin(0.5 * np.pi * distance)) ** 2
        both = [(self.listed, 0.0, 1.0 - far), ("unlisted_" + self.name, 1.0, far)]
        return [form for form in both if form[2] > 1e-9]


def still(machine: Machine, c: Campaign) -> Motion:
    return Motion.none(len(c.q), c.q.shape[1], len(machine.links))


def part(machine: Machine, k: int, q: Array) -> Array:
    """Place of actuator k on its travel, 0 to 1."""
    low, high = machine.travel[k]
    return (q[:, k] - low) / (high - low)


def drive(machine: Machine, c: Campaign, k: int, values: Array) -> Motion:
    motion = still(machine, c)
    motion.drive[:, k] = values
    return motion


def body(machine: Machine, c: Campaign, k: int, values: dict[int, Array]) -> Motion:
    motion = still(machine, c)
    for axis, v in values.items():
        motion.body[:, k, axis] = v
    return motion


def frame(machine: Machine, c: Campaign, twist: Array) -> Motion:
    """Translations of 1 go with rotations of 0.4 per metre; the station is about two metres from the machine."""
    return replace(still(machine, c), frame=twist * np.array([1.0, 1.0, 1.0, 0.4, 0.4, 0.4]))


def backlash(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    waypoints, stop = c.path(k)
    return drive(m, c, k, shapes.hysteresis(waypoints, stop, d, rng))


def stick_slip(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """Rest short of the command: by a constant; far: by a random way at each stop, to both sides."""
    if d == 0.0:
        return drive(m, c, k, c.approach[:, k])
    return drive(m, c, k, rng.exponential(1.0, len(c.q)) * rng.choice([-1.0, 1.0], len(c.q)))


def periodic(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    period = (
        float(np.exp(rng.uniform(np.log(0.03), np.log(0.25)))) if m.sliding else 2 * np.pi / rng.choice([1, 2, 3, 5])
    )
    return drive(m, c, k, shapes.periodic(c.q[:, k], period, d, rng))


def gears(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """Eccentricity of a wheel; the far form: transmission error that the load of the teeth modulates and turns over."""
    teeth = 1.0 if rng.uniform() < 0.5 else float(rng.integers(2, 6))
    if d == 0.0:
        return drive(m, c, k, np.sin(teeth * c.q[:, k] + rng.uniform(0, 2 * np.pi)))
    load = c.wrench[:, k, 5] if np.ptp(c.wrench[:, k, 5]) > 1e-6 else c.q[:, k - 1]
    return drive(m, c, k, load * shapes.periodic(c.q[:, k], 2 * np.pi / teeth, 0.6, rng) * c.approach[:, k])


def smooth_drive(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    return drive(m, c, k, shapes.smooth(part(m, k, c.q)[:, None], d, rng))


def wear(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    return drive(m, c, k, shapes.worn(part(m, k, c.q), d, rng))


def straight(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    x = part(m, k, c.q)[:, None]
    return body(m, c, k, {axis: shapes.smooth(x, d, rng) for axis in (1, 2)})


def rolling(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    x = part(m, k, c.q)[:, None]
    return body(m, c, k, {axis: shapes.smooth(x, d, rng) for axis in (3, 4, 5)})


def axis_motion(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """Two harmonics of radial and tilt motion; the far form is a rough process of the angle (a Gaussian process)."""
    values = {}
    for axis, size in ((0, 0.5), (1, 0.5), (3, 1.0), (4, 1.0)):
        if d == 0.0:
            waves = np.stack([np.sin(h * c.q[:, k] + rng.uniform(0, 6.28)) / h for h in (1, 2)]).sum(0)
        else:
            waves = shapes.smooth(part(m, k, c.q)[:, None], d, rng)
        values[axis] = size * waves
    return body(m, c, k, values)


def hose(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """A bundle pulls a drive in proportion to its neighbours' places; far: hung in an arc, with the bundle's friction."""
    others = [j for j in range(c.q.shape[1]) if j != k][:3]
    x = np.stack([part(m, j, c.q) for j in others], axis=1)
    if d == 0.0:
        return drive(m, c, k, (x - x.mean(0)) @ rng.standard_normal(len(others)))
    span = np.linalg.norm(x - part(m, k, c.q)[:, None] - rng.uniform(-0.3, 0.3), axis=1)
    waypoints, stop = c.path(others[0])
    friction = shapes.unit(shapes.hysteresis(waypoints, stop, 0.7, rng))
    arc = shapes.unit(np.cosh(2.0 * span) - np.cosh(2.0 * span).mean())
    pull = arc * (1.0 + 0.7 * friction) + 0.7 * friction
    tip = body(m, c, k, {axis: 0.5 * pull * rng.standard_normal() for axis in (3, 4)})
    return drive(m, c, k, pull).plus(tip)


def cart_gives(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """Compliance along, across and in tipping; far: stiffening by a power of the load, with a friction-like loop."""
    softness = rng.uniform(0.3, 1.0, 6) * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    size = np.sqrt(np.mean((c.wrench[:, k, :3] ** 2).sum(1)))
    waypoints, stop = c.path(k)
    loop = 1.0 + 0.6 * max(0.0, d - 0.5) * shapes.hysteresis(waypoints, stop, 0.0, rng)
    values = {}
    for axis in range(6):
        load = c.wrench[:, k, axis] / size
        curved = np.sign(load) * np.abs(load) ** (1.0 - 2.0 * d / 3.0)
        values[axis] = softness[axis] * curved * loop
    return body(m, c, k, values)


def joint_gives(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    waypoints, stop = c.path(k)
    loop = shapes.unit(shapes.hysteresis(waypoints, stop, 0.4, rng)) if d > 0.5 else 0.0
    return drive(m, c, k, shapes.power(c.wrench[:, k, 5], d) + max(0.0, d - 0.5) * loop)


def bearing(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    size = np.sqrt(np.mean((c.wrench[:, k, 3:5] ** 2).sum(1)))
    loads = c.wrench[:, k, 3:5] / size
    norm = np.maximum(np.linalg.norm(loads, axis=1), 1e-9) ** (-2.0 * d / 3.0)
    return body(m, c, k, {3: loads[:, 0] * norm, 4: loads[:, 1] * norm})


def hertz(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """Rods stretch; far: the contacts of their joints give way by a power of the force. k = -1: all rods alike."""
    which = range(6) if k < 0 else [k]
    motion = still(m, c)
    size = np.sqrt(np.mean(c.tension**2))
    for r in which:
        load = c.tension[:, r] / size
        motion.rod[:, r] = np.sign(load) * np.abs(load) ** (1.0 - 2.0 * d / 3.0)
    return motion


def heat(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    warm = shapes.lagging(c.time, c.temp_link, d) - 20.0
    if isinstance(m, GantryTau):
        return replace(still(m, c), rod=np.tile(warm[:, None], (1, 6)))
    motion = still(m, c)
    for j in range(c.q.shape[1]):
        motion.body[:, j, :3] = warm[:, None] * np.array(m.placements[j + 1][:3])
    return motion


def warm_track(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    warm = shapes.lagging(c.time, c.temp_frame, d) - 20.0
    return drive(m, c, k, warm * (c.q[:, k] - rng.uniform(-0.5, 0.5)))


def base_plate(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """A plate that the bolts let sit elsewhere in each session; far: it rocks by the sign of the moment that it carries."""
    if d == 0.0:
        return frame(m, c, rng.standard_normal((3, 6))[c.session])
    moment = c.wrench[:, 0, 0] if m.sliding else c.wrench[:, 0, 3] + c.payload * c.q[:, 0]
    rock = np.tanh(4.0 * (moment - np.median(moment)) / max(float(np.std(moment)), 1e-9))
    return frame(m, c, rock[:, None] * rng.standard_normal(6))


def tilting(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """The floor settles with time; far: it tilts with the weight that moves on it."""
    t = (c.time - c.time.min()) / np.ptp(c.time)
    if d == 0.0:
        return frame(m, c, (t - 0.5)[:, None] * rng.standard_normal(6))
    x = np.stack([part(m, j, c.q) - 0.5 for j in range(2)], axis=1)
    weight = (x @ rng.standard_normal((2, 6))) * (1.0 + 0.5 * np.sin(6.0 * t + rng.uniform(0, 6)))[:, None]
    return frame(m, c, weight)


def scale(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """A wrong scale; far: one that wanders (air temperature, pressure) as a random walk."""
    walk = np.cumsum(rng.standard_normal(len(c.time)))
    return replace(still(m, c), scale=np.ones(len(walk)) if d == 0.0 else walk - walk.mean())


def creep(m: Machine, c: Campaign, k: int, d: float, rng: Generator) -> Motion:
    """The target slides on its glue: by the logarithm of time; far: by jumps at changes of the payload too."""
    t = (c.time - c.time.min()) / np.ptp(c.time)
    jumps = np.cumsum(np.abs(np.diff(c.payload, prepend=c.payload[0])) > 1.0) * 1.0
    slide = shapes.unit(np.log1p(8.0 * t)) + (d - 0.3) * shapes.unit(jumps - jumps.mean())
    return replace(still(m, c), target=slide[:, None] * rng.standard_normal(6) * np.array([1, 1, 1, 0.5, 0.5, 0.5]))


MECHANISMS = (
    Mechanism("hysteresis", "backlash", 0.6, backlash, ("approach",)),
    Mechanism("stick_slip", "backlash", SUM, stick_slip, ("approach",)),
    Mechanism("fourier", "rack_periodic", 1.0, periodic),
    Mechanism("gears", "rack_periodic", SUM, gears, family="arms"),
    Mechanism("gaussian_drive", "linearity", 1.0, smooth_drive),
    Mechanism("wear", "linearity", 0.6, wear),
    Mechanism("gaussian_track", "straightness", 1.0, straight, family="rods"),
    Mechanism("gaussian_cart", "cart_rotation", 1.0, rolling, family="rods"),
    Mechanism("gaussian_axis", "axis_motion", SUM, axis_motion, family="arms"),
    Mechanism("hose", "cross_coupling", SUM, hose),
    Mechanism("cart_gives", "cart_compliance", 1.0, cart_gives, ("payload", "force"), "rods"),
    Mechanism("joint_gives", "joint_compliance", 1.0, joint_gives, ("payload", "force"), "arms"),
    Mechanism("bearing", "bearing_compliance", 1.0, bearing, ("payload", "force"), "arms"),
    Mechanism("hertz", "link_compliance", 1.0, hertz, ("payload", "force"), "rods", sites="links"),
    Mechanism("heat", "thermal_links", 0.6, heat, ("temp_link", "time"), sites="arm"),
    Mechanism("warm_track", "thermal_track", 0.6, warm_track, ("temp_frame", "time"), "rods"),
    Mechanism("base_plate", "frame_shift", SUM, base_plate, ("session", "payload"), sites="frame"),
    Mechanism("tilting", "tracker_drift", SUM, tilting, ("time",), sites="frame"),
    Mechanism("scale", "tracker_scale", SUM, scale, ("time",), sites="frame"),
    Mechanism("creep", "target_offset", 0.0, creep, ("time", "payload"), sites="platform", least=0.3),
)
