"""Compliance of carts as springs; error motions of carts across their tracks as coupled joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.effects.active import ActiveEffect
from gtpin.effects.chain_motions import cart_load, of_body, of_carried
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number, sliding_actuators
from gtpin.effects.smooth import approach
from gtpin.export.loss import by_effect, conditions, rms
from gtpin.extras.simulators.curves import NOTHING, SAME, STIFFEST, WORTH, DriveCurve, fitted, line
from gtpin.extras.simulators.mechanism import Coupling, Guide, Joint, Mechanism, Spring, shaft
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

PLACES = 4
"""Number of half waves along the track: as many as ``cart_compliance`` has."""
FREE = 0.2
"""Part of the load's standard deviation that must not follow from the place on the track. With less, one fit can't separate the
compliance from the curve over the place."""
WORTHWHILE = 2e-7
"""Root mean square, m or rad, below which a part of the deflection is dropped."""
NAMES = ("along", "across_a", "across_b", "roll", "tip_a", "tip_b")
"""Names of a cart's shifts along, and turns about, the axes of :func:`_axes`."""
STRAIGHT = 1e-9
"""Smallest error motion of a cart, m or rad, that gets a joint."""


@dataclass(frozen=True)
class Give:
    """The deflection, m or rad: compliance * load + place(q) + slip * direction of approach.

    ``compliance`` in m/N or rad/(N m); ``place``: a curve over the cart's command; ``slip`` in m or rad.
    """

    compliance: float
    place: DriveCurve
    slip: float

    def at(self, load: Floats, q: Floats, approach: Floats) -> Floats:
        """(N,) deflection, m or rad, under loads (N,), N or N m, at commands (N,), from directions of approach (N,), +1 or
        -1."""
        return np.asarray(self.compliance * load + self.place(q) + self.slip * approach)


def give(load: Floats, moved: Floats, tangent: float, q: Floats, ends: tuple[float, float], approach: Floats) -> Give:
    """The law fitted by least squares to deflections ``moved`` (N,) under loads, at commands, from directions of approach (N,).

    Where the load follows from the place on the track, the compliance is fitted first and alone. Otherwise the curve over the
    place could take over a part of it. ``tangent`` is the compliance to use where the load does not vary; ``ends``: the range
    of the cart's commands.
    """
    compliance, rest = line(load, moved, tangent)
    simple = Give(compliance, DriveCurve(rest, 0.0), 0.0)
    place = fitted(q, load, ends, slope=False, count=PLACES)
    own = load - place(q)
    if np.std(own) > FREE * np.std(load):
        # The load without its fit by place and approach: the slope over it is the compliance of a fit of all three together.
        own = own - approach * float(own @ approach) / max(float(approach @ approach), 1.0)
        compliance = float(own @ moved) / float(own @ own)
    left = moved - compliance * load
    slip = float(left @ approach) / max(float(approach @ approach), 1.0)
    curve = fitted(q, left - slip * approach, ends, slope=False, count=PLACES)
    if abs(slip) < WORTHWHILE:
        slip = 0.0
    if np.std(curve(q)) < WORTHWHILE:
        curve = replace(curve, offset=float(np.mean(left)), harmonics=())
    full = Give(compliance, curve, slip)
    off, before = (np.std(law.at(load, q, approach) - moved) for law in (full, simple))
    return full if off + WORTHWHILE < before else simple


