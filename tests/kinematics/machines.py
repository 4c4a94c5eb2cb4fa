"""Parallel machines written down twice: as a URDF for gtpin, and as the numbers of their closures for the tests."""

from dataclasses import dataclass, replace

import numpy as np
from closures import Closures
from scipy.spatial.transform import Rotation

Floats = np.ndarray


@dataclass(frozen=True)
class Carrier:
    """What an actuator moves: along or about an axis through a point (both base frame); its link's axes at zero."""

    kind: str
    point: Floats
    axis: Floats
    frame: Floats


def write(
    name: str,
    carriers: list[Carrier],
    carried: list[int | None],
    P: Floats,
    C: Floats,
    L: Floats,
    q: Floats,
    T: Floats,
    R: Floats,
    at_home: Floats,
    *,
    zero_is_home: bool,
    mass: float = 2.0,
) -> str:
    """URDF of a machine with six rods; rods without a carrier are legs of variable length, on the base.

    Joints are named against the order of q, odd loops are written the other way round, frames are turned, and the TCP is
    not the platform's frame: nothing of that may matter.
    """
    tcp = (np.array([0.01, -0.02, 0.05]), np.array([0.1, 0.2, -0.3]))  # in the platform's frame
    tcp_R = rpy_matrix(tcp[1])
    platform_R = R @ tcp_R.T
    platform_T = T - platform_R @ tcp[0]
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    out = [f'<robot name="{name}">', '<link name="base"/>', '<link name="platform"><inertial>']
    out += [
        f'<origin xyz="0.01 0.02 -0.03"/><mass value="{3.0 * mass}"/>{inertia}</inertial></link>',
        '<link name="tcp"/>',
    ]
    origin = placed(platform_T, platform_R) if zero_is_home else ""
    out.append(f'<joint name="floats" type="floating"><parent link="base"/><child link="platform"/>{origin}</joint>')
    out.append(
        f'<joint name="tcp_mount" type="fixed"><parent link="platform"/><child link="tcp"/>{placed(tcp[0], tcp_R)}</joint>'
    )
    actuators = []
    limit = '<limit lower="-0.9" upper="1.1" effort="10" velocity="1"/>'
    for k, carrier in enumerate(carriers):
        joint = f"drive_{chr(ord('z') - k)}"
        actuators.append((joint, f"cart{k + 1}"))
        out.append(f'<link name="cart{k + 1}"><inertial><mass value="{mass}"/>')
        out.append(
            f'<origin xyz="{text(carrier.frame.T @ (C[carried.index(k)] - carrier.point) / 2)}"/>{inertia}</inertial></link>'
        )
        out.append(f'<joint name="{joint}" type="{carrier.kind}"><parent link="base"/><child link="cart{k + 1}"/>')
        out.append(placed(carrier.point, carrier.frame) + f'<axis xyz="{text(2.0 * carrier.frame.T @ carrier.axis)}"/>')
        out.append(("" if carrier.kind == "continuous" else limit) + "</joint>")
    for i in range(6):
        link, at = f"link{i + 1}", tcp_R @ P[i] + tcp[0]
        z = platform_R.T @ (at_home[i] - T - R @ P[i])
        axes = along_z(z / np.linalg.norm(z))
        passive = '<limit lower="-1.5" upper="1.5" effort="0" velocity="9"/></joint>'
        out.append(f'<link name="{link}_cross"/><joint name="{link}_pitch" type="revolute"><parent link="platform"/>')
        out.append(f'<child link="{link}_cross"/>{placed(at, axes)}<axis xyz="1 0 0"/>{passive}')
        body = f'<inertial><origin xyz="0 0 {0.4 * L[i]}"/><mass value="{0.2 * mass}"/>{inertia}</inertial></link>'
        hung = link if carried[i] is not None else f"{link}_tube"
        out.append(f'<link name="{hung}">{body}<joint name="{link}_yaw" type="revolute"><parent link="{link}_cross"/>')
        out.append(f'<child link="{hung}"/><axis xyz="0 1 0"/>{passive}')
        tip = float(L[i])
        if carried[i] is None:
            joint = f"leg_{chr(ord('z') - i)}"
            actuators.append((joint, f"leg{i + 1}"))
            out.append(f'<link name="{link}">{body}<joint name="{joint}" type="prismatic"><parent link="{hung}"/>')
            out.append(f'<child link="{link}"/><origin xyz="0 0 0.25"/><axis xyz="0 0 3"/>{limit}</joint>')
            tip -= 0.25
        carrier = None if carried[i] is None else carriers[carried[i]]
        seat = C[i] if carrier is None else carrier.frame.T @ (C[i] - carrier.point)
        seat_link = "base" if carrier is None else f"cart{carried[i] + 1}"  # type: ignore[operator]
        ends = [
            f'link="{link}" xyz="0 0 {tip!r}" rpy="0.3 -0.2 0.1"',
            f'link="{seat_link}" xyz="{text(seat)}" rpy="1 2 3"',
        ]
        first, second = ends if i % 2 == 0 else ends[::-1]
        out.append(f'<loop_joint name="ball{i + 1}" type="spherical"><link1 {first}/><link2 {second}/></loop_joint>')
    out.append("<gtpin>")
    out += [f'<actuator joint="{joint}" site="{site}"/>' for joint, site in actuators]
    out.append('<platform link="platform" tcp="tcp"/>')
    out += [f'<rod link="link{i + 1}" loop="ball{i + 1}" site="link{i + 1}"/>' for i in range(6)]
    rotvec = Rotation.from_matrix(R).as_rotvec()
    out.append(f'<home q="{text(q)}" tcp_xyz="{text(T)}" tcp_rotvec="{text(rotvec)}"/><gravity xyz="0.5 -0.3 -9.7"/>')
    out.append('<tolerance link_length="0.0005"/></gtpin></robot>')
    return "\n".join(out)


def text(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)


def placed(T: Floats, R: Floats) -> str:
    return f'<origin xyz="{text(T)}" rpy="{text(Rotation.from_matrix(R).as_euler("xyz"))}"/>'


def rpy_matrix(rpy: Floats) -> Floats:
    return Rotation.from_euler("xyz", rpy).as_matrix()


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
    **options: bool,
) -> Closures:
    """A machine whose rods are as long as its home needs them."""
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
    length = made.residual(q[None], T[None], R[None])[0]  # of rods that have none
    zero_is_home = options.get("zero_is_home", True)
    urdf = write(name, carriers, carried, P, C, length, q, T, R, made.C(q[None])[0], zero_is_home=zero_is_home)
    return replace(made, L0=length, urdf=urdf)


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
    frames = [rpy_matrix(np.array([0.3, -0.4, 0.5 * k])) for k in range(3)]
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
