"""Compliance as springs: of rods; and, of robots without rods, of drives, of bearings, and of links that bend."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from gtpin.effects.active import ActiveEffect
from gtpin.effects.chain_motions import OWN_WEIGHT, beam, bending, joint_frame, target_at, tip_loads, torsion
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at
from gtpin.effects.smooth import loads_of
from gtpin.export.loss import conditions
from gtpin.extras.simulators.curves import STIFFEST, line
from gtpin.extras.simulators.mechanism import Body, Joint, Mechanism, Spring
from gtpin.kinematics.posture import home
from gtpin.model.model import Model
from gtpin.robot.chain import Chain, MovingLink
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats


def with_joint_springs(mechanism: Mechanism, model: Model) -> tuple[Mechanism, dict[str, Floats]]:
    """The mechanism of an open chain with its compliances as springs, fitted as linear in the loads at their conditions.

    A compliant drive is a joint ``JOINT_gives`` in series with the driven one; a compliant bearing is two hinges
    ``JOINT_tilts_a`` and ``_b`` before it, about its principal axes. A link of length l that bends and twists has its tip on
    a body ``LINK_tip`` with springs at the middle of the link. About that point, the compliance of an Euler-Bernoulli beam's
    tip is diagonal: f l for bending angles, f l^3 / 12 for shifts across, g l for torsion, with the flexibilities f in bending
    and g in torsion, 1/(N m^2).

    Returns the same as for :func:`~gtpin.extras.simulators.drives.with_drives`.
    """
    shown: dict[str, Floats] = {}
    if model.robot.constraints:
        return mechanism, shown
    flexible: dict[str, tuple[MovingLink, float, float]] = {}
    for active in model.effects:
        kind = active.effect.exported_as
        if kind == "joint_spring":
            mechanism, moved = _with_soft_drive(mechanism, model, active)
        elif kind == "bearing_springs":
            mechanism, moved = _with_soft_bearing(mechanism, model, active)
        elif kind == "link_spring":
            moved = _flexibilities(model, active, flexible)
        else:
            continue
        if moved is not None:
            shown[active.name] = moved
    for link, f, g in flexible.values():
        mechanism = _with_beam(mechanism, model, link, f, g)
    return mechanism, shown


def _with_soft_drive(mechanism: Mechanism, model: Model, active: ActiveEffect) -> tuple[Mechanism, Floats | None]:
    at = conditions(model, active)
    index = model.robot.sites.index(active.site)
    load = loads_of(at, active.site)[0][:, 0]
    command = active.basis(at).command
    assert command is not None
    compliance, rest = line(load, command[1] @ active.coefficients, float(active.coefficients[0]))
    if compliance <= STIFFEST:
        return mechanism, None
    driven = mechanism.joint(model.robot.actuators[index].joint)
    spring = Spring(1.0 / compliance, rest)
    gives = Joint(f"{active.site}_gives", driven.kind, driven.axis, driven.point, 0.0, spring=spring)
    moved = at.command_jacobian[:, :6, index] * (rest + compliance * load)[:, None]
    return mechanism.with_joints(driven.name, [driven, gives]), moved


def _with_soft_bearing(mechanism: Mechanism, model: Model, active: ActiveEffect) -> tuple[Mechanism, Floats | None]:
    at, here = conditions(model, active), _home(model)
    frame = joint_frame(at, active.site)
    # The axes about which the bearing tilts by moments about themselves alone, the first nearest to a; their compliances.
    (a, _, b, _, skew), turn = active.coefficients[:5], np.eye(2)
    if skew:
        turn = np.linalg.eigh([[a, skew], [skew, b]])[1]
        turn = turn[:, ::-1] if abs(turn[0, 1]) > abs(turn[0, 0]) else turn
        turn = turn * np.sign(turn.diagonal())
    across, tangents = turn.T @ frame.across, (turn.T @ np.array([[a, skew], [skew, b]]) @ turn).diagonal()
    moments = at.joint_loads[:, frame.index, 3:] @ across.T
    tilts = (active.basis(at).placements[0][1] @ active.coefficients)[:, 3:] @ across.T
    driven = mechanism.joint(model.robot.actuators[model.robot.sites.index(active.site)].joint)
    place = mechanism.placements()[mechanism.carrying(driven.name).name]
    twist, joints = np.zeros((len(at), 6)), []
    for k, tangent in enumerate(tangents):
        compliance, rest = line(moments[:, k], tilts[:, k], float(tangent))
        if compliance > STIFFEST:
            R, T = (x[0] for x in here.bodies.frame(frame.index))
            axis, point = place.rotation.T @ R @ across[k], place.actInv(T)
            spring = Spring(1.0 / compliance, rest)
            joints.append(Joint(f"{active.site}_tilts_{'ab'[k]}", "hinge", axis, point, 0.0, spring=spring))
            twist[:, 3:] += np.outer(rest + compliance * moments[:, k], across[k])
    if not joints:
        return mechanism, None
    mechanism = mechanism.with_joints(driven.name, [*joints, driven])
    return mechanism, at.bodies.by_twist(frame.index, twist[..., None])[:, :6, 0]


def _flexibilities(
    model: Model, active: ActiveEffect, flexible: dict[str, tuple[MovingLink, float, float]]
) -> Floats | None:
    """Add an effect's flexibilities in bending and torsion, 1/(N m^2), to those in ``flexible``, by link.

    Returns the (N, 6) motion of the TCP, m and rad, that these flexibilities represent; None if there is none.
    """
    at = conditions(model, active)
    twists = dict(active.basis(at).placements)
    total = np.zeros((len(at), 6))
    for link in links_at(model.robot, active.site):
        length, loads = beam(at, link), tip_loads(at, link)
        to_target = target_at(at, link.tip).inverse().action
        bent, twisted = (shape(length, loads) @ to_target.T for shape in (bending, torsion))
        g = max(float(active.coefficients[1]), 0.0)
        left = twists[link.tip] @ active.coefficients - active.coefficients[1] * twisted
        f = float((left * bent).sum() / max((bent**2).sum(), 1e-300))
        f = max(f if bent.any() else float(active.coefficients[0]), 0.0)
        _, old_f, old_g = flexible.get(link.name, (link, 0.0, 0.0))
        flexible[link.name] = (link, old_f + f, old_g + g)
        total += at.bodies.by_twist(link.tip, (f * bent + g * twisted)[..., None])[:, :6, 0]
    return total if total.any() else None


def _with_beam(mechanism: Mechanism, model: Model, link: MovingLink, f: float, g: float) -> Mechanism:
    """The mechanism with a link's tip, and the share ``OWN_WEIGHT`` of its mass, on springs at the link's middle."""
    here = _home(model)
    robot = model.robot
    along = beam(here, link)
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return mechanism
    R, T = (x[0] for x in here.bodies.frame(link.tip))
    tip = pin.SE3(R, T) * target_at(here, link.tip).inverse()
    u = along / length
    a, b = rotation_axes(u)[:2]
    compliances = (f * length**3 / 12.0,) * 2 + (f * length,) * 2 + (g * length,)
    joints = []
    for k, (axis, compliance) in enumerate(zip((a, b, a, b, u), compliances, strict=True)):
        if compliance > STIFFEST:
            own, spring = f"{link.name}_bends_{k + 1}", Spring(1.0 / compliance)
            joints.append(Joint(own, "slide" if k < 2 else "hinge", axis, -along / 2.0, 0.0, spring=spring))
    if not joints:
        return mechanism
    root = mechanism.carrying(str(robot.model.names[link.joint_id]))
    placements = mechanism.placements()
    to_tip = placements[root.name].inverse() * tip
    name, mass = f"{link.name}_tip", root.inertia.mass
    # The rest of the link's mass is placed so that its centre of mass stays the same: so do the loads of the joints before it.
    lever = (root.inertia.lever - OWN_WEIGHT * to_tip.translation) / (1.0 - OWN_WEIGHT)
    rest = pin.Inertia(mass * (1.0 - OWN_WEIGHT), lever, root.inertia.inertia * (1.0 - OWN_WEIGHT))
    point = pin.Inertia(mass * OWN_WEIGHT, np.zeros(3), root.inertia.inertia * OWN_WEIGHT)
    last, tcp = link.tip == robot.model.njoints - 1, model.robot.tcp_frame
    frames = {tcp: to_tip.inverse() * root.frames[tcp]} if last and tcp in root.frames else {}
    end = Body(name, root.name, to_tip, tuple(joints), point, frames=frames)
    bodies = []
    for body in mechanism.bodies:
        if body.name == root.name:
            kept = {n: placement for n, placement in body.frames.items() if n not in frames}
            bodies += [replace(body, inertia=rest, frames=kept), end]
        elif not last and str(robot.model.names[link.tip + 1]) in {joint.name for joint in body.joints}:
            bodies.append(replace(body, parent=name, placement=tip.inverse() * placements[body.name]))
        else:
            bodies.append(body)
    return replace(mechanism, bodies=tuple(bodies))


def _home(model: Model) -> OperatingPoints:
    """The robot at home."""
    return OperatingPoints(model.kinematics, model.robot.home_q[None], model.kinematics.home, {})


def with_link_springs(mechanism: Mechanism, model: Model, robot: Chain) -> tuple[Mechanism, dict[str, Floats]]:
    """Rods with the compliance of a model's ``link_compliance``, fitted as linear in the loads at its conditions.

    The rod's end on the carrier, with the part of the rod's mass that the carrier supports, slides along the rod on a spring.

    Returns ``mechanism``: the mechanism with an additional body ``LINK_end`` for each such link. ``shown``: by name, for
    each effect in it: the (N, 6) motion of the TCP, m and rad, at :func:`~gtpin.export.loss.conditions`.
    """
    active = [effect for effect in model.effects if effect.effect.exported_as == "link_spring"]
    if not active or robot.joint_sites:  # links of robots without rods bend: with_joint_springs
        return mechanism, {}
    conditions_of = {effect.name: conditions(model, effect) for effect in active}
    laws = {}  # by effect: (k,) compliances of the rods, m/N, and (k,) their stretch without a load, m
    for effect in active:
        at = conditions_of[effect.name]
        length = effect.basis(at).length
        assert length is not None
        rods = zip(at.force.T, (length @ effect.coefficients).T, strict=True)
        laws[effect.name] = np.transpose([line(force, own, 0.0) if own.any() else (0.0, 0.0) for force, own in rods])
    compliance, rest = np.sum(list(laws.values()), axis=0)
    soft, tcp = np.flatnonzero(compliance > STIFFEST), home(robot).tcp
    for i in soft:
        spring = Spring(1.0 / float(compliance[i]), float(rest[i]))
        mechanism = _sprung(mechanism, robot, tcp, robot.rod_sites[i], spring)
    rigid = {site for i, site in enumerate(robot.rod_sites) if i not in soft}
    held = [e for e in active if e.site not in rigid and not (e.site == "arm" and rigid)]
    shown = {}  # of rods that stretch by the rest and in proportion to their load
    for e in held:
        at, (compliance, rest) = conditions_of[e.name], laws[e.name]
        shown[e.name] = np.asarray(np.einsum("nik,nk->ni", at.response[:, :6], rest + compliance * at.force))
    return mechanism, shown


def _sprung(mechanism: Mechanism, robot: Chain, tcp: pin.SE3, site: str, spring: Spring) -> Mechanism:
    """A mechanism in which a rod's end slides along the rod on a spring. ``tcp``: the TCP's placement at home, base frame."""
    loop, rod_end, P = robot.rod_loops[site]
    end = mechanism.loops[loop][rod_end]
    placements = mechanism.placements()
    place = placements[end.body]
    along = place.act(end.point) - tcp.act(P)
    length = float(np.linalg.norm(along))
    axis = place.rotation.T @ along / length
    old = mechanism.body(end.body)
    # The part of the rod's mass whose weight the carrier bears is on the carrier's side of the spring. The spring then bears
    # the force at the rod's middle, as in the effect.
    beyond = float(np.clip(1.0 - (end.point - old.inertia.lever) @ axis / length, 0.0, 0.99))
    joint = Joint(f"{site}_stretch", "slide", axis, np.zeros(3), 0.0, spring=spring)
    sprung = mechanism.on_springs(f"{site}_end", [(loop, rod_end)], [joint])
    inertia = old.inertia
    near = pin.Inertia(inertia.mass * (1.0 - beyond), inertia.lever, inertia.inertia * (1.0 - beyond))
    far = pin.Inertia(inertia.mass * beyond, inertia.lever - end.point, inertia.inertia * beyond)
    bodies = tuple(
        replace(body, inertia={old.name: near, f"{site}_end": far}.get(body.name, body.inertia))
        for body in sprung.bodies
    )
    return replace(sprung, bodies=bodies)
