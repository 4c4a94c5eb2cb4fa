"""An arm on a telescope on a movable base, by NumPy alone: products of transforms, statics, and a column that is integrated.

Nothing of gtpin or Pinocchio is used, and no basis of theirs: the column is a chain of short pieces that bend one after the
other, the base turns about a skewed line, and what is in no list is a rough error of each joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

Floats = np.ndarray
H = np.pi / 2.0
OFFSETS = (
    (0.0, 0.0, 0.45, 0.0),
    (0.08, 0.0, 0.20, 0.0),
    (0.0, 0.0, 0.16, H),
    (-0.46, 0.0, 0.0, 0.0),
    (-0.41, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.13, H),
    (0.0, 0.0, 0.10, -H),
    (0.0, 0.0, 0.16, 0.0),
)
"""Placement of the slider, of six joints, and of the tool, each in the frame before: x, y, z, m, and roll, rad."""
MASSES = (9.0, 6.5, 9.5, 3.5, 1.8, 1.6, 2.2)
"""Of the slider and of the six links, kg."""
CENTRES = (
    (0.03, 0.01, 0.05),
    (0.0, -0.01, 0.06),
    (-0.2, 0.0, 0.12),
    (-0.2, 0.0, 0.03),
    (0.0, -0.02, 0.09),
    (0.0, 0.02, 0.08),
    (0.0, 0.0, 0.06),
)
TRAVEL = ((0.0, 0.8), (-2.8, 2.8), (-2.4, -0.5), (-2.0, 2.0), (-2.2, 1.6), (-2.2, 2.2), (-2.8, 2.8))
NAMES = ("lift", "pan", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
GRAVITY = np.array([0.0, 0.0, -9.81])
PIECES = 24
"""Pieces of the column."""
ROOT = 0.45
"""Height of the column's foot below the slider at the lower end of its travel, m."""
TOLERANCE = 3.5e-4
"""Standard deviation of the errors of the placements, m and rad."""


@dataclass(frozen=True)
class Machine:
    """What moves: K (2, 2) tilts of the base per moment about x and y, rad/(N m), which grow by the share ``settles`` until the
    last pose; S (2, 2) curvatures of the column per moment, 1/(N m^2); ``rough``: size of each joint's own error, rad; T (2, 2)
    tilts of the bearing between slider and arm per moment about x and y of the slider, rad/(N m)."""

    base: Floats
    column: Floats
    settles: float = 0.0
    rough: float = 0.0
    bearing: Floats | None = None


@dataclass(frozen=True)
class Measured:
    """Commands (N, 7), positions (N, 3), m, time (N,), s, the noise's sigma, m, and the root mean squares at the TCP, m, that
    the geometry leaves of each part alone: ``base``, ``column``, ``rough``, ``all``."""

    q: Floats
    position: Floats
    time: Floats
    sigma: float
    left: dict[str, float]


def urdf() -> str:
    """The machine as its maker describes it: rigid, with masses."""
    lines = ['<robot name="arm_on_telescope">', '  <link name="base"/>']
    links = ["base", "carriage", *(f"link{k}" for k in range(1, 7)), "tool"]
    for k, (mass, c) in enumerate(zip(MASSES, CENTRES, strict=True)):
        ball = 0.4 * mass * 0.07**2
        lines += [
            f'  <link name="{links[k + 1]}"><inertial><origin xyz="{c[0]} {c[1]} {c[2]}"/><mass value="{mass}"/>',
            f'    <inertia ixx="{ball:.6g}" ixy="0" ixz="0" iyy="{ball:.6g}" iyz="0" izz="{ball:.6g}"/></inertial></link>',
        ]
    lines.append('  <link name="tool"/>')
    for k, (x, y, z, roll) in enumerate(OFFSETS):
        last = k == len(MASSES)
        kind = "fixed" if last else "prismatic" if k == 0 else "revolute"
        name = "flange" if last else NAMES[k]
        lines.append(f'  <joint name="{name}" type="{kind}"><parent link="{links[k]}"/><child link="{links[k + 1]}"/>')
        lines.append(f'    <origin xyz="{x} {y} {z}" rpy="{roll!r} 0 0"/>')
        if not last:
            low, high = TRAVEL[k]
            lines.append(f'    <axis xyz="0 0 1"/><limit lower="{low}" upper="{high}" effort="900" velocity="1"/>')
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>"]) + "\n"


