"""Parallel machines written down twice: as a URDF for gtpin, and as the numbers of their closures for the tests."""

from dataclasses import dataclass, replace

import numpy as np
from closures import Closures
from scipy.spatial.transform import Rotation
from urdfs import joint, urdf

Floats = np.ndarray


@dataclass(frozen=True)
class Carrier:
    """What an actuator moves: along or about an axis through a point (both base frame); its link's axes at zero."""

    kind: str
    point: Floats
    axis: Floats
    frame: Floats


def text(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)


def rpy(R: Floats) -> str:
    return text(Rotation.from_matrix(R).as_euler("xyz"))


def inertial(xyz: str, mass: float) -> str:
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass}"/>{inertia}</inertial>'


def along_z(z: Floats) -> Floats:
    """A rotation whose third column is z."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def machine(
    name: str,
    carriers: list[Carrier],
    carried: list[int | None],
    P: Floats,
    C: Floats,
    q: Floats,
    T: Floats,
    R: Floats,
    spread: float,
    zero_is_home: bool = True,
) -> Closures:
    """A machine whose six rods are as long as its home needs them; those without a carrier are legs of variable length.

    In its URDF joints are named against the order of q, odd loops are written the other way round, frames are turned, and the
    TCP is not the platform's frame: nothing of that may matter.
    """
    legs = carried[0] is None
    made = Closures(
        name,
        "",
        "leg" if legs else "track" if carriers[0].kind == "prismatic" else "arm",
        np.arange(6) if legs else np.array(carried),
        P,
        C,
        np.zeros(6),
        np.zeros((6, 3)) if legs else np.array([carriers[k].axis for k in carried]),
        np.zeros((6, 3)) if legs else np.array([carriers[k].point for k in carried]),
        q,
        T,
        R,
        spread,
    )
    L, seats = made.residual(q[None], T[None], R[None])[0], made.C(q[None])[0]  # as of rods without a length
    tcp_T, tcp_R = np.array([0.01, -0.02, 0.05]), Rotation.from_euler("xyz", [0.1, 0.2, -0.3]).as_matrix()
    platform_R = R @ tcp_R.T
    zero = {"xyz": text(T - platform_R @ tcp_T), "rpy": rpy(platform_R)} if zero_is_home else {}
    parts = [
        joint("floats", "base", "platform", kind="floating", body=inertial("0.01 0.02 -0.03", 6.0), **zero),
        joint("tcp_mount", "platform", "tcp", text(tcp_T), kind="fixed", rpy=rpy(tcp_R)),
    ]
    actuators = []
    driven = {"limit": (-0.9, 1.1)}
    for k, one in enumerate(carriers):
        actuators.append((f"drive_{chr(ord('z') - k)}", f"cart{k + 1}"))
        body = inertial(text(one.frame.T @ (C[carried.index(k)] - one.point) / 2), 2.0)
        axis = text(2.0 * one.frame.T @ one.axis)
        at = {"kind": one.kind, "rpy": rpy(one.frame), "body": body, **driven}
        parts.append(joint(actuators[-1][0], "base", f"cart{k + 1}", text(one.point), axis, **at))
    for i, k in enumerate(carried):
        link, tip = f"link{i + 1}", float(L[i])
        z = platform_R.T @ (seats[i] - T - R @ P[i])
        at = {"xyz": text(tcp_R @ P[i] + tcp_T), "rpy": rpy(along_z(z / np.linalg.norm(z)))}
        body = inertial(f"0 0 {0.4 * L[i]}", 0.4)
        parts.append(joint(f"{link}_pitch", "platform", f"{link}_cross", axis="1 0 0", limit=1.5, **at))
        hung = f"{link}_tube" if k is None else link
        parts.append(joint(f"{link}_yaw", f"{link}_cross", hung, axis="0 1 0", limit=1.5, body=body))
        if k is None:
            actuators.append((f"leg_{chr(ord('z') - i)}", f"leg{i + 1}"))
            slide = {"kind": "prismatic", "body": body, **driven}
            parts.append(joint(actuators[-1][0], hung, link, "0 0 0.25", "0 0 3", **slide))
            tip -= 0.25
        seat = C[i] if k is None else carriers[k].frame.T @ (C[i] - carriers[k].point)
        seat_link = "base" if k is None else f"cart{k + 1}"
        ends = [
            f'link="{link}" xyz="0 0 {tip!r}" rpy="0.3 -0.2 0.1"',
            f'link="{seat_link}" xyz="{text(seat)}" rpy="1 2 3"',
        ]
        first, second = ends if i % 2 == 0 else ends[::-1]
        parts.append(f'<loop_joint name="ball{i + 1}" type="spherical"><link1 {first}/><link2 {second}/></loop_joint>')
    own = [f'<actuator joint="{drive}" site="{site}"/>' for drive, site in actuators]
    own += [f'<rod link="link{i}" loop="ball{i}" site="link{i}"/>' for i in range(1, 7)]
    rotvec = text(Rotation.from_matrix(R).as_rotvec())
    own.append(f'<home q="{text(q)}" tcp_xyz="{text(T)}" tcp_rotvec="{rotvec}"/><platform link="platform" tcp="tcp"/>')
    own.append('<gravity xyz="0.5 -0.3 -9.7"/><tolerance link_length="0.0005"/>')
    return replace(made, L0=L, urdf=urdf(name, *parts, f"<gtpin>{''.join(own)}</gtpin>"))


def circle(radius: float, degrees: list[float], z: float = 0.0) -> Floats:
    a = np.radians(degrees)
    return np.column_stack([radius * np.cos(a), radius * np.sin(a), np.full(len(a), z)])


def stewart() -> Closures:
    """Six legs of variable length between a base and a platform; home is not at zero commands."""
    base = circle(0.6, [-8, 8, 112, 128, 232, 248])
    platform = circle(0.25, [-50, 50, 70, 170, 190, 290], -0.04)
    R = Rotation.from_rotvec([0.1, -0.05, 0.2]).as_matrix()
    q = np.array([0.10, 0.12, 0.08, 0.11, 0.09, 0.13])
    return machine("stewart", [], [None] * 6, platform, base, q, np.array([0.02, 0.03, 0.75]), R, 0.06)


def linear_delta() -> Closures:
    """Three vertical tracks, six equal rods in parallel pairs; the URDF's zero is not its home."""
    out = circle(1.0, [90, 210, 330])
    carriers = [Carrier("prismatic", 0.4 * o, np.array([0.0, 0.0, 1.0]), along_z(o)) for o in out]
    side = np.cross([0.0, 0.0, 1.0], out)
    pairs = [(k, s) for k in range(3) for s in (-0.06, 0.06)]
    P = np.array([0.05 * out[k] + s * side[k] for k, s in pairs])
    C = np.array([0.38 * out[k] + s * side[k] for k, s in pairs])
    T = np.array([0.0, 0.0, -np.sqrt(0.55**2 - 0.33**2)])
    carried: list[int | None] = [k for k, _ in pairs]
    return machine("linear_delta", carriers, carried, P, C, np.zeros(3), T, np.eye(3), 0.12, zero_is_home=False)


