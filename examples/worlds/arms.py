"""Arms of turning joints, also on a telescope: an own product of placements and turns, loads by statics, and the URDF."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from motion import Array, Motion, Poses, transforms


@dataclass(frozen=True)
class Arm:
    """Joints turn about their own z. Geometry: six errors of each joint's placement and of the tool's, in its own frame.

    A telescope has one command, q1, and stages that slide along their own z; placements, masses and centres begin with theirs.
    """

    robot: str
    placements: tuple[
        tuple[float, ...], ...
    ]  # of each joint and at last the tool: x y z (m), roll (rad), in the parent's
    masses: tuple[float, ...]
    centres: tuple[tuple[float, float, float], ...]  # of each link, in its joint's frame, m
    travel: tuple[tuple[float, float], ...]
    station: tuple[float, float, float] = (2.5, -1.5, 0.6)
    overrun: tuple[float, float] = (0.02, 0.1)  # rad
    links: tuple[str, ...] = ()
    sliding: bool = False
    stages: tuple[float, ...] = ()  # how far each stage of a telescope slides per metre of q1
    rest: tuple[float, ...] = ()  # m, how far each stage reaches out of what carries it at q1 = 0: this length bends
    pseudo: bool = False  # the joint of q1 carries nothing, and all stages follow it

    @property
    def joints(self) -> tuple[str, ...]:
        """The joint of each part."""
        names = [f"j{k + 1}" for k in range(len(self.masses) - len(self.stages))]
        first = 1 if self.pseudo else 0
        return tuple([("column", "stage1", "stage2")[first + k] for k in range(len(self.stages))] + names)

    @property
    def sites(self) -> tuple[str, ...]:
        """The joint of each command."""
        return (("column",) if self.stages else ()) + self.joints[len(self.stages) :]

    @property
    def tolerance(self) -> Array:
        return np.full(6 * len(self.placements), 5e-4)

    def chain(self, q: Array, geometry: Array, motion: Motion) -> Array:
        """Frames (N, n + 1, 4, 4) of the joints, turned, and of the TCP, in the base frame."""
        errors = transforms(geometry.reshape(-1, 6))
        travel = np.zeros((*q.shape, 6))
        travel[..., 5] = q + motion.drive
        turns = transforms(travel) @ transforms(motion.body)
        T = np.tile(np.eye(4), (len(q), 1, 1))
        frames = []
        last = len(self.stages) - 1
        for k, place in enumerate(self.placements):
            T = T @ transforms(np.array([*place, 0.0, 0.0])) @ errors[k]
            if k <= last:
                slide = np.tile(np.eye(4), (len(q), 1, 1))
                slide[:, 2, 3] = self.stages[k] * travel[:, 0, 5]
                T = T @ slide if k < last else T @ slide @ transforms(motion.body[:, 0])
            elif k < len(self.masses):
                T = T @ turns[:, k - max(last, 0)]
            frames.append(T)
        return np.stack(frames, axis=1)

    def poses(self, q: Array, geometry: Array, motion: Motion, start: Poses | None = None) -> Poses:
        T = self.chain(q, geometry, motion)[:, -1]
        return T[:, :3, 3], T[:, :3, :3]

    def loads(self, q: Array, payload: Array, force: Array) -> tuple[Array, Array]:
        """No rods; force and moment (N, n, 6) that each commanded joint carries, at its origin and in its frame."""
        return np.zeros((len(q), 0)), self.carried(q, payload, force)[:, max(len(self.stages) - 1, 0) :]

    def carried(self, q: Array, payload: Array, force: Array) -> Array:
        """Force and moment (N, parts, 6) that each part's joint carries, at its origin and in its frame."""
        n = len(self.masses)
        T = self.chain(q, np.zeros(6 * (n + 1)), Motion.none(len(q), q.shape[1], 0))
        down = np.array([0.0, 0.0, -9.81])
        at_tool = payload[:, None] * down + force
        wrench = np.zeros((len(q), n, 6))
        for j in range(n):
            origin, R = T[:, j, :3, 3], T[:, j, :3, :3]
            pull = at_tool.copy()
            moment = np.cross(T[:, -1, :3, 3] - origin, at_tool)
            for k in range(j, n):
                centre = np.einsum("nij,j->ni", T[:, k, :3, :3], self.centres[k]) + T[:, k, :3, 3]
                pull = pull + self.masses[k] * down
                moment = moment + np.cross(centre - origin, self.masses[k] * down)
            wrench[:, j, :3] = np.einsum("nji,nj->ni", R, pull)
            wrench[:, j, 3:] = np.einsum("nji,nj->ni", R, moment)
        return wrench

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Commands (count, n) over the joints' travel, with the tool above the floor."""
        low, high = np.array(self.travel).T
        q = rng.uniform(low, high, (20 * count, len(low)))
        p, _ = self.poses(q, np.zeros(6 * len(self.placements)), Motion.none(len(q), len(low), 0))
        return q[p[:, 2] > 0.1][:count]

    def urdf(self) -> str:
        """The arm with inertia of solid balls of 6 cm about each centre of mass: gtpin's loads need masses only."""
        lines = [f'<robot name="{self.robot}">', '  <link name="base_link"/>']
        for k, (mass, c) in enumerate(zip(self.masses, self.centres, strict=True)):
            ball = 0.4 * mass * 0.06**2
            lines += [
                f'  <link name="l{k + 1}"><inertial><origin xyz="{c[0]} {c[1]} {c[2]}"/><mass value="{mass}"/>',
                f'    <inertia ixx="{ball:.6g}" ixy="0" ixz="0" iyy="{ball:.6g}" iyz="0" izz="{ball:.6g}"/>',
                "  </inertial></link>",
            ]
        lines.append('  <link name="tool0"/>')
        travel = [(s * self.travel[0][0], s * self.travel[0][1]) for s in self.stages] + list(
            self.travel[bool(self.stages) :]
        )
        if self.pseudo:
            lines.append('  <link name="drive"/>')
            lines.append('  <joint name="column" type="prismatic"><parent link="base_link"/><child link="drive"/>')
            lines.append(
                f'    <origin xyz="0 0 0" rpy="0 0 0"/>\n    <axis xyz="0 0 1"/>{limit(*self.travel[0])}</joint>'
            )
        for k, (x, y, z, roll) in enumerate(self.placements):
            parent = "base_link" if k == 0 else f"l{k}"
            last = k == len(self.masses)
            sort = "prismatic" if k < len(self.stages) else "revolute"
            name, kind, child = ("tool", "fixed", "tool0") if last else (self.joints[k], sort, f"l{k + 1}")
            lines.append(f'  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>')
            lines.append(f'    <origin xyz="{x} {y} {z}" rpy="{roll!r} 0 0"/>' + ("</joint>" if last else ""))
            if not last:
                follows = k < len(self.stages) and name != "column"
                mimic = f'<mimic joint="column" multiplier="{self.stages[k]}" offset="0"/>' if follows else ""
                lines.append(f'    <axis xyz="0 0 1"/>{limit(*travel[k])}{mimic}</joint>')
        return "\n".join([*lines, "</robot>"]) + "\n"


