"""URDFs of small machines, written part by part, and where two circles cross, which closes planar ones by hand."""

from collections.abc import Iterable

import numpy as np

import gtpin
from gtpin.robot.description import RobotDescription


def joint(
    name: str,
    parent: str,
    child: str,
    xyz: str = "0 0 0",
    axis: str = "0 0 1",
    *,
    kind: str = "revolute",
    rpy: str = "0 0 0",
    limit: float | tuple[float, float] = 1.0,
    inside: str = "",
    body: str = "",
) -> str:
    """A link and the joint that carries it; ``inside`` the joint and in the ``body`` of the link are further elements."""
    link = f'<link name="{child}">{body}</link>' if body else f'<link name="{child}"/>'
    low, high = limit if isinstance(limit, tuple) else (-limit, limit)
    moves = f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="1" velocity="1"/>'
    return (
        f'{link}<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{"" if kind in ("fixed", "floating") else moves}{inside}</joint>'
    )


def loop(first: str, xyz1: str, second: str, xyz2: str, name: str = "pin") -> str:
    ends = f'<link1 link="{first}" xyz="{xyz1}"/><link2 link="{second}" xyz="{xyz2}"/>'
    return f'<loop_joint name="{name}" type="spherical">{ends}</loop_joint>'


def own(actuators: Iterable[str], platform: str = "", more: str = "") -> str:
    driven = "".join(f'<actuator joint="{name}"/>' for name in actuators)
    tcp = f'<platform link="{platform}"/>' if platform else ""
    return f"<gtpin>{driven}{tcp}{more}</gtpin>"


def urdf(name: str, *parts: str) -> str:
    """The parts beside a link ``base``."""
    return f'<robot name="{name}"><link name="base"/>{"".join(parts)}</robot>'


def robot_of(name: str, *parts: str) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(urdf(name, *parts)))


def crossing(one: np.ndarray, r1: float, other: np.ndarray, r2: float, side: float = 1.0) -> np.ndarray:
    """(..., 2) where circles about points (..., 2) cross: +1 left, -1 right of the way from one to the other; NaN: nowhere."""
    way = other - one
    apart = np.linalg.norm(way, axis=-1, keepdims=True)
    along = (apart**2 + r1**2 - r2**2) / (2.0 * apart)
    with np.errstate(invalid="ignore"):
        across = side * np.sqrt(r1**2 - along**2)
    return one + (along * way + across * np.stack([-way[..., 1], way[..., 0]], axis=-1)) / apart
