"""Every instrument's derivatives are those of its prediction, by finite differences."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import gtpin
from gtpin.data.instrument_tables import TABLES
from gtpin.instruments import BUILT_IN, Encoder, Instrument, Socket, Tracker
from gtpin.instruments.instrument import Read
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, from_quaternions, to_quaternions
from gtpin.robot.description import RobotDescription

Floats = npt.NDArray[np.float64]

COUNT = 12
STEP = 1e-6


def _robot() -> gtpin.Robot:
    """A crank that moves a slider along x, in a tilted field of gravity: one passive joint turns, one slides."""
    joints = "".join(
        f'<link name="{child}"/><joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for child, parent, kind, x, axis in (
            ("crank", "base", "revolute", 0.0, "0 0 1"),
            ("coupler", "crank", "continuous", 0.1, "0 0 1"),
            ("slider", "base", "prismatic", 0.4, "1 0 0"),
        )
    )
    loop = '<loop_joint name="pin"><link1 link="coupler" xyz="0.3 0 0"/><link2 link="slider" xyz="0 0 0"/></loop_joint>'
    own = '<gtpin><actuator joint="crank_joint"/><platform link="coupler"/><gravity xyz="0 -5.886 -7.848"/></gtpin>'
    return gtpin.Robot(RobotDescription.parse(f'<robot name="slider"><link name="base"/>{joints}{loop}{own}</robot>'))


def _poses(rng: np.random.Generator) -> Poses:
    T, R = rng.normal(0.0, 0.5, (COUNT, 3)), exp(rng.normal(0.0, 0.7, (COUNT, 3)))
    joints = {joint: rng.normal(0.0, 0.5, COUNT) for joint in ("slider_joint", "coupler_joint")}
    return Poses(T, R, joints, links={link: exp(rng.normal(0.0, 0.7, (COUNT, 3))) for link in ("base", "crank")})


def _ids(*names: str) -> npt.NDArray[np.object_]:
    return np.array([names[i % len(names)] for i in range(COUNT)], dtype=object)


def _tables(rng: np.random.Generator) -> dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]]:
    """By name: what dataset.toml says, columns of numbers, and columns of ids."""
    targets = {"target_sigma": 1e-4, "targets": {"T": (0.05, 0.0, -0.1), "U": (0.0, 0.04, 0.0)}}
    wxyz = to_quaternions(exp(rng.normal(0.0, 0.7, (COUNT, 3))))
    position = {axis: rng.normal(0.0, 1.0, COUNT) for axis in "xyz"}
    turned = position | dict(zip(("qw", "qx", "qy", "qz"), wxyz.T, strict=True))
    of_target = {"target": _ids("T", "U", "T")}
    return {
        "range": (
            {"kind": "range", "stations": {"A": (2.0, 0.1, 0.3), "B": (-1.0, 2.0, 0.5)}, "offset_sigma": 1e-3}
            | targets,
            {"range": rng.uniform(1.0, 3.0, COUNT)},
            of_target | {"station": _ids("A", "B")},
        ),
        "plane": (
            {
                "kind": "plane",
                "planes": {
                    "P": {"point": (0.1, 0.2, -0.3), "normal": (0.0, 0.1, 1.0)},
                    "Q": {"point": (0.0, 0.0, 0.3), "normal": (1.0, 0.2, -0.4)},
                },
            }
            | targets,
            {"height": rng.normal(0.0, 1e-3, COUNT)},
            of_target | {"plane": _ids("P", "P", "Q")},
        ),
        "socket": (
            {
                "kind": "socket",
                "sockets": {"S": (0.1, 0.2, 0.3)},
                "socket_sigma": 1e-3,
                "distances": (("S", "R", 0.05, 5e-5),),
            }
            | targets,
            {},
            of_target | {"socket": _ids("S", "R", "R")},
        ),
        "tilt": (
            {"kind": "tilt"},
            {"tilt_x": rng.normal(0.0, 0.1, COUNT), "tilt_y": rng.normal(0.0, 0.1, COUNT)},
            {},
        ),
        "tilt of a link": (
            {"kind": "tilt", "link": "crank"},
            {"tilt_x": rng.normal(0.0, 0.1, COUNT), "tilt_y": rng.normal(0.0, 0.1, COUNT)},
            {},
        ),
        "encoder, turning": (
            {"kind": "encoder", "joint": "coupler_joint"},
            {"reading": rng.normal(0.0, 0.5, COUNT) + 2.0 * np.pi * rng.integers(-1, 2, COUNT)},
            {},
        ),
        "encoder, sliding": (
            {"kind": "encoder", "joint": "slider_joint"},
            {"reading": rng.normal(0.0, 0.1, COUNT)},
            {},
        ),
        "tracker, targets": ({"kind": "tracker", "frame": "free"} | targets, position, of_target),
        "tracker, all free": ({"kind": "tracker", "frame": "free", "target": "free"}, turned, {}),
        "tracker, orientations": ({"kind": "tracker", "target_sigma": 1e-3}, turned, {}),
        "tracker, stations": (
            {"kind": "tracker", "stations": "session"} | targets,
            position,
            of_target | {"session": _ids("S2", "S1", "S2", "S3")},
        ),
        "tracker, stations, free target": (
            {"kind": "tracker", "stations": "session", "target": "free"},
            turned,
            {"session": _ids("S2", "S1", "S2", "S3")},
        ),
    }


def instrument(name: str) -> tuple[Instrument, Poses, Floats]:
    rng = np.random.default_rng(3)
    said, numbers, ids = _tables(rng)[name]
    table = TABLES[said["kind"]].model_validate(said | {"name": "one"})
    known = {column: tuple(dict.fromkeys(map(str, values))) for column, values in ids.items()}
    read = Read(numbers, ids, np.full(COUNT, -1), known)
    one = BUILT_IN[said["kind"]](table, read, _robot())
    u = rng.normal(0.0, 0.05, len(one.unknowns))
    return one, _poses(rng), u


NAMES = tuple(_tables(np.random.default_rng(0)))


def test_poses_near_those_that_were_read_leave_no_orientation() -> None:
    for name in ("tracker, all free", "tracker, orientations", "tracker, stations, free target"):
        one, poses, u = instrument(name)
        assert isinstance(one, Tracker)
        assert np.abs(one.residual_at(_near(one, poses, u), u)[:, 3:]).max() < 1e-12


def moved(by: str, poses: Poses, u: Floats, i: int, size: float) -> tuple[Poses, Floats]:
    """Poses and unknowns with the i-th coordinate of what is derived by larger by ``size``."""
    if by == "by_unknown":
        return poses, u + size * np.eye(len(u))[i]
    if by == "by_joints":
        joint = list(poses.joints)[i]
        return replace(poses, joints={**poses.joints, joint: poses.joints[joint] + size}), u
    if by == "by_links":
        link, turn = list(poses.links)[i // 3], exp(size * np.eye(3)[i % 3])
        return replace(poses, links={**poses.links, link: turn @ poses.links[link]}), u
    step = size * np.eye(6)[i]
    return replace(poses, T=poses.T + step[:3], R=exp(step[3:]) @ poses.R), u


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("by", ["by_pose", "by_links", "by_joints", "by_unknown"])
def test_derivatives_are_those_of_the_prediction(name: str, by: str) -> None:
    one, poses, u = instrument(name)
    if isinstance(one, Tracker) and one.turned:
        poses = _near(one, poses, u)
    assert len(u)
    found = getattr(one, by)(poses, u)
    sizes = {"by_pose": 6, "by_links": 3 * len(poses.links), "by_joints": len(poses.joints)}
    expected = np.empty((COUNT, len(one.components), sizes.get(by, len(u))))
    for i in range(expected.shape[2]):
        both = [one.residual_at(*moved(by, poses, u, i, s * STEP)) for s in (-1.0, 1.0)]
        expected[:, :, i] = (both[0] - both[1]) / (2.0 * STEP)
    assert np.abs(found - expected).max() < 2e-8
    assert by != "by_joints" or expected.any() == isinstance(one, Encoder)
    assert by != "by_links" or expected.any() == (name == "tilt of a link")


def _near(one: Tracker, poses: Poses, u: Floats) -> Poses:
    """Poses at which the tracker would read the orientations that it has read, as a fit's are."""
    read = from_quaternions(np.column_stack([one.read.numbers[name] for name in ("qw", "qx", "qy", "qz")]))
    # It reads F R M, and so F M at R = 1 and, with the mount M alone unknown, M.
    still = Poses(poses.T, np.broadcast_to(np.eye(3), (COUNT, 3, 3)))
    free = one.table.frame == "free"
    both = one.orientations(still, u)
    frames = 6 * len({*one.read.known.get("session", ("",))}) if free else 0
    mount = one.orientations(still, np.concatenate([u[:-frames], np.zeros(frames)])) if free else both
    frame = both @ np.swapaxes(mount, 1, 2)
    return replace(poses, R=np.swapaxes(frame, 1, 2) @ read @ np.swapaxes(mount, 1, 2))


