"""What is wrong with a machine: 36 kinds, each with the answers that count as true.

Twelve are in the list of effects (docs/effects.md). Twenty-four are not, or only partly: an answer then counts as true if it
names the mechanism or its nearest listed description at the right part. This table was written before any answer was seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from machines import Array, Deviation, GantryTau, Loads, Tree
from measurement import Visits


@dataclass(frozen=True)
class Case:
    """A machine during its visits, as the kinds need it; ``T``, ``R``: nominal poses; ``s``: commands, -1 to 1."""

    v: Visits
    rng: np.random.Generator
    loads: Loads
    loads_more: Loads  # with a further payload
    T: Array
    R: Array
    velocity: Array  # of the tool, m/s

    @property
    def m(self) -> GantryTau | Tree:
        return self.v.machine

    @property
    def rods(self) -> bool:
        return isinstance(self.m, GantryTau)

    @property
    def s(self) -> Array:
        return 2 * (self.v.q - self.m.lower) / (self.m.upper - self.m.lower) - 1

    @property
    def t(self) -> Array:
        return (self.v.time - self.v.time[0]) / (self.v.time[-1] - self.v.time[0])

    def some(self) -> int:
        """A drive."""
        return int(self.rng.integers(self.m.n))

    def loaded(self) -> int:
        """A drive with a load that varies."""
        spread = self.loads.drive.std(axis=0)
        return int(self.rng.choice(np.flatnonzero(spread > 0.2 * spread.max())))

    def drive(self, k: int, values: Array) -> Deviation:
        out = np.zeros(self.v.q.shape)
        out[:, k] = values
        return Deviation(drive=out)

    def link(self, k: int, twist: Array) -> Deviation:
        """The tip of the link that joint k moves; -1: the base."""
        if k < 0:
            return Deviation(base=twist)
        out = np.zeros((len(self.v), self.m.model.nv, 6))
        out[:, k] = twist
        return Deviation(link=out)

    def cart(self, k: int, twist: Array) -> Deviation:
        out = np.zeros((len(self.v), 3, 6))
        out[:, k] = twist
        return Deviation(carrier=out)

    def link_name(self, k: int) -> str:
        if k < 0:
            return "base"
        bodies = [f for f in self.m.model.frames if f.parentJoint == k + 1 and "BODY" in str(f.type)]
        return str(bodies[0].name)

    def turns(self, axis: Array, values: Array) -> Array:
        return np.concatenate([np.zeros((len(self.v), 3)), values[:, None] * axis], axis=1)

    def shifts(self, axis: Array, values: Array) -> Array:
        return np.concatenate([values[:, None] * axis, np.zeros((len(self.v), 3))], axis=1)

    def direction(self) -> Array:
        axis = self.rng.normal(size=3)
        return axis / np.linalg.norm(axis)


Answer = tuple[Deviation, list[str]]  # and the true answers, effect@site, * for any


def unit(values: Array) -> Array:
    return (values - values.mean()) / max(values.std(), 1e-12)


def play(load: Array, width: float) -> Array:
    """What follows a load only after a lost motion, in the order of time."""
    out = np.zeros(len(load))
    for k in range(1, len(load)):
        out[k] = np.clip(out[k - 1], load[k] - width, load[k] + width)
    return out


# ---- in the list of effects ----


def gear_wave(c: Case) -> Answer:
    k = c.some()
    period = c.rng.uniform(0.02, 0.12) if c.rods else 2 * np.pi / c.rng.integers(6, 60)
    return c.drive(k, np.cos(2 * np.pi * c.v.q[:, k] / period + c.rng.uniform(0, 6))), [
        f"rack_periodic@{c.m.drives[k]}"
    ]


def backlash(c: Case) -> Answer:
    k = c.some()
    return c.drive(k, -c.v.approach[:, k]), [f"backlash@{c.m.drives[k]}"]


def warm_tripod(c: Case) -> Answer:
    rise = 1 - np.exp(-c.t / c.rng.uniform(0.2, 0.8))
    return Deviation(base=c.shifts(c.direction(), rise) + 0.3 * c.turns(c.direction(), rise)), ["tracker_drift@frame"]


def grown(c: Case, dT: Array) -> Deviation:
    """All links, by a temperature difference (N,)."""
    if c.rods:
        return Deviation(length=dT[:, None] * c.m.L)
    tips = [M.translation for M in [*c.m.model.jointPlacements[2:], c.m.tool]]
    if c.m.name == "five_bar":
        tips = [[0.28, 0, 0], [0.41, 0, 0], [0.28, 0, 0], [0.41, 0, 0]]
    return Deviation(link=dT[:, None, None] * np.concatenate([tips, np.zeros((len(tips), 3))], axis=1))


def warm_links(c: Case) -> Answer:
    return grown(c, c.v.temp_link - 20.0), ["thermal_links@arm"]


def warm_track_or_reseated_tool(c: Case) -> Answer:
    if c.rods:
        k = c.some()
        return c.drive(k, (c.v.q[:, k] + 0.65) * (c.v.temp_frame - 20.0)), [f"thermal_track@{c.m.drives[k]}"]
    seats = c.rng.normal(size=(5, 6)) * [1, 1, 1, 2, 2, 2]
    return Deviation(tool=seats[c.v.session]), ["target_shift@platform"]


def soft_drive(c: Case) -> Answer:
    k = c.loaded()
    effect = "cart_compliance" if c.rods else "joint_compliance"
    return c.drive(k, c.loads.drive[:, k]), [f"{effect}@{c.m.drives[k]}"]


def soft_rod_or_link(c: Case) -> Answer:
    if c.rods:
        k = int(c.rng.integers(6))
        out = np.zeros((len(c.v), 6))
        out[:, k] = c.loads.rods[:, k]
        return Deviation(length=out), [f"link_compliance@{c.m.rods[k]}"]
    k = int(c.rng.choice([1, 2]) if c.m.name == "ur5" else c.rng.choice([1, 3]))
    lever = c.m.model.jointPlacements[k + 2].translation
    length = np.linalg.norm(lever)
    u = lever / length
    F, M = c.loads.tips[:, k, :3], c.loads.tips[:, k, 3:]
    across, bend, twist = F - np.outer(F @ u, u), M - np.outer(M @ u, u), np.outer(M @ u, u)
    shift = across * length**3 / 3 + np.cross(M, u) * length**2 / 2
    turn = np.cross(u, F) * length**2 / 2 + bend * length + 1.3 * twist * length
    return c.link(k, np.concatenate([shift, turn], axis=1)), [f"link_compliance@{c.link_name(k)}"]


def moved_tripod(c: Case) -> Answer:
    seats = c.rng.normal(size=(5, 6)) * [1, 1, 1, 0.3, 0.3, 0.3]
    return Deviation(base=seats[c.v.session]), ["frame_shift@frame"]


def bent_rail_or_axis(c: Case) -> Answer:
    k = c.some()
    q = c.v.q[:, k]
    if c.rods:
        phase = c.rng.uniform(0, 6, 2)
        across = np.cos(2 * np.pi * q / 0.8 + phase[0]) + 0.4 * np.cos(2 * np.pi * q / 0.35 + phase[1])
        return c.cart(k, c.shifts(np.cross(c.m.d[k], c.direction()), across)), [f"straightness@{c.m.drives[k]}"]
    n = int(c.rng.integers(2, 4))
    tilt = np.stack([np.cos(n * q), np.sin(n * q), 0 * q], axis=1)
    about_own = [] if c.m.model.joints[k + 1].shortname() == "JointModelRZ" else [f"rack_periodic@{c.m.drives[k]}"]
    return c.link(k, np.concatenate([0.05 * tilt, tilt], axis=1)), [f"axis_motion@{c.m.drives[k]}", *about_own]


def homing(c: Case) -> Answer:
    k = c.some()
    return c.drive(k, c.rng.normal(size=5)[c.v.session]), [f"zero_shift@{c.m.drives[k]}"]


def growing_tool(c: Case) -> Answer:
    return Deviation(tool=c.shifts(c.direction(), 1 - np.exp(-c.t / c.rng.uniform(0.1, 0.6)))), [
        "target_drift@platform"
    ]


def wrong_pitch(c: Case) -> Answer:
    k = c.some()
    return c.drive(k, c.v.q[:, k]), [f"encoder_scale@{c.m.drives[k]}"]


# ---- not in the list, or partly ----


def cable_pull(c: Case) -> Answer:
    """A cable that pulls a drive, by where two others stand."""
    k = c.some()
    a, b = c.rng.permutation([j for j in range(c.m.n) if j != k] * 2)[:2]
    return c.drive(k, np.sin(1.7 * c.s[:, a] + 0.4) * np.exp(0.6 * c.s[:, b])), [f"cross_coupling@{c.m.drives[k]}"]


def slipping_coupling(c: Case) -> Answer:
    """Each long move lets a coupling slip, and the slips add up."""
    k = c.some()
    steps = np.diff(c.v.q[:, k], prepend=c.m.lower[k])
    over = np.maximum(np.abs(steps) - np.quantile(np.abs(steps), 0.6), 0) * np.where(steps > 0, 1.0, 0.5)
    return c.drive(k, np.cumsum(over)), [f"zero_shift@{c.m.drives[k]}"]


def loose_bolt(c: Case) -> Answer:
    """A flange that follows the load only after its friction, with history."""
    k = c.loaded()
    follows = play(unit(c.loads.drive[:, k]), 0.8)
    name = c.m.drives[k]
    if c.rods:
        rods = [f"joint_clearance@{rod}" for rod, cart in zip(c.m.rods, c.m.cart_of, strict=True) if cart == k]
        return c.cart(k, c.shifts(c.m.d[k], follows)), [f"cart_compliance@{name}", f"backlash@{name}", *rods]
    axis = c.m.model.jointPlacements[k + 1].rotation @ c.direction()
    parent = c.m.model.parents[k + 1] - 1
    return c.link(parent, c.turns(axis, follows)), [
        f"joint_clearance@{name}", f"bearing_compliance@{name}", f"link_compliance@{c.link_name(parent)}"]  # fmt: skip


def sun_on_frame(c: Case) -> Answer:
    """The difference of two temperatures bends the frame that carries the tracks, or tilts the base."""
    gradient = c.v.temp_frame - c.v.temp_link
    if c.rods:
        bend = gradient[:, None] * c.v.q**2
        return Deviation(carrier=np.concatenate([bend[..., None] * [0, 0, 1.0], np.zeros((len(c.v), 3, 3))], axis=2)), [
            "thermal_track@*"
        ]
    return Deviation(base=c.turns(np.array([0.6, 0.8, 0.0]), gradient)), ["tracker_drift@frame"]


def two_beats(c: Case) -> Answer:
    """An encoder whose interpolation has two near frequencies."""
    k = c.some()
    number = c.rng.uniform(20, 90)
    waves = number * np.array([1, 1 + c.rng.uniform(0.015, 0.06)]) / (1.2 if c.rods else 2 * np.pi)
    phase = c.rng.uniform(0, 6, 2)
    return c.drive(k, np.cos(2 * np.pi * np.outer(c.v.q[:, k], waves) + phase).sum(axis=1)), [
        f"rack_periodic@{c.m.drives[k]}"
    ]


def wobbling_target(c: Case) -> Answer:
    """A target on a soft stalk lags behind the tool with the square of its speed."""
    lag = -c.velocity * np.linalg.norm(c.velocity, axis=1)[:, None]
    lagging = np.concatenate([np.einsum("nji,nj->ni", c.R, lag), np.zeros_like(lag)], axis=1)
    return Deviation(tool=lagging), ["measurement_delay@frame"]


def floor_tilt(c: Case) -> Answer:
    """The floor tilts with the tool's place."""
    x, y, _ = (c.T - c.T.mean(axis=0)).T
    tilt = np.stack([-y, x, 0 * x], axis=1)
    first = [] if c.rods or c.m.name == "five_bar" else [f"bearing_compliance@{c.m.drives[0]}"]
    return Deviation(base=np.concatenate([np.zeros_like(tilt), tilt], axis=1)), first