def turned(rotation: Floats) -> Floats:
    """(N, 3, 3) rotation matrices of rotation vectors (N, 3), by Rodrigues' formula."""
    angle = np.linalg.norm(rotation, axis=1)[:, None, None]
    x, y, z = rotation.T
    none = np.zeros_like(x)
    K = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=1).reshape(-1, 3, 3)
    safe = np.maximum(angle, 1e-12)
    return np.eye(3) + np.sin(angle) / safe * K + (1.0 - np.cos(angle)) / safe**2 * (K @ K)


def frames(
    q: Floats, errors: Floats, carrier: tuple[Floats, Floats] | None = None, leaning: Floats | None = None
) -> list[tuple[Floats, Floats]]:
    """(N, 3, 3) and (N, 3) of the slider, of the six links, and of the tool. ``errors``: (8, 6) of the placements, in their own
    axes. ``carrier``: rotation and shift of the slider, base frame, about its own origin. ``leaning``: (N, 3) rad, of the arm
    about the origin of its first joint."""
    R, p = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
    found = []
    for k, (x, y, z, roll) in enumerate(OFFSETS):
        own = turned(np.array([[roll, 0.0, 0.0]]))[0]
        p = p + R @ np.array([x, y, z]) + R @ own @ errors[k, :3]
        R = R @ own @ turned(errors[k : k + 1, 3:])[0]
        if k == 0:
            p = p + R[:, :, 2] * q[:, [0]]
            if carrier is not None:
                R, p = carrier[0] @ R, p + carrier[1]
        elif k <= 6:
            R = R @ turned(leaning) if k == 1 and leaning is not None else R
            R = R @ turned(np.outer(q[:, k], [0.0, 0.0, 1.0]))
        found.append((R, p))
    return found


def weight(q: Floats) -> tuple[float, Floats]:
    """Weight of all that the slider carries, itself too, N, and (N, 3) the centre of its mass."""
    places = frames(q, np.zeros((8, 6)))
    centre = sum(m * (p + R @ np.array(c)) for m, c, (R, p) in zip(MASSES, CENTRES, places, strict=False)) / sum(MASSES)
    return sum(MASSES), centre


def carried(q: Floats, time: Floats, machine: Machine) -> tuple[Floats, Floats]:
    """Rotation (N, 3, 3) and shift (N, 3), m, of the slider about its own origin: by the column's pieces, then by the base."""
    mass, centre = weight(q)
    force = mass * GRAVITY
    slider = frames(q, np.zeros((8, 6)))[0][1]
    foot = np.zeros(3)
    length = ROOT + q[:, 0]
    turn, shift = np.zeros((len(q), 3)), np.zeros((len(q), 3))
    for i in range(PIECES):
        piece = slider - np.outer(length * (1.0 - (i + 0.5) / PIECES), [0.0, 0.0, 1.0])
        moment = np.cross(centre - piece, force)
        bend = np.zeros((len(q), 3))
        bend[:, :2] = (moment[:, :2] @ machine.column) * (length / PIECES)[:, None]
        turn, shift = turn + bend, shift + np.cross(bend, slider - piece)
    part = (time - time.min()) / np.ptp(time)
    tilt = np.zeros((len(q), 3))
    tilt[:, :2] = np.cross(centre - foot, force)[:, :2] @ machine.base * (1.0 + machine.settles * part)[:, None]
    return turned(turn + tilt), shift + np.cross(tilt, slider - foot)


def leaning(q: Floats, machine: Machine) -> Floats | None:
    """(N, 3) rad, by which the bearing between slider and arm tilts, or None."""
    if machine.bearing is None:
        return None
    places = frames(q, np.zeros((8, 6)))[1:7]
    centre = sum(m * (p + R @ np.array(c)) for m, c, (R, p) in zip(MASSES[1:], CENTRES[1:], places, strict=True))
    moment = np.cross(centre - sum(MASSES[1:]) * places[0][1], GRAVITY)
    return np.pad(moment[:, :2] @ machine.bearing, ((0, 0), (0, 1)))


def rough(q: Floats, rng: np.random.Generator) -> Floats:
    """(N, 6) of the turning joints, size 1 each: a process over the joint's own angle, of a length of 0.2 rad, and a part that
    depends on the neighbour's angle as well."""
    found = np.empty((len(q), 6))
    for k in range(6):
        waves = rng.standard_normal(60) / 0.2
        own = np.cos(np.outer(q[:, k + 1], waves) + rng.uniform(0.0, 2.0 * np.pi, 60)).sum(axis=1) / np.sqrt(30.0)
        near = 1 + (k + 1) % 6
        both = np.cos(1.3 * q[:, k + 1] + 1.7 * q[:, near] + rng.uniform(0.0, 2.0 * np.pi)) * np.sqrt(2.0)
        found[:, k] = 0.8 * own + 0.6 * both
    return found


