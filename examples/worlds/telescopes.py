"""Arms on a telescope or column that stands on a base with feet: machines, what gives way below the arm, and cases.

Sources: Gere and Goodno 2012, ch. 9 (beams); Findley, Lai and Onaran 1976, ch. 5 (the standard linear solid: a base
that settles under its load); Rasmussen and Williams 2006, ch. 4 (rough joints: a Gaussian process of the angle).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import mechanisms
import numpy as np
import shapes
from arms import ELBOW, PANDA, UR5, Arm, H
from energy import Absorption, Tracker
from mechanisms import Campaign, body, still
from motion import Array, Motion

Generator = np.random.Generator
Shape = Callable[[Arm, Campaign, int, Generator], Motion]
FIVE = replace(
    ELBOW, placements=(*ELBOW.placements[:5], (0.0, 0.0, 0.3, 0.0)), masses=ELBOW.masses[:5], centres=ELBOW.centres[:5]
)
LARGE = (1e-3, 4e-3)  # m, rms at the TCP beside what geometry absorbs, as on real machines
ENERGIES = (300.0, 1000.0, 3000.0)

# what moves in each case of a round, beside geometry errors and noise; "rough" are the joints' own errors
ROUND: tuple[tuple[str, ...], ...] = (
    ("column",),
    ("base",),
    ("settling",),
    ("bearing",),
    ("column", "base"),
    ("column", "settling"),
    ("column", "bearing"),
    ("base", "bearing"),
    ("column", "joint"),
    ("base", "joint"),
    ("column", "rough"),
    ("base", "rough"),
    ("bearing", "rough"),
    ("settling", "rough"),
    ("column", "base", "rough"),
    ("column", "sun"),
    ("base", "hose"),
    ("column", "guide"),
    ("sun",),
    ("hose",),
    ("guide",),
    ("rough",),
    (),
    (),
)


def machine(rng: Generator) -> Arm:
    """In half of the cases one stage; else two, the second of which follows the first, or both of which a pseudo joint."""
    arm = (UR5, FIVE, PANDA)[rng.integers(3)]
    stages, pseudo = (((1.0,), False), ((1.0,), False), ((1.0, 1.0), False), ((0.5, 0.5), True))[rng.integers(4)]
    rest = tuple(float(v) for v in np.round(rng.uniform((0.4, 0.15), (0.8, 0.3)), 3))[: len(stages)]
    lying = bool(rng.uniform() < 1 / 3)  # a boom along y; else it stands
    foot, step = round(float(rng.uniform(0.0, 0.2)), 3), round(float(rng.uniform(0.02, 0.1)), 3)
    x, _, z, roll = arm.placements[0]
    first = (0.0, foot + rest[0], 1.0, -H) if lying else (0.0, 0.0, foot + rest[0], 0.0)
    mount = (x, -z - step, 0.0, roll + H) if lying else (x, 0.0, z + step, roll)
    masses = tuple(float(v) for v in np.round(rng.uniform(8.0, 25.0, len(stages)), 2))
    centres = ((0.0, 0.0, -0.2),) * len(stages)
    longest = round(float(rng.uniform(0.7, 1.2)) / sum(stages), 3)
    return replace(
        arm,
        robot=arm.robot.replace("world", "telescope"),
        placements=(first, *((0.0, 0.0, r, 0.0) for r in rest[1:]), mount, *arm.placements[1:]),
        masses=masses + arm.masses,
        centres=centres + arm.centres,
        travel=((0.0, longest), *arm.travel[: len(arm.masses)]),
        station=(2.5, -1.5, 0.8),
        stages=stages,
        rest=rest,
        pseudo=pseudo,
    )


def compliance(rng: Generator) -> Array:
    """Symmetric 2 x 2: two axes at any angle, one 1.5 to 20 times as soft as the other."""
    a, ratio = rng.uniform(0.0, np.pi), float(np.exp(rng.uniform(np.log(1.5), np.log(20.0))))
    axes = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return np.asarray(axes @ np.diag([1.0, 1.0 / ratio]) @ axes.T)


def bent(load: Array, length: Array, soft: Array) -> Array:
    """Twist (N, 6) of the end of a beam along z that is held at its other end, by force and moment (N, 6) at its end.

    A piece dx at x before the end turns by C (M + x z × F) dx, with the 2 x 2 compliance C, 1/(N m²): 1/EI of each axis.
    """
    L = length[:, None]
    moment, slope = load[:, 3:5], np.stack([-load[:, 1], load[:, 0]], axis=1)
    turn = (moment * L + slope * L**2 / 2.0) @ soft.T
    lever = (moment * L**2 / 2.0 + slope * L**3 / 3.0) @ soft.T
    zero = np.zeros((len(load), 1))
    return np.concatenate([lever[:, 1:], -lever[:, :1], zero, turn, zero], axis=1)


def out(m: Arm, c: Campaign) -> Array:
    """(N, stages) m, how far each stage reaches out of what carries it: rest and travel."""
    return np.asarray(np.array(m.rest) + c.q[:, :1] * np.array(m.stages))


def column(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """Each stage bends under what it carries; the second one, of a smaller section, by as much or up to four times more."""
    soft, thinner = compliance(rng), float(rng.choice([1.0, 4.0 ** rng.uniform()]))
    length, load = out(m, c), m.carried(c.q, c.payload, c.force)
    total = np.zeros((len(c.q), 6))
    for stage in range(len(m.stages)):
        twist = bent(load[:, stage], length[:, stage], soft * thinner**stage)
        beyond = length[:, stage + 1 :].sum(1)
        twist[:, 0] += twist[:, 4] * beyond
        twist[:, 1] -= twist[:, 3] * beyond
        total += twist
    return body(m, c, 0, {axis: total[:, axis] for axis in (0, 1, 3, 4)})


def tilt(m: Arm, c: Campaign, pivot: Array, soft: Array, later: float, lag: float) -> Motion:
    """The base rocks about a pivot on the floor: by C M at once, and by `later` times C M behind with a time constant.

    The later part s follows ds/dt = (C M - s) / lag, from s = 0 at the first stop, with the moment of each stop until the next.
    """
    T = m.chain(c.q, np.zeros(len(m.tolerance)), still(m, c))[:, 0]
    force, moment = (
        np.einsum("nij,nj->ni", T[:, :3, :3], w) for w in np.split(m.carried(c.q, c.payload, c.force)[:, 0], 2, 1)
    )
    asked = (moment + np.cross(T[:, :3, 3] - pivot, force))[:, :2] @ soft.T
    turned = asked.copy()
    state = np.zeros(2)
    for n, gap in enumerate(np.diff(c.time, prepend=c.time[0])):
        state = asked[n - 1] + (state - asked[n - 1]) * np.exp(-gap / lag) if n else state
        turned[n] += later * state
    rotation = np.concatenate([turned, np.zeros((len(turned), 1))], axis=1)
    shift = np.cross(rotation, np.array(m.station) - pivot)
    return replace(still(m, c), frame=np.concatenate([shift, rotation], axis=1))


def base(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    pivot = rng.uniform([-0.2, -0.2, -0.6], [0.2, 0.2, 0.0])
    return tilt(m, c, pivot, compliance(rng), 0.0, 1.0)


def settling(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    pivot = rng.uniform([-0.2, -0.2, -0.6], [0.2, 0.2, 0.0])
    return tilt(m, c, pivot, compliance(rng), rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.5) * float(np.ptp(c.time)))


def bearing(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """The bearing between column and arm tilts by a full matrix along the axes of what carries it."""
    cos, sin = np.cos(c.q[:, 1]), np.sin(c.q[:, 1])
    R = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1)
    turn = np.einsum("nji,jk,nlk,nl->ni", R, compliance(rng), R.transpose(0, 2, 1), c.wrench[:, 1, 3:5])
    return body(m, c, 1, {3: turn[:, 0], 4: turn[:, 1]})


def joint(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    return mechanisms.joint_gives(m, c, k, 0.0, rng)


def rough(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """Each joint of the arm has an own error, a Gaussian process of its angle with a length scale of 0.5 to 5 degrees."""
    motion = still(m, c)
    for j in range(1, c.q.shape[1]):
        length = np.radians(np.exp(rng.uniform(np.log(0.5), np.log(5.0))))
        motion.drive[:, j] = rng.uniform(0.3, 1.0) * shapes.smooth(c.q[:, [j]] / length, 0.0, rng)
    return motion


def sun(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """No list names it: heat from one side bends the column with a curvature that changes over time."""
    t = (c.time - c.time[0]) / np.ptp(c.time)
    curve = np.stack([np.sin(5.0 * t + rng.uniform(0, 6)) + np.sin(11.0 * t + rng.uniform(0, 6)) for _ in range(2)], 1)
    length = out(m, c).sum(1)
    twist = bent(np.pad(curve, ((0, 0), (3, 1))), length, np.eye(2))
    return body(m, c, 0, {axis: twist[:, axis] for axis in (0, 1, 3, 4)})


def hose(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """No list names it: a bundle that hangs in an arc, with friction, pulls a joint and tips it."""
    return mechanisms.hose(m, c, k, 1.0, rng)


def guide(m: Arm, c: Campaign, k: int, rng: Generator) -> Motion:
    """No list names it: the slider leans under its moment, to an end that friction holds, by less after a way down than up."""
    load = shapes.unit(c.wrench[:, 0, 3:5])
    lean = np.tanh(2.0 * load) * (1.0 + 0.8 * c.approach[:, :1]) @ compliance(rng)
    return body(m, c, 0, {3: lean[:, 0], 4: lean[:, 1]})


@dataclass(frozen=True)
class Part:
    """What can move in a case: its name in the list of effects, the index of the site, and the columns that it needs."""

    effect: str
    site: int | None  # of the commanded joints; None: a joint of the arm that gravity loads, -1: the arm
    shape: Shape
    needs: tuple[str, ...] = ("payload",)
    near: str = ""  # what of the list comes nearest, beside its own name: how this begins


PARTS = {
    "column": Part("cart_compliance", 0, column),
    "base": Part("bearing_compliance", 0, base),
    "settling": Part("bearing_compliance", 0, settling, ("payload", "time"), "tracker_drift@frame"),
    "bearing": Part("bearing_compliance", 1, bearing),
    "joint": Part("joint_compliance", None, joint),
    "rough": Part("unlisted_rough", -1, rough, (), "rack_periodic@j"),
    "sun": Part("unlisted_sun", 0, sun, ("time",), "tracker_drift@frame"),
    "hose": Part("unlisted_hose", None, hose, (), "cross_coupling@j"),
    "guide": Part("unlisted_guide", 0, guide, ("payload", "approach"), "bearing_compliance@column"),
}


def campaign(m: Arm, c: Campaign, rng: Generator) -> Campaign:
    """No forces on the tool; in half of the cases one payload."""
    payload = c.payload if rng.uniform() < 0.5 else np.full(len(c.q), rng.choice(c.payload))
    force = np.zeros_like(c.force)
    return replace(c, payload=payload, force=force, wrench=m.loads(c.q, payload, force)[1])


def instrument(m: Arm, rng: Generator) -> Tracker:
    sigma = round(float(np.exp(rng.uniform(np.log(2e-5), np.log(1e-4)))), 7)
    x, y, z = (float(v) for v in rng.uniform(-1.5, 1.5, 3))
    return Tracker(m.station, sigma, None, bool(rng.uniform() < 1 / 3), (x, y, z), bool(rng.uniform() < 5 / 6))


def moved(
    m: Arm, c: Campaign, absorption: Absorption, names: tuple[str, ...], sigma: float, rng: Generator
) -> list[tuple[str, str, Motion, float]]:
    """Effect, site, motion and energy of each of the parts that are named.

    The mean energy of the parts is 300 to 3000, or in a third of the cases so much that they leave 1 to 4 mm rms beside
    geometry; of two, each has a share of 0.2 or more. Rough joints have 0.1 to 2 times as much, at most 1.5 mm rms at the TCP.
    """
    large, energy, left = rng.uniform() < 1 / 3, float(rng.choice(ENERGIES)), float(rng.uniform(*LARGE))
    firm, first = [name for name in names if name != "rough"], rng.uniform(0.2, 0.8)
    asked = len(c.q) * (left / sigma) ** 2 if large else len(firm) * energy
    shares = dict(zip(firm, (first, 1.0 - first) if len(firm) > 1 else (1.0,), strict=False))
    result = []
    for name in names:
        part = PARTS[name]
        k = int(rng.integers(2, 4)) if part.site is None else part.site
        share = shares.get(name, rng.uniform(0.1, 2.0))
        largest = 0.05 if name != "rough" else 1.5e-3 * (1.0 if firm else rng.uniform())
        scaled, found = absorption.scaled(part.shape(m, c, k, rng), share * (asked if firm else 1e6), largest)
        result.append((part.effect, "arm" if k < 0 else m.sites[k], scaled, found))
    return result