def eccentric_cam(c: Case) -> Answer:
    """An eccentric wheel, the more so under load."""
    k = c.some()
    angle = 2 * np.pi * c.v.q[:, k] / 0.5 if c.rods else c.v.q[:, k]
    wave = np.cos(angle + c.rng.uniform(0, 6)) + 0.4 * np.cos(2 * angle + c.rng.uniform(0, 6))
    return c.drive(k, wave * (1 + 0.3 * unit(c.loads.drive[:, k]))), [
        f"{e}@{c.m.drives[k]}" for e in ("rack_periodic", "linearity")
    ]


def one_sided_link(c: Case) -> Answer:
    """A cracked link that gives way in one direction of its load only."""
    if c.rods:
        k = int(c.rng.integers(6))
        F = c.loads.rods[:, k]
        out = np.zeros((len(F), 6))
        out[:, k] = np.maximum(F - np.median(F), 0)
        return Deviation(length=out), [f"{e}@{c.m.rods[k]}" for e in ("link_compliance", "joint_clearance")]
    k = int(c.rng.choice([1, 2, 3]))
    axis = c.direction()
    moment = c.loads.tips[:, k, 3:] @ axis
    return c.link(k, c.turns(axis, np.maximum(moment - np.median(moment), 0))), [
        f"link_compliance@{c.link_name(k)}", f"joint_clearance@{c.m.drives[k]}"]  # fmt: skip