def with_cart_springs(mechanism: Mechanism, model: Model, robot: Chain) -> tuple[Mechanism, dict[str, Floats]]:
    """Carts with the compliance of a model's ``cart_compliance``, fitted as linear in the loads at its conditions.

    The rods' joints of such a cart are on a massless body ``CART_seat``. It has springs along, and about, the track and the two
    axes across it. The rest positions of the springs compensate the weight of the rods on the cart, which is not in the effect.
    On a body ``CART_strays`` between them and the rods is a joint for each spring whose deflection depends on the place on the
    track; it follows the actuator's joint. On a body ``CART_slips`` is a joint for each spring with friction; it follows the
    joint ``CART_slip``, which has a play. Returns the same as :func:`~gtpin.extras.simulators.drives.with_drives`.
    """
    shown: dict[str, Floats] = {}
    for active in model.effects:
        if active.effect.exported_as != "cart_springs" or active.site not in sliding_actuators(robot):
            continue
        at, axes, index = conditions(model, active), _axes(robot, active.site), robot.sites.index(active.site)
        moved, came = _motion(active, at, axes), approach(at, index)
        loads = np.hstack([load @ axes.T for load in cart_load(at, active.site)])
        q, ends = at.q[:, index], (float(robot.lower[index]), float(robot.upper[index]))
        found = active.effect.parameters(active.coefficients, active.shape_parameter)
        tangents = [found[name][0] if name in found else 0.0 for name in NAMES]  # the compliances at the usual load
        laws = {k: give(loads[:, k], moved[:, k], tangent, q, ends, came) for k, tangent in enumerate(tangents)}
        laws = {k: law for k, law in laws.items() if law.compliance > STIFFEST}
        if laws:
            weight = _weight(mechanism, robot, active.site, axes)
            mechanism = _seated(mechanism, robot, active.site, axes, laws, weight, float(np.abs(loads).max()))
            held = np.zeros_like(moved)
            for k, law in laws.items():
                held[:, k] = law.at(loads[:, k], q, came)
            shown[active.name] = _at_tcp(at, active.site, axes, held)
    return mechanism, shown


def _seated(
    mechanism: Mechanism, robot: Chain, site: str, axes: Floats, laws: Mapping[int, Give], weight: Floats, load: float
) -> Mechanism:
    """The mechanism with the rods' joints of a cart on springs.

    ``axes``: (3, 3) as :func:`_axes`. ``laws``: the law of deflection by number of the axis, as in ``NAMES``. ``weight``:
    (6,) force, N, and moment, N m, on the springs that the loads of the laws do not contain. ``load``: largest load, N or N
    m, at which friction must hold.
    """
    driven, name = mechanism.joint(robot.actuators[robot.sites.index(site)].joint), f"{site}_slip"
    springs, strays, slips, couplings = [], [], [], []
    most = max(abs(law.slip) for law in laws.values())
    for k, law in laws.items():
        rest = law.place.offset - law.compliance * float(weight[k])
        springs.append(_joint(mechanism, robot, site, f"{NAMES[k]}_gives", k, axes, Spring(1.0 / law.compliance, rest)))
        if law.place.harmonics:
            strays.append(_joint(mechanism, robot, site, f"{NAMES[k]}_strays", k, axes, None))
            couplings.append(Coupling(strays[-1].name, driven.name, replace(law.place, offset=0.0).about(driven.home)))
        if law.slip:
            slips.append(_joint(mechanism, robot, site, f"{NAMES[k]}_slips", k, axes, None))
            # The joint with play lags behind the cart: its coordinate is negative if the cart came from below.
            couplings.append(Coupling(slips[-1].name, name, SAME.times(-law.slip / most)))
    # MuJoCo allows at most six joints per body.
    for body, joints in (("seat", springs), ("strays", strays), ("slips", slips)):
        if joints:
            mechanism = mechanism.on_springs(f"{site}_{body}", _ends(robot, site), joints)
    mechanism = mechanism.with_couplings(couplings)
    if not most:
        return mechanism
    slip = Joint(name, "hinge", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, -most, most, play=True)
    guide = Guide(site, (driven.name, name), load)
    bodies = (*mechanism.bodies, shaft(mechanism.bodies[0], slip))
    return replace(mechanism, bodies=bodies, guides=(*mechanism.guides, guide))


def with_guideways(mechanism: Mechanism, model: Model, robot: Chain) -> tuple[Mechanism, dict[str, Floats]]:
    """Carts that shift across, and rotate along, their tracks (``straightness``, ``cart_rotation``).

    The rods' joints of such a cart are on a massless body ``CART_led``, whose joints follow the actuator's joint by curves. If
    these curves miss more than ``WORTH`` of an effect's motion of the TCP, the effect is left out. Returns the same as
    :func:`~gtpin.extras.simulators.drives.with_drives`.
    """
    shown: dict[str, Floats] = {}
    for site in sliding_actuators(robot):
        index, axes = robot.sites.index(site), _axes(robot, site)
        total = [NOTHING] * 6
        ends = float(robot.lower[index]), float(robot.upper[index])
        for active in model.effects:
            if active.site != site or set(active.effect.coordinates(robot, site)) != {f"q{number(robot, site)}"}:
                continue
            at = conditions(model, active)
            if not active.basis(at).placements:
                continue
            q = at.q[:, index]
            curves = [fitted(q, moved, ends) for moved in _motion(active, at, axes).T]
            moved = _at_tcp(at, site, axes, np.column_stack([curve(q) for curve in curves]))
            whole = by_effect(active, at)
            if rms(whole - moved) <= WORTH * rms(whole):
                shown[active.name] = moved
                total = [old.plus(new) for old, new in zip(total, curves, strict=True)]
        mechanism = _led(mechanism, robot, site, axes, total)
    return mechanism, shown


