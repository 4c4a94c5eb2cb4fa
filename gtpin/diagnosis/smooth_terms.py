"""Smooth nonparametric terms at every site. Named causes are compared with them, and they localise an unknown cause.

What moves or changes, and of what it is a smooth function:

- a cart, or a joint of a robot without rods, in all directions: its own command, two commands, its command and load, time,
  temperature, load, direction of approach, or speed;
- the length of a link: its load, its direction, position, its cart's command, directions of approach, or speeds;
- all links together, the platform, or the frame: time, session, temperature, payload, position; not links: force at the TCP;
  not the frame: directions of approach, speeds;
- the length of all links by one strain, and the scale of what is measured, with a shift: time, session, temperature, payload;
- all carts together, along their tracks: all commands, or each cart in proportion to its own command;
- the tip of a moving link, in six directions: the load on it, time, temperature, session, directions of approach, or speeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from gtpin.diagnosis.hypothesis import SmoothTerm
from gtpin.diagnosis.priors import Priors
from gtpin.effects.chain_motions import joint_frame, lengthened, load_frame, of_joint, of_tips
from gtpin.effects.displacement import Displacement, along_track, of_lengths, rods_of
from gtpin.effects.joints import loaded
from gtpin.effects.measurement import over_time
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import guided, links_at, turning_joint
from gtpin.effects.smooth import (
    cosines,
    drive_load,
    drive_sizes,
    frame_twist,
    session_columns,
    smooth_cosines,
    smooth_orders,
    target_twist,
    wave,
)
from gtpin.robot.chain import MovingLink
from gtpin.typing import Floats

Terms = Iterator[tuple[SmoothTerm, Displacement]]
Functions = Iterator[tuple[tuple[str, ...], Floats, Floats]]
"""Coordinates, functions (N, m) of them, and the functions' sizes (m,)."""
CONDITIONS = ("time", "temp_frame", "temp_link", "payload")
ORDERS = {2: 5, 3: 4}
"""Largest sum of the orders in a product of cosines of all commands, by the number of actuators; with other numbers, 1."""
DECAY = 1.5
"""The typical size of such a product is proportional to (sum of its orders)^-DECAY."""
ROUGH, ROUGH_ASIDE = 40, 28
"""Half waves of a rough function over an actuator's travel, along and across it; its sizes fall with 1/k, as those of a
Gaussian process with the exponential kernel (Rasmussen and Williams 2006, section 4.2). Assumed: more than the 20 of the smooth
effects over the travel, so that an error that is rougher than these (a pit) is not taken for one of them."""
LOADED = 20
"""Half waves of a deviation along an actuator's travel that grows with the load. Assumed: those of the smooth effects."""
COMMON = ("field", "scale")
"""``SmoothTerm.motion`` of terms of all carts: they belong to no single site, and count in no site's share of the gap."""


def smooth_terms(at: OperatingPoints, priors: Priors, scaled: bool = True) -> Terms:
    """Every smooth term that these data can show, and its displacements.

    ``scaled``: whether a testable effect scales all measured positions; the common motion ``scale`` is then left out.
    """
    yield from _of_carts(at, priors)
    yield from _of_links(at, priors)
    yield from _of_platform_and_frame(at, priors)
    yield from _of_all_carts(at, priors, scaled)


def _of_carts(at: OperatingPoints, priors: Priors) -> Terms:
    """Motions of what each actuator moves: along its track or about its axis, and all others."""
    for j, site in enumerate(at.robot.sites):
        own = at.travel[:, j]
        across = [(f"q{j + 1}", f"q{k + 1}", k) for k in range(at.robot.n_actuators) if k != j]
        along: list[tuple[tuple[str, ...], Floats, Floats]] = [((f"q{j + 1}",), *smooth_cosines(at, j, ROUGH, 1.0))]
        along += [((a, b), *_plane(own, at.travel[:, k], 5)) for a, b, k in across]
        if loaded(at, site):  # an error that grows with the load: a wheel that is pressed into its teeth
            waves, size = smooth_cosines(at, j, LOADED, 1.0)
            pressed = np.clip(drive_load(at, site) / 2.0, -1.5, 1.5)[:, None] * waves
            along.append(
                (
                    (f"q{j + 1}", "load"),
                    np.hstack([waves, pressed]),
                    np.concatenate([size, priors.smooth_change * size]),
                )
            )
        for over, waves, size in (*along, *_conditions(at), *_load(at, j, 4), *_moves(at, j, 3)):
            yield (
                SmoothTerm(site, over, "along"),
                along_track(at, site, waves, drive_sizes(at, site, size, priors.smooth_shift)),
            )
        if turning_joint(at.robot, site):
            # Many lines of a gear can follow a rough function that has no period: it competes with them.
            waves, size = cosines(own, 1, ROUGH, 1.0)
            rough = along_track(at, site, waves, drive_sizes(at, site, size, priors.smooth_shift))
            yield SmoothTerm(site, (f"q{j + 1}",), "rough"), rough
        for over, waves, size in _aside_coordinates(at, j, priors) if site in guided(at.robot) else ():
            yield SmoothTerm(site, over, "aside"), _aside(at, site, waves, size, priors)