def refraction(c: Case) -> Answer:
    """Layers of warm air bend the beam, by the square of its length, and less as the hall warms up."""
    away = np.linalg.norm(c.T - c.v.station, axis=1)
    return Deviation(reading=c.shifts(np.array([0, 0, 1.0]), away**2 * (1 - 0.5 * c.t))), [
        "tracker_scale@frame",
        "tracker_drift@frame",
    ]


def azimuth_wave(c: Case) -> Answer:
    """The tracker's circle is eccentric, and has six waves a turn."""
    beam = c.T - c.v.station
    azimuth = np.arctan2(beam[:, 1], beam[:, 0])
    across = np.stack([-beam[:, 1], beam[:, 0], 0 * azimuth], axis=1)
    wave = np.sin(azimuth + c.rng.uniform(0, 6)) + np.sin(12 * azimuth + c.rng.uniform(0, 6))
    return Deviation(reading=np.concatenate([across * wave[:, None], np.zeros_like(across)], axis=1)), []


def windup(c: Case) -> Answer:
    """Friction winds a drive up over some travel after each reversal."""
    k = c.some()
    return c.drive(k, -c.v.approach[:, k] * (1 - np.exp(-c.v.travel[:, k] / np.median(c.v.travel[:, k])))), [
        f"backlash@{c.m.drives[k]}"
    ]