def seen(q: Floats, time: Floats, errors: Floats, machine: Machine, unlisted: Floats) -> Floats:
    """(N, 3) positions of the tool."""
    moved = q.copy()
    moved[:, 1:] += machine.rough * unlisted
    return frames(moved, errors, carried(q, time, machine), leaning(q, machine))[-1][1]


def derivative(q: Floats) -> Floats:
    """(3 N, 48 + 6) of the positions by the placements and by the instrument's frame, by differences."""
    zero, step = np.zeros((8, 6)), 1e-5
    plain = frames(q, zero)[-1][1]
    columns = []
    for k in range(48):
        errors = zero.copy()
        errors.flat[k] = step
        columns.append(((frames(q, errors)[-1][1] - plain) / step).ravel())
    for axis in np.eye(3):
        columns += [np.tile(axis, len(q)), np.cross(axis, plain).ravel()]
    return np.stack(columns, axis=1)


def rms(x: Floats) -> float:
    """Root mean square length of (3 N,) or (N, 3)."""
    return float(np.sqrt((x.reshape(-1, 3) ** 2).sum(axis=1).mean()))


def spd(rng: np.random.Generator, ratio: float) -> Floats:
    """(2, 2) of size 1, by whose second axis it is less by ``ratio``; its axes are skewed."""
    angle = rng.uniform(0.3, 1.25)
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return axes @ np.diag([1.0, ratio]) @ axes.T


def measured(
    seed: int,
    physical: float,
    base: float,
    unlisted: float,
    settles: float = 0.0,
    poses: int = 440,
    sigma: float = 2e-4,
) -> Measured:
    """A campaign. ``physical``: root mean square at the TCP, m, of what the geometry leaves of base and column together;
    ``base``: the base's share of the sum of both squares; ``unlisted``: of the rough joints, m; ``sigma``: of the noise, m."""
    rng = np.random.default_rng(seed)
    low, high = np.array(TRAVEL).T
    q = rng.uniform(low, high, (40 * poses, 7))
    place = frames(q, np.zeros((8, 6)))[-1][1]
    q = np.round(q[(place[:, 2] > 0.1) & (np.hypot(place[:, 0], place[:, 1]) > 0.25)][:poses], 6)
    time = np.cumsum(rng.uniform(10.0, 30.0, poses))
    J, zero = derivative(q), np.zeros((8, 6))
    plain, noises = frames(q, zero)[-1][1], rough(q, rng)
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    absorbed = U[:, s > 1e-8 * s[0]]

    def left(machine: Machine) -> Floats:
        moved = (seen(q, time, zero, machine, noises) - plain).ravel()
        return moved - absorbed @ (absorbed.T @ moved)

    none = np.zeros((2, 2))
    K, S = spd(rng, rng.uniform(0.02, 0.15)), spd(rng, rng.uniform(0.35, 0.8))
    step = 1e-6
    size_base = rms(left(Machine(step * K, none, settles))) / step
    size_column = rms(left(Machine(none, step * S))) / step
    of_base, of_column = np.sqrt(base), np.sqrt(1.0 - base)
    # Both together: what they share adds up.
    both = rms(left(Machine(step * of_base * K / size_base, step * of_column * S / size_column, settles))) / step
    size = physical / both
    size_rough = rms(left(Machine(none, none, 0.0, step))) / step
    parts = {
        "base": Machine(size * of_base / size_base * K, none, settles),
        "column": Machine(none, size * of_column / size_column * S),
        "rough": Machine(none, none, 0.0, unlisted / size_rough),
    }
    truth = Machine(parts["base"].base, parts["column"].column, settles, parts["rough"].rough)
    errors = TOLERANCE * rng.standard_normal((8, 6))
    position = seen(q, time, errors, truth, noises) + sigma * rng.standard_normal((poses, 3))
    sizes = {name: rms(left(part)) for name, part in parts.items()} | {"all": rms(left(truth))}
    return Measured(q, position, time, sigma, sizes)


def write(folder: Path) -> Path:
    """The URDF in a folder."""
    file = folder / "arm_on_telescope.urdf"
    file.write_text(urdf())
    return file
