"""Machines with a true geometry and with parts that deviate. The Gantry-Tau by its rods' closures, others by Pinocchio.

All poses are of the tool (TCP) in the base frame; m, rad, N, N m. Nothing of gtpin is used.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

Array = np.ndarray

FIVE_BAR = """<robot name="five_bar">
  <link name="base"/>
  <link name="left">
    <inertial><origin xyz="0.14 0 0"/><mass value="1.3"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-2" iyz="0" izz="1e-2"/></inertial>
  </link>
  <link name="left_far">
    <inertial><origin xyz="0.2 0 0"/><mass value="0.9"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-2" iyz="0" izz="1e-2"/></inertial>
  </link>
  <link name="right">
    <inertial><origin xyz="0.14 0 0"/><mass value="1.3"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-2" iyz="0" izz="1e-2"/></inertial>
  </link>
  <link name="right_far">
    <inertial><origin xyz="0.2 0 0"/><mass value="0.8"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-2" iyz="0" izz="1e-2"/></inertial>
  </link>
  <link name="tool"/>
  <joint name="drive_left" type="revolute">
    <parent link="base"/><child link="left"/><origin xyz="-0.12 0 0" rpy="0 -2.15 0"/><axis xyz="0 -1 0"/>
    <limit lower="-0.8" upper="0.8" effort="100" velocity="3"/>
  </joint>
  <joint name="elbow_left" type="continuous">
    <parent link="left"/><child link="left_far"/><origin xyz="0.28 0 0" rpy="0 1.3 0"/><axis xyz="0 -1 0"/>
  </joint>
  <joint name="drive_right" type="revolute">
    <parent link="base"/><child link="right"/><origin xyz="0.12 0 0" rpy="0 -0.99159265 0"/><axis xyz="0 -1 0"/>
    <limit lower="-0.8" upper="0.8" effort="100" velocity="3"/>
  </joint>
  <joint name="elbow_right" type="continuous">
    <parent link="right"/><child link="right_far"/><origin xyz="0.28 0 0" rpy="0 -1.3 0"/><axis xyz="0 -1 0"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="left_far"/><child link="tool"/><origin xyz="0.47 0 0"/></joint>
  <loop_joint name="pin" type="spherical">
    <link1 link="left_far" xyz="0.41 0 0"/><link2 link="right_far" xyz="0.41 0 0"/>
  </loop_joint>
  <gtpin>
    <actuator joint="drive_left"/><actuator joint="drive_right"/><platform link="tool"/>
  </gtpin>
</robot>
"""


class UnreachableError(Exception):
    """A pose that the machine can't reach."""


@dataclass(frozen=True)
class Deviation:
    """How parts deviate at each of N poses; None: not at all. A twist is a shift (m) and a rotation vector (rad).

    drive (N, n): of the commands. length (N, 6): of rods. carrier (N, n, 6): of carts about their joints' mean, base axes.
    link (N, k, 6): of the tip of each tree joint's link, link axes. base (N, 6): of the machine about the base frame's origin.
    tool (N, 6): of the tool, its own axes. reading (N, 6): of what the instrument reads, base axes.
    """

    drive: Array | None = None
    length: Array | None = None
    carrier: Array | None = None
    link: Array | None = None
    base: Array | None = None
    tool: Array | None = None
    reading: Array | None = None

    def scaled(self, factor: float) -> Deviation:
        return replace(self, **{name: factor * value for name, value in vars(self).items() if value is not None})


@dataclass(frozen=True)
class Loads:
    """Static loads at N poses: of drives (N, n), of rods (N, 6), tension positive, on links' tips (N, k, 6), link axes."""

    drive: Array
    rods: Array | None = None
    tips: Array | None = None