def limit(low: float, high: float) -> str:
    return f'<limit lower="{low}" upper="{high}" effort="500" velocity="3"/>'


H = float(np.pi / 2)
# Universal Robots' public table (standard Denavit-Hartenberg: d1 a2 a3 d4 d5 d6), masses and centres of mass
UR5 = Arm(
    "ur5_world",
    (
        (0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.089159, H),
        (-0.425, 0.0, 0.0, 0.0),
        (-0.39225, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.10915, H),
        (0.0, 0.0, 0.09465, -H),
        (0.0, 0.0, 0.0823, 0.0),
    ),
    (3.7, 8.393, 2.33, 1.219, 1.219, 0.1879),
    (
        (0.0, 0.00193, 0.0635),
        (-0.2125, 0.0, 0.11336),
        (-0.24225, 0.0, 0.0265),
        (0.0, -0.01634, 0.1073),
        (0.0, 0.01634, 0.0929),
        (0.0, 0.0, 0.08),
    ),
    ((-2.6, 2.6), (-2.6, -0.4), (-2.2, 2.2), (-2.6, 2.6), (-2.4, 2.4), (-2.8, 2.8)),
)
# Franka's public table (Craig's convention); masses and centres after Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019
PANDA = Arm(
    "panda_world",
    (
        (0.0, 0.0, 0.333, 0.0),
        (0.0, 0.0, 0.0, -H),
        (0.0, -0.316, 0.0, H),
        (0.0825, 0.0, 0.0, H),
        (-0.0825, 0.384, 0.0, -H),
        (0.0, 0.0, 0.0, H),
        (0.088, 0.0, 0.0, H),
        (0.0, 0.0, 0.107, 0.0),
    ),
    (4.97, 0.647, 3.229, 3.588, 1.226, 1.667, 0.7355),
    (
        (0.0039, 0.0021, -0.1750),
        (-0.0031, -0.0287, 0.0035),
        (0.0275, 0.0393, -0.0665),
        (-0.0532, 0.1044, 0.0275),
        (-0.0120, 0.0411, -0.0384),
        (0.0601, -0.0141, -0.0105),
        (0.0105, -0.0043, 0.0616),
    ),
    ((-2.7, 2.7), (-1.6, 1.6), (-2.7, 2.7), (-2.9, -0.2), (-2.7, 2.7), (0.1, 3.6), (-2.7, 2.7)),
)
# a drawn arm of 1.7 m reach with an offset shoulder, of the kind of welding arms
ELBOW = Arm(
    "elbow_world",
    (
        (0.0, 0.0, 0.42, 0.0),
        (0.16, 0.0, 0.0, -H),
        (0.78, 0.0, 0.0, 0.0),
        (0.13, 0.71, 0.0, -H),
        (0.0, 0.0, 0.0, H),
        (0.0, -0.12, 0.0, -H),
        (0.06, 0.0, 0.18, 0.0),
    ),
    (95.0, 48.0, 41.0, 14.0, 7.0, 1.5),
    (
        (0.05, 0.0, -0.09),
        (0.35, 0.0, 0.05),
        (0.08, 0.11, -0.02),
        (0.0, 0.0, -0.21),
        (0.0, -0.03, 0.0),
        (0.0, 0.0, 0.02),
    ),
    ((-2.5, 2.5), (-2.2, 0.4), (-1.2, 1.9), (-3.0, 3.0), (-1.9, 1.9), (-3.0, 3.0)),
)
ARMS = (UR5, PANDA, ELBOW)