def elastic_chain(c: Case) -> Answer:
    """A chain whose free length, and so its give, grows along the travel."""
    k = c.loaded()
    return c.drive(k, c.loads.drive[:, k] * (c.s[:, k] + 1.2)), [
        f"{'cart_compliance' if c.rods else 'joint_compliance'}@{c.m.drives[k]}"]  # fmt: skip


def hidden_payload(c: Case) -> Answer:
    """All drives give way, and a second load, not recorded, hangs on in the second half."""
    load = np.where(c.t[:, None] > 0.5, c.loads_more.drive, c.loads.drive)
    return Deviation(drive=load), ["joint_compliance@*", "cart_compliance@*", "link_compliance@*"]


def forklift(c: Case) -> Answer:
    """Something bumps into the machine's base, once."""
    after = (c.t > c.rng.uniform(0.3, 0.7)) * 1.0
    return Deviation(base=c.shifts(c.direction(), after) + 0.3 * c.turns(c.direction(), after)), [
        "tracker_drift@frame",
        "frame_shift@frame",
    ]


def incidence(c: Case) -> Answer:
    """A reflector reads longer, the more obliquely the beam meets it."""
    beam = c.T - c.v.station
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    oblique = 1 - np.einsum("nij,j,ni->n", c.R, c.direction(), beam) ** 2
    return Deviation(reading=np.concatenate([beam * oblique[:, None], np.zeros_like(beam)], axis=1)), [
        "target_offset@platform"
    ]


def soft_flange(c: Case) -> Answer:
    """The plate between machine and tool bends under what it carries."""
    if c.rods:
        return Deviation(tool=c.turns(c.direction(), unit(c.loads.rods[:, 1] - c.loads.rods[:, 2]))), []
    up = c.R[:, 2, :]
    moment = np.cross([0.02, 0.0, 0.1], -9.81 * (c.v.payload + 1.0)[:, None] * up)
    last = c.link_name(c.m.tool_joint - 1)
    return Deviation(tool=np.concatenate([0.1 * moment, moment], axis=1)), [f"link_compliance@{last}"]


def sagging_rods(c: Case) -> Answer:
    """Rods sag under their own weight: the chord gets shorter by the square of the level part."""
    _, _, reach, _ = c.m.closed(c.v.q, np.zeros(48), Deviation())
    level = np.linalg.norm(reach[..., :2], axis=2) / np.linalg.norm(reach, axis=2)
    return Deviation(length=-(level**2)), ["joint_runout@*"]