def _aside(at: OperatingPoints, site: str, waves: Floats, size: Floats, priors: Priors) -> Displacement:
    """All motions of what an actuator carries but its own: two shifts and two rotations across its axis, then a shift along an
    axis that turns, or a rotation about a track. Shifts across alone where rotations move nothing, at a cart's only joint."""
    frame, turning = joint_frame(at, site), at.robot.actuators[at.robot.sites.index(site)].revolute
    ways = np.zeros((6, 5))
    ways[:3, :2] = ways[3:, 2:4] = frame.across.T
    ways[slice(0, 3) if turning else slice(3, 6), 4] = frame.axis
    sizes = [
        *[priors.smooth_shift] * 2,
        *[priors.smooth_turn] * 2,
        priors.smooth_shift if turning else priors.smooth_turn,
    ]
    w = 5 if frame.turns else 2
    columns = np.broadcast_to(waves[:, None, :], (len(at), w, waves.shape[1]))
    return of_joint(at, site, ways[:, :w], columns, np.outer(sizes[:w], size).ravel())


def _of_links(at: OperatingPoints, priors: Priors) -> Terms:
    """Changes of each link over its own coordinates, and of all links with the same functions and coefficients of their own.

    A rod changes its length. The tip of another link shifts and turns relative to its root.
    """
    rods = at.robot.rod_sites
    motion, names = ("length", rods) if rods else ("tip", tuple(link.name for link in links_at(at.robot, "arm")))
    for k, name in enumerate(names):
        own = _of_rod(at, k, priors) if rods else (*_loads(at, links_at(at.robot, name)[0]), *_approach(at))
        for over, waves, size in (*own, *_conditions(at)):
            yield SmoothTerm(name, over, motion), _changed(at, name, [waves], size, priors)
    for over, waves, size in (*_conditions(at), *_position(at, 2, priors), *_approach(at)):
        own_columns = [np.kron(waves, one) for one in np.eye(len(names))]
        yield SmoothTerm("arm", over, motion), _changed(at, "arm", own_columns, np.repeat(size, len(names)), priors)
    for over, waves, size in _conditions(at):  # one strain of all
        strain = np.repeat(waves[:, None], len(names), axis=1)
        yield SmoothTerm("arm", over, "growth"), lengthened(at, "arm", strain, priors.smooth_strain * size)


def _of_rod(at: OperatingPoints, i: int, priors: Priors) -> Functions:
    """Functions of a rod's force and direction, of the position of the TCP (a bracket touches the rod where several carts come
    together), and of directions of approach, also multiplied by force and direction."""
    yield from _position(at, 2, priors)
    j = at.robot.rod_carriers[i]
    if j is not None and len(at.robot.rods_on(j)) > 1:  # of a cart with one rod, its motion along the track is the same
        yield (f"q{j + 1}",), *smooth_cosines(at, j, ROUGH, 1.0)
    load, size = _of_load(at.load[:, i], 5)
    a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
    parts = [cosines(a, 1, 4, 1.0), cosines(b, 1, 4, 1.0), _plane(a, b, 5)]
    yield ("load",), np.hstack([load, np.sign(at.force[:, [i]])]), np.append(size, 1.0)
    yield ("direction",), np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    if (every := all_moves(at)) is not None:
        both = np.hstack([every, every * a[:, None], every * b[:, None], every * load[:, :1]])
        yield ("approach",), both, np.full(both.shape[1], 0.5)


def _changed(at: OperatingPoints, site: str, waves: Sequence[Floats], size: Floats, priors: Priors) -> Displacement:
    """Changes of a site's links; ``waves`` has the functions (N, m) of each: of a rod's length, or six motions of a tip."""
    if rods := rods_of(at, site):
        return of_lengths(at, rods, np.stack(waves, axis=1), priors.smooth_shift * size)
    scale = np.array([priors.smooth_shift] * 3 + [priors.smooth_turn] * 3)
    twists = [np.einsum("ij,nm->nijm", np.eye(6), w).reshape(len(at), 6, -1) for w in waves]
    return of_tips(at, site, twists, np.outer(scale, size).ravel())