@pytest.mark.parametrize("rows", [[], [4], range(COUNT)], ids=["no row", "one row", "all rows"])
@pytest.mark.parametrize("name", NAMES)
def test_what_a_part_of_the_rows_gives_is_that_part_of_what_all_give(name: str, rows: list[int]) -> None:
    whole, poses, u = instrument(name)
    mine = np.array(rows, dtype=int)
    # Known distances are given to rows before these are divided.
    numbers = whole.read.numbers | ({"link": whole.link} if isinstance(whole, Socket) else {})
    cut = {key: column[mine] for key, column in numbers.items()}
    ids = {key: column[mine] for key, column in whole.read.ids.items()}
    part = type(whole)(whole.table, Read(cut, ids, whole.read.component[mine], whole.read.known), whole.robot)
    there = poses[mine]
    assert part.unknowns == whole.unknowns
    assert part.components == whole.components
    assert part.declared == whole.declared
    assert part.start(there).shape == u.shape
    for of in ("measured", "read_components", "counted"):
        assert getattr(part, of)().shape == (len(mine), len(whole.components)), of
    for of in ("predicted", "residual_at", "by_pose", "by_links", "by_joints", "by_unknown", "looked_at"):
        np.testing.assert_allclose(getattr(part, of)(there, u), getattr(whole, of)(poses, u)[mine], atol=1e-12)
    sigmas = whole.row_sigmas()
    assert sigmas is None or part.row_sigmas().shape == (len(mine), sigmas.shape[1])