def rotary_tau() -> Closures:
    """Three arms that turn about one column, with one, two and three rods; one of them turns without end."""
    up = np.array([0.0, 0.0, 1.0])
    kinds = ["revolute", "continuous", "revolute"]
    points = [up * 0.9, up * 0.1, up * 0.5]
    tilt = Rotation.from_rotvec([[0.02, 0.0, 0.0], [0.0, -0.03, 0.0], [0.01, 0.02, 0.0]]).apply(up)
    frames = [Rotation.from_euler("xyz", [0.3, -0.4, 0.5 * k]).as_matrix() for k in range(3)]
    carriers = [Carrier(*parts) for parts in zip(kinds, points, tilt, frames, strict=True)]
    carried: list[int | None] = [0, 1, 1, 2, 2, 2]
    arms = circle(0.8, [20, -40, 70])
    spread = [
        [0, 0, 0],
        [-0.16, 0.21, -0.24],
        [-0.06, 0.24, 0.06],
        [0.09, -0.15, 0.18],
        [-0.24, 0.2, 0.05],
        [0.09, 0.1, 0.1],
    ]
    P = np.array(
        [
            [0.22, 0.23, 0.1],
            [-0.05, 0, -0.14],
            [-0.23, -0.25, 0.19],
            [-0.24, -0.08, 0.22],
            [0.14, 0.14, 0.1],
            [-0.21, 0.12, -0.21],
        ]
    )
    C = np.array([points[k] + arms[k] for k in (0, 1, 1, 2, 2, 2)]) + np.array(spread)
    R = Rotation.from_rotvec([0.05, 0.1, -0.1]).as_matrix()
    return machine(
        "rotary_tau", carriers, carried, P, C, np.array([0.05, -0.1, 0.1]), np.array([1.2, 0.2, 0.4]), R, 0.12
    )


MAKERS = {"stewart": stewart, "linear_delta": linear_delta, "rotary_tau": rotary_tau}