def _of_platform_and_frame(at: OperatingPoints, priors: Priors) -> Terms:
    """Motions of the target and tool on the platform, TCP frame, and of the measurement frame."""
    for over, waves, size in (*_conditions(at), *_force(at), *_position(at, 2, priors), *_approach(at)):
        twist = target_twist(at)[:, :, :, None] * waves[:, None, None, :]
        sigma = np.concatenate([np.full(3, priors.smooth_shift), np.full(3, priors.smooth_turn)])[:, None] * size
        yield SmoothTerm("platform", over, "twist"), Displacement(sigma.ravel(), twist=twist.reshape(len(at), 6, -1))
    freedoms, size6 = frame_twist(at)
    for over, waves, size in (*_conditions(at), *_force(at)):
        columns = np.concatenate([freedoms * wave[:, None, None] for wave in waves.T], axis=2)
        yield SmoothTerm("frame", over, "twist"), Displacement(np.concatenate([size6 * s for s in size]), twist=columns)
    from_home = at.poses.T - at.kinematics.home.T[0]
    # The scale of what is measured: positions about home, and home about the instrument, whose place is not used.
    ways = np.concatenate([from_home[:, :, None], np.tile(np.eye(3), (len(at), 1, 1))], axis=2)
    size4 = priors.smooth_strain * np.array([1.0, *[priors.smooth_distance] * 3])
    for over, waves, size in _conditions(at):
        twist = np.zeros((len(at), 6, 4 * waves.shape[1]))
        twist[:, :3] = np.concatenate([ways * wave[:, None, None] for wave in waves.T], axis=2)
        yield SmoothTerm("frame", over, "stretch"), Displacement(np.concatenate([size4 * s for s in size]), twist=twist)
    for over, waves, size in _position(at, 3, priors):
        twist = np.zeros((len(at), 6, 3, waves.shape[1]))
        twist[:, :3] = np.eye(3)[None, :, :, None] * waves[:, None, None, :]
        sigma = np.tile(priors.smooth_shift * size, 3)
        yield SmoothTerm("frame", over, "shift"), Displacement(sigma, twist=twist.reshape(len(at), 6, -1))


def _of_all_carts(at: OperatingPoints, priors: Priors, scaled: bool) -> Terms:
    """Motions of all carts along their tracks, as by a deformation of the machine: of all commands, and of each cart's own."""
    n = at.robot.n_actuators
    if n < 2:
        return
    most = ORDERS.get(n, 1)
    # Of n actuators, few of the (most + 1)^n rows of orders have so small a sum: with a sum of 1 they are the unit vectors.
    rows = product(range(most + 1), repeat=n) if n in ORDERS else (tuple(row) for row in np.eye(n, dtype=int)[::-1])
    orders = [row for row in rows if 0 < sum(row) <= most]
    waves = [np.prod([wave(at.travel[:, k], o) for k, o in enumerate(row) if o], axis=0) for row in orders]
    size = np.array([float(sum(row)) for row in orders]) ** -DECAY
    functions = {"field": (np.stack(waves, axis=1), 1.5 * size / np.linalg.norm(size))}
    if not scaled:
        functions["scale"] = np.zeros((len(at), 0)), np.zeros(0)
    for motion, (columns, size) in functions.items():
        total: list[Floats] = []
        sizes: list[Floats] = []
        for j, site in enumerate(at.robot.sites):
            own = at.travel[:, [j]]
            along = along_track(at, site, np.hstack([columns, own, own**2]), np.ones(columns.shape[1] + 2))
            total.append(along.displacement(at))
            sizes.append(drive_sizes(at, site, np.concatenate([size, [1.0, 0.2]]), priors.smooth_shift))
        basis = Displacement(np.concatenate(sizes), twist=np.concatenate(total, axis=2))
        yield SmoothTerm("frame", ("position",), motion), basis


def _aside_coordinates(at: OperatingPoints, j: int, priors: Priors) -> Functions:
    """Functions of the coordinates on which the motion of actuator j across its track or axis may depend."""
    yield (f"q{j + 1}",), *cosines(at.travel[:, j], 1, smooth_orders(at, j, ROUGH_ASIDE), 1.0)
    for over, waves, size in _conditions(at):
        if over != ("session",):  # also times the place along the track, and a bend, which has a constant part too
            some, s = waves[:, :4], size[:4]
            bend = np.hstack([np.ones((len(at), 1)), some]) * wave(at.travel[:, [j]], 2)
            waves = np.hstack([some, some * at.travel[:, [j]], bend])
            size = np.concatenate([s, priors.smooth_change * np.concatenate([s, [np.linalg.norm(s)], s])])
        yield over, waves, size
    yield from _load(at, j, 3)
    yield from _moves(at, j, 2)


def _load(at: OperatingPoints, j: int, orders: int) -> Functions:
    """Functions of the load along an actuator's track or about its axis."""
    site = at.robot.sites[j]
    if loaded(at, site):
        yield ("load",), *_of_load(drive_load(at, site), orders)


def _of_load(load: Floats, orders: int) -> tuple[Floats, Floats]:
    """Functions of a load (N,) in units of its spread."""
    return _with_line(load / 2.0, *cosines(np.clip(load / 2.0, -1.5, 1.5), 1, orders, 1.0))