def _led(mechanism: Mechanism, robot: Chain, site: str, axes: Floats, total: Sequence[DriveCurve]) -> Mechanism:
    index = robot.sites.index(site)
    there = np.linspace(robot.lower[index], robot.upper[index], 101)
    joints, couplings = [], []
    driven = mechanism.joint(robot.actuators[index].joint)
    for k, curve in enumerate(total):
        if np.abs(curve(there)).max() > STRAIGHT:
            # The loops of the file are closed at home without error motions: the joint is at zero in the file, and the
            # constraint of its coupling moves it to the curve's value.
            joint = _joint(mechanism, robot, site, f"{NAMES[k]}_led", k, axes, None)
            joints.append(joint)
            couplings.append(Coupling(joint.name, driven.name, curve.about(driven.home)))
    if not joints:
        return mechanism
    led = mechanism.on_springs(f"{site}_led", _ends(robot, site), joints)
    return led.with_couplings(couplings)


def _axes(robot: Chain, site: str) -> Floats:
    """(3, 3) rows: unit vectors along the track, and a and b across it, base frame."""
    return np.asarray(np.roll(rotation_axes(robot.actuators[robot.sites.index(site)].axis), 1, axis=0))


def _ends(robot: Chain, site: str) -> list[tuple[str, int]]:
    """The loops of a cart's rods, each with its end on the cart: name, 0 or 1."""
    return robot.attachments(robot.sites.index(site))


def _joint(
    mechanism: Mechanism, robot: Chain, site: str, name: str, k: int, axes: Floats, spring: Spring | None
) -> Joint:
    """A new joint along (k < 3) or about an axis of the cart, for the body that will carry the rods' joints."""
    loop, side = _ends(robot, site)[0]
    place = mechanism.placements()[mechanism.loops[loop][side].body]
    axis = place.rotation.T @ axes[k % 3]
    return Joint(f"{site}_{name}", "slide" if k < 3 else "hinge", axis, np.zeros(3), 0.0, spring=spring)


def _motion(active: ActiveEffect, at: OperatingPoints, axes: Floats) -> Floats:
    """(N, 6) motion of a cart by an effect: shift of the mean of its rods' joints, m, and turn about it, rad, in the cart's
    axes."""
    moved = of_carried(at, active.site, active.basis(at)) @ active.coefficients
    return np.hstack([moved[:, :3] @ axes.T, moved[:, 3:] @ axes.T])


def _at_tcp(at: OperatingPoints, site: str, axes: Floats, motion: Floats) -> Floats:
    """(N, 6) motion of the TCP, m and rad, base frame, by a motion (N, 6) of a cart in its axes, to first order."""
    twist = np.hstack([motion[:, :3] @ axes, motion[:, 3:] @ axes])
    return of_body(at, site, twist[..., None], np.ones(1)).displacement(at)[:, :6, 0]


def _weight(mechanism: Mechanism, robot: Chain, site: str, axes: Floats) -> Floats:
    """(6,) force, N, and moment, N m, in the cart's axes, of the part of the rods' weight that the cart carries."""
    places = mechanism.placements()
    seats, weights = [], []
    for loop, side in _ends(robot, site):
        end, seat = mechanism.loops[loop][1 - side], mechanism.loops[loop][side]
        body = mechanism.body(end.body)
        share = float(body.inertia.lever @ end.point) / float(end.point @ end.point)
        weights.append(body.inertia.mass * np.clip(share, 0.0, 1.0) * np.array(mechanism.gravity))
        seats.append(places[seat.body].act(seat.point))
    lever = np.array(seats) - np.mean(seats, axis=0)
    moment = np.cross(lever, weights).sum(axis=0)
    return np.concatenate([axes @ np.sum(weights, axis=0), axes @ moment])