def rotations(vectors: Array) -> Array:
    """Rotation matrices (N, 3, 3) of rotation vectors (N, 3)."""
    angle = np.linalg.norm(vectors, axis=-1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    small = angle < 1e-9
    safe = np.where(small, 1.0, angle)
    return (
        np.eye(3)
        + np.where(small, 1.0, np.sin(safe) / safe) * K
        + np.where(small, 0.5, (1 - np.cos(safe)) / safe**2) * K @ K
    )


def finished(T: Array, R: Array, deviation: Deviation) -> tuple[Array, Array]:
    """Poses with the deviations of tool, base and reading."""
    if deviation.tool is not None:
        T, R = T + np.einsum("nij,nj->ni", R, deviation.tool[:, :3]), R @ rotations(deviation.tool[:, 3:])
    if deviation.base is not None:
        turn = rotations(deviation.base[:, 3:])
        T, R = np.einsum("nij,nj->ni", turn, T) + deviation.base[:, :3], turn @ R
    if deviation.reading is not None:
        T, R = T + deviation.reading[:, :3], rotations(deviation.reading[:, 3:]) @ R
    return T, R


def numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


@dataclass(frozen=True)
class GantryTau:
    """Three carts, six rods. Geometry (48,): lengths, platform joints, cart joints, two tilts of each track."""

    urdf: Path
    name: str = "gantry_tau"
    dataset: str = 'robot = "gantry_tau"\n'
    turns: bool = False
    drives: tuple[str, ...] = ("cart1", "cart2", "cart3")
    rods: tuple[str, ...] = ("link1", "link2a", "link2b", "link3a", "link3b", "link3c")
    cart_of: Array = field(default_factory=lambda: np.array([0, 1, 1, 2, 2, 2]))
    lower: Array = field(default_factory=lambda: np.full(3, -0.55))
    upper: Array = field(default_factory=lambda: np.full(3, 0.6))

    def __post_init__(self) -> None:
        root = ET.parse(self.urdf).getroot()
        joints = {j.get("name"): j for j in root.iter("joint") if j.find("parent") is not None}
        loops = {loop.find("link1").get("link"): loop for loop in root.iter("loop_joint")}
        tracks = [joints[f"track{i}"] for i in (1, 2, 3)]
        P = np.array([numbers(joints[f"{rod}_pitch"].find("origin").get("xyz")) for rod in self.rods])
        C = np.array([numbers(loops[rod].find("link2").get("xyz")) for rod in self.rods])
        origins = np.array([numbers(t.find("origin").get("xyz")) for t in tracks])
        home = next(root.iter("home"))
        values = {
            "P": P, "C": C + origins[self.cart_of], "d": np.array([numbers(t.find("axis").get("xyz")) for t in tracks]),
            "L": np.array([numbers(loops[rod].find("link1").get("xyz"))[2] for rod in self.rods]),
            "home_T": numbers(home.get("tcp_xyz")), "home_R": rotations(numbers(home.get("tcp_rotvec"))[None])[0],
        }  # fmt: skip
        for key, value in values.items():
            object.__setattr__(self, key, value)

    @property
    def n(self) -> int:
        return 3

    @property
    def tolerance(self) -> Array:
        return np.repeat([1e-3, 1e-3, 2e-3, 1e-3], [6, 18, 18, 6])

    def parts(self, geometry: Array) -> tuple[Array, Array, Array, Array]:
        """Lengths, platform joints, cart joints at command zero, track directions."""
        across = np.linalg.svd(self.d[:, None, :])[2][:, 1:, :]  # (3, 2, 3)
        d = self.d + np.einsum("ki,kij->kj", geometry[42:].reshape(3, 2), across)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        return self.L + geometry[:6], self.P + geometry[6:24].reshape(6, 3), self.C + geometry[24:42].reshape(6, 3), d

    def closed(self, q: Array, geometry: Array, deviation: Deviation) -> tuple[Array, Array, Array, Array]:
        """T, R, vectors from the platform's to the carts' joints, and the levers R P."""
        L, P, C, d = self.parts(geometry)
        q = q if deviation.drive is None else q + deviation.drive
        carts = np.zeros((len(q), 6, 3))
        if deviation.carrier is not None:
            mean = np.array([C[self.cart_of == k].mean(axis=0) for k in range(3)])
            twist = deviation.carrier[:, self.cart_of]
            carts = twist[..., :3] + np.cross(twist[..., 3:], (C - mean[self.cart_of])[None])
        lengths = L + (0.0 if deviation.length is None else deviation.length) + np.zeros((len(q), 6))
        T, R = np.tile(self.home_T, (len(q), 1)), np.tile(self.home_R, (len(q), 1, 1))
        for share in (0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0):
            Cq = C + carts + share * q[:, self.cart_of, None] * d[self.cart_of]
            for _ in range(2):
                levers = np.einsum("nij,kj->nki", R, P)
                reach = Cq - T[:, None] - levers
                length = np.linalg.norm(reach, axis=2)
                u = reach / length[..., None]
                step = np.linalg.solve(np.concatenate([u, np.cross(levers, u)], axis=2), (length - lengths)[..., None])[
                    ..., 0
                ]
                T, R = T + step[:, :3], rotations(step[:, 3:]) @ R
        if not np.abs(step).max() < 1e-9:
            raise UnreachableError
        return T, R, reach, levers

    def poses(self, q: Array, geometry: Array, deviation: Deviation) -> tuple[Array, Array]:
        T, R, _, _ = self.closed(q, geometry, deviation)
        return finished(T, R, deviation)

    def loads(self, q: Array, payload: Array) -> Loads:
        _, R, reach, levers = self.closed(q, np.zeros(48), Deviation())
        u = reach / np.linalg.norm(reach, axis=2)[..., None]
        weights = np.array([[0.0, 0.0, -9.81]])
        platform = np.einsum("nij,j->ni", R, np.array([-0.09, 0.0, 0.02]))
        force = (22.0 + 6 * 2.05 + payload)[:, None] * weights
        moment = np.cross(platform, 22.0 * weights) + np.cross(levers, 2.05 * weights[:, None]).sum(axis=1)
        A = np.concatenate([u, np.cross(levers, u)], axis=2).transpose(0, 2, 1)
        rods = np.linalg.solve(A, -np.concatenate([force, moment], axis=1)[..., None])[..., 0]
        pull = -np.einsum("nk,nki,ki->nk", rods, u, self.d[self.cart_of])  # on the cart, along its track
        drive = np.stack([pull[:, self.cart_of == k].sum(axis=1) for k in range(3)], axis=1)
        return Loads(drive, rods=rods)


@dataclass(frozen=True)
class Tree:
    """An arm, or a planar five-bar (``closed_by``: the anchors on two joints' links).

    Geometry: six numbers for each joint and for the tool, three for each anchor. Shifts
    and rotation vectors are about a joint's own origin, along the axes of its placement.
    """

    name: str
    dataset: str
    model: pin.Model
    tool_joint: int
    tool: pin.SE3
    lower: Array
    upper: Array
    commanded: tuple[int, ...]  # of the joints' coordinates
    text: str = ""  # the URDF, where it has to be written beside the datasets
    closed_by: tuple[tuple[int, Array], ...] = ()
    turns: bool = True

    @property
    def n(self) -> int:
        return len(self.commanded)

    @property
    def drives(self) -> tuple[str, ...]:
        return tuple(self.model.names[i + 1] for i in self.commanded)

    @property
    def tolerance(self) -> Array:
        return np.full(6 * self.model.njoints + 3 * len(self.closed_by), 5e-4)

    def placed(self, geometry: Array) -> tuple[list[pin.SE3], pin.SE3, list[Array]]:
        changes = geometry[: 6 * self.model.njoints].reshape(-1, 6)
        moved = [
            M * pin.SE3(pin.exp3(change[3:]), change[:3].copy())
            for M, change in zip([*self.model.jointPlacements[1:], self.tool], changes, strict=True)
        ]
        anchors = [a + geometry[6 * self.model.njoints + 3 * i :][:3] for i, (_, a) in enumerate(self.closed_by)]
        return [pin.SE3.Identity(), *moved[:-1]], moved[-1], anchors

    def solved(self, model: pin.Model, data: pin.Data, q: Array, start: Array, anchors: list[Array]) -> Array:
        """All coordinates at the commands q: the loop closes in its plane, by Newton's method."""
        whole = start.copy()
        whole[list(self.commanded)] = q
        if not self.closed_by:
            pin.forwardKinematics(model, data, whole)
            return whole
        passive = [i for i in range(model.nv) if i not in self.commanded]
        (a, _), (b, _) = self.closed_by
        for _ in range(30):
            pin.computeJointJacobians(model, data, whole)
            rows, points = [], []
            for joint, anchor in ((a, anchors[0]), (b, anchors[1])):
                J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                lever = data.oMi[joint].rotation @ anchor
                rows.append(J[:3] + np.cross(J[3:].T, lever).T)
                points.append(data.oMi[joint].translation + lever)
            gap = (points[0] - points[1])[[0, 2]]  # the plane is the base frame's x, z
            step = np.linalg.solve((rows[0] - rows[1])[np.ix_([0, 2], passive)], -gap)
            whole[passive] += np.clip(step, -0.3, 0.3)
            if np.abs(step).max() < 1e-12:
                pin.forwardKinematics(model, data, whole)
                return whole
        raise UnreachableError

    def walk(self, q: Array, geometry: Array, deviation: Deviation):
        """Yields for each pose: the model, its data, all coordinates, the tool's placement."""
        placements, tool, anchors = self.placed(geometry)
        model = self.model.copy()
        data = model.createData()
        commands = q if deviation.drive is None else q + deviation.drive
        for k, command in enumerate(commands):
            tip = None if deviation.link is None else deviation.link[k]

            def beyond(parent: int, M: pin.SE3, tip=tip) -> pin.SE3:
                if tip is None or parent == 0:
                    return M
                return pin.SE3(pin.exp3(tip[parent - 1, 3:]) @ M.rotation, M.translation + tip[parent - 1, :3])

            for j in range(1, model.njoints):
                model.jointPlacements[j] = beyond(model.parents[j], placements[j])
            held = [
                beyond(j, pin.SE3(np.eye(3), a)).translation for (j, _), a in zip(self.closed_by, anchors, strict=True)
            ]
            start = np.zeros(model.nv)
            if self.closed_by:  # from the home posture in steps, so that the assembly stays
                for share in (0.34, 0.67):
                    start = self.solved(model, data, share * command, start, held)
            whole = self.solved(model, data, command, start, held)
            yield model, data, whole, beyond(self.tool_joint, tool)

    def poses(self, q: Array, geometry: Array, deviation: Deviation) -> tuple[Array, Array]:
        found = [data.oMi[self.tool_joint] * tool for _, data, _, tool in self.walk(q, geometry, deviation)]
        return finished(np.array([M.translation for M in found]), np.array([M.rotation for M in found]), deviation)

    def loads(self, q: Array, payload: Array) -> Loads:
        drive, tips = np.zeros(q.shape), np.zeros((len(q), self.model.nv, 6))
        nominal = np.zeros(len(self.tolerance))
        plain = [self.model.inertias[self.tool_joint].copy()]
        zero = np.zeros(self.model.nv)
        for k, (model, data, whole, tool) in enumerate(self.walk(q, nominal, Deviation())):
            model.inertias[self.tool_joint] = plain[0] + pin.Inertia(
                float(payload[k]), tool.translation, np.zeros((3, 3))
            )
            holding = pin.rnea(model, data, whole, zero, zero).copy()
            for j in range(1, model.njoints):
                parent = model.parents[j]
                if parent:
                    load = -data.f[j]
                    turned = data.liMi[j].rotation
                    tips[k, parent - 1] = np.concatenate([turned @ load.linear, turned @ load.angular])
            wrench = -9.81 * float(payload[k]) * (data.oMi[self.tool_joint].rotation.T @ np.array([0.0, 0.0, 1.0]))
            tips[k, self.tool_joint - 1, :3] = wrench
            if self.closed_by:
                holding = self.dragged(model, data, whole, holding)
            drive[k] = -holding[list(self.commanded)]
        return Loads(drive, tips=tips)

    def dragged(self, model: pin.Model, data: pin.Data, whole: Array, holding: Array) -> Array:
        """Holding torques of the drives where a loop carries the passive joints: virtual work."""
        passive = [i for i in range(model.nv) if i not in self.commanded]
        pin.computeJointJacobians(model, data, whole)
        rows = []
        for joint, anchor in self.closed_by:
            J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            rows.append(J[:3] + np.cross(J[3:].T, data.oMi[joint].rotation @ anchor).T)
        J = (rows[0] - rows[1])[[0, 2]]
        follow = -np.linalg.solve(J[:, passive], J[:, list(self.commanded)])
        total = holding.copy()
        total[list(self.commanded)] += follow.T @ holding[passive]
        return total


def arm(urdf: Path, name: str, middle: list[float], travel: list[float], *, tcp: str) -> Tree:
    """An arm of example-robot-data; commands within ``travel`` of ``middle``."""
    model = pin.buildModelFromUrdf(str(urdf))
    frame = model.frames[model.getFrameId(tcp)]
    low, high = np.array(middle) - travel, np.array(middle) + travel
    return Tree(
        name, f'robot = "{name}"\n', model, frame.parentJoint, frame.placement, low, high, tuple(range(model.nv))
    )


def five_bar() -> Tree:
    plain = "\n".join(
        line
        for line in FIVE_BAR.splitlines()
        if "loop_joint" not in line and "actuator" not in line and "gtpin>" not in line
    )
    plain = plain.replace('type="continuous"', 'type="revolute"').replace(
        '<axis xyz="0 -1 0"/>\n  </joint>',
        '<axis xyz="0 -1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>',
    )
    model = pin.buildModelFromXML(plain)
    frame = model.frames[model.getFrameId("tool")]
    far = [model.getJointId("elbow_left"), model.getJointId("elbow_right")]
    driven = tuple(model.getJointId(joint) - 1 for joint in ("drive_left", "drive_right"))
    anchors = tuple((joint, np.array([0.41, 0.0, 0.0])) for joint in far)
    travel = np.full(2, 0.55)
    return Tree(
        "five_bar",
        'robot = "../five_bar.urdf"\n',
        model,
        frame.parentJoint,
        frame.placement,
        -travel,
        travel,
        driven,
        FIVE_BAR,
        anchors,
    )


def machines(robots: Path, gantry: Path) -> dict[str, GantryTau | Tree]:
    """By name; ``robots``: example-robot-data's folder of robots, ``gantry``: the Gantry-Tau's URDF."""
    return {
        "gantry_tau": GantryTau(gantry),
        "five_bar": five_bar(),
        "ur5": arm(robots / "ur_description/urdf/ur5_robot.urdf", "ur5",
                   [0.0, -1.2, 1.3, -0.6, 1.2, 0.0], [1.5, 0.6, 0.7, 1.2, 0.8, 2.0], tcp="tool0"),
        "xarm7": arm(robots / "xarm_description/urdf/xarm7.urdf", "xarm7",
                     [0.0, 0.2, 0.0, 1.3, 0.0, 1.0, 0.0], [1.5, 0.6, 0.8, 0.7, 1.2, 0.6, 2.0], tcp="link_eef"),
    }  # fmt: skip