def _with_line(x: Floats, waves: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Functions of x (N,), and x itself: what grows with a load or a temperature is no sum of a few cosines, whose slopes
    vanish at the ends."""
    return np.column_stack([x, waves]), np.append(1.0, size)


def _loads(at: OperatingPoints, link: MovingLink) -> Functions:
    """Functions of the six components of the load at a link's tip, for those that vary; at its root if its tip is in a loop."""
    index = load_frame(at.robot, link)
    mean, spread = (values[index] for values in at.references.joints)
    loads = at.joint_loads[:, index]
    varying = np.flatnonzero(loads.std(axis=0) > 1e-6 * spread)
    parts = [_of_load((loads[:, c] - mean[c]) / spread[c], 3) for c in varying]
    if parts:
        yield ("load",), np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def _moves(at: OperatingPoints, j: int, orders: int) -> Functions:
    """Functions of an actuator's direction of approach and of its speed, also multiplied by cosines along its track."""
    bends = [np.ones(len(at)), *(wave(at.travel[:, j], o) for o in range(1, orders + 1))]
    for word in ("approach", "speed"):
        if at.varies(f"{word}{j + 1}"):
            x = _scaled(at.covariate(f"{word}{j + 1}"))
            shapes = [x] if word == "approach" else [x, np.abs(x), x * np.abs(x)]
            columns = [shape * bend for shape in shapes for bend in bends]
            yield (f"{word}{j + 1}",), np.stack(columns, axis=1), np.full(len(columns), 0.5)


def all_moves(at: OperatingPoints) -> Floats | None:
    """(N, m) direction of approach and speed of every actuator, each over its largest absolute value, for those that vary."""
    names = [f"{word}{k + 1}" for word in ("approach", "speed") for k in range(at.robot.n_actuators)]
    columns = [_scaled(at.covariate(name)) for name in names if at.varies(name)]
    return np.stack(columns, axis=1) if columns else None


def _approach(at: OperatingPoints) -> Functions:
    moves = all_moves(at)
    if moves is not None:
        yield ("approach",), moves, np.full(moves.shape[1], 0.5)


def _scaled(values: Floats) -> Floats:
    return np.asarray(values / max(float(np.abs(values).max()), 1e-12))


def _conditions(at: OperatingPoints) -> Functions:
    """Functions of time, temperatures, payload and sessions, for those that vary."""
    for name in CONDITIONS:
        if at.varies(name):
            x = _over_range(at.covariate(name))
            yield (name,), *(over_time(x) if name == "time" else _with_line(x, *cosines(x, 1, 3, 1.0)))
    if at.varies("session"):
        sessions = session_columns(at)
        yield ("session",), sessions, np.ones(sessions.shape[1])


def _over_range(values: Floats) -> Floats:
    """(N,) a covariate over its range, from -1 to 1."""
    middle, half = (values.max() + values.min()) / 2.0, np.ptp(values) / 2.0
    return np.asarray((values - middle) / half)


def _force(at: OperatingPoints) -> Functions:
    """Functions of the three components of the force at the TCP, for those that vary."""
    over = [_over_range(at.covariate(name)) for name in ("fx", "fy", "fz") if at.varies(name)]
    parts = [_with_line(x, *cosines(x, 1, 3, 1.0)) for x in over]
    if parts:
        yield ("force",), np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def _plane(a: Floats, b: Floats, orders: int) -> tuple[Floats, Floats]:
    """Functions of two coordinates (N,) together, and of the second alone, and their sizes."""
    rows = [(m, n) for m in range(orders) for n in range(1, orders + 1 - m)]
    sizes = np.array([1.0 / (m + n) for m, n in rows])
    return np.stack([wave(a, m) * wave(b, n) for m, n in rows], axis=1), sizes / np.linalg.norm(sizes) * 2.0


def _position(at: OperatingPoints, orders: int, priors: Priors) -> Functions:
    """Smooth functions of the TCP's position."""
    T = at.poses.T
    reach = priors.smooth_reach * max(float(np.ptp(T, axis=0).max()) / 2.0, 1e-9)
    middle = (T.max(axis=0) + T.min(axis=0)) / 2.0 if at.robot.joint_sites else at.kinematics.home.T[0]
    x = np.clip((T - middle) / reach, -1.5, 1.5)
    rows = [row for row in product(range(orders + 1), repeat=3) if 0 < sum(row) <= orders]
    columns = [wave(x[:, 0], a) * wave(x[:, 1], b) * wave(x[:, 2], c) for a, b, c in rows]
    sizes = np.array([1.0 / sum(row) for row in rows])
    yield ("position",), np.stack(columns, axis=1), sizes / np.linalg.norm(sizes) * 2.0