def gas_spring(c: Case) -> Answer:
    """A counterbalance that loses force when it is cold lets a drive give way."""
    k = c.loaded()
    return c.drive(k, np.cos(c.v.q[:, k]) * (c.v.temp_link - c.v.temp_link.mean())), [
        f"joint_compliance@{c.m.drives[k]}"
    ]


def coupled_wrist(c: Case) -> Answer:
    """The last joint's gear is driven through the joint before, whose teeth it feels."""
    k, number = c.m.n - 1, c.rng.integers(5, 30)
    wave = np.cos(number * c.v.q[:, k - 1] + c.rng.uniform(0, 6))
    return c.drive(k, wave), [f"cross_coupling@{c.m.drives[k]}", f"rack_periodic@{c.m.drives[k - 1]}"]


def stiction(c: Case) -> Answer:
    """A drive stops anywhere in a band about its command."""
    return c.drive(c.some(), c.rng.uniform(-1, 1, len(c.v))), []


def foot_lifts(c: Case) -> Answer:
    """Beyond a line, one foot of the base leaves the floor."""
    out = (c.T - c.T.mean(axis=0)) @ np.array([np.cos(1.0), np.sin(1.0), 0.0])
    lifted = np.maximum(out - np.quantile(out, 0.6), 0)
    first = [] if c.rods or c.m.name == "five_bar" else [f"bearing_compliance@{c.m.drives[0]}"]
    return Deviation(base=c.turns(np.array([-np.sin(1.0), np.cos(1.0), 0.0]), lifted)), first


def quantised(c: Case) -> Answer:
    """A drive that moves in coarse steps."""
    k = c.some()
    step = (c.m.upper[k] - c.m.lower[k]) / c.rng.uniform(40, 400)
    return c.drive(k, np.round(c.v.q[:, k] / step) - c.v.q[:, k] / step), [f"rack_periodic@{c.m.drives[k]}"]


def thermal_lag(c: Case) -> Answer:
    """Links grow with the temperature of their core, which is behind that of the sensor."""
    core = np.zeros(len(c.v))
    core[0] = c.v.temp_link[0]
    for k in range(1, len(core)):
        core[k] = core[k - 1] + (c.v.temp_link[k] - core[k - 1]) * (1 - np.exp(-(c.t[k] - c.t[k - 1]) / 0.25))
    return grown(c, core - 20.0), ["thermal_links@*"]


ANY, RODS, TREES, ARMS = (
    ("gantry_tau", "five_bar", "ur5", "xarm7"),
    ("gantry_tau",),
    ("five_bar", "ur5", "xarm7"),
    ("ur5", "xarm7"),
)
LONG = ("gantry_tau", "ur5", "xarm7")

Kind = Callable[[Case], Answer]
LISTED: dict[Kind, tuple[str, ...]] = {
    gear_wave: ANY, backlash: ANY, warm_tripod: LONG, warm_links: ANY, warm_track_or_reseated_tool: LONG, soft_drive: ANY,
    soft_rod_or_link: LONG, moved_tripod: ANY, bent_rail_or_axis: LONG, homing: ANY, growing_tool: LONG, wrong_pitch: ANY,
}  # fmt: skip
UNLISTED: dict[Kind, tuple[str, ...]] = {
    cable_pull: ANY, slipping_coupling: ANY, loose_bolt: LONG, sun_on_frame: LONG, two_beats: ANY, wobbling_target: LONG,
    floor_tilt: LONG, eccentric_cam: ANY, one_sided_link: LONG, refraction: LONG, azimuth_wave: LONG, windup: ANY,
    elastic_chain: ANY, hidden_payload: ANY, forklift: LONG, incidence: LONG, soft_flange: LONG, sagging_rods: RODS,
    gas_spring: TREES, coupled_wrist: ARMS, stiction: ANY, foot_lifts: LONG, quantised: ANY, thermal_lag: LONG,
}  # fmt: skip
KINDS = {**LISTED, **UNLISTED}
NEEDS_SESSIONS = {warm_track_or_reseated_tool, moved_tripod, homing}
LARGEST: dict[Kind, float] = {
    warm_links: 3e-5,
    thermal_lag: 3e-5,
    warm_track_or_reseated_tool: 3e-5,
    wrong_pitch: 2e-3,
}  # of the factor: physical
