"""Random geometries within the tolerances: arrays, Pinocchio on the exported URDF, and scipy's fsolve."""

from dataclasses import dataclass

import numpy as np
import pytest
from closures import read
from loaded_machines import drawn
from quick_first import quick_first

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription

Floats = np.ndarray


def agree(geometry: gtpin.Geometry, q: Floats, within: float) -> None:
    """Arrays of a geometry, and Pinocchio on the URDF that carries it, give the same poses."""
    poses = Kinematics(geometry).forward(q)
    posture = gtpin.home(gtpin.Robot(RobotDescription.parse(calibrated_urdf(gtpin.Model(geometry)))))
    for i, row in enumerate(q):
        there = posture.moved_to(row)
        assert np.abs(there.T - poses.T[i]).max() <= within
        assert np.abs(log(there.R @ poses.R[i].T)).max() <= within


@pytest.mark.parametrize("seed", quick_first(range(12), 4))
def test_arrays_agree_with_pinocchio_for_random_geometries(robot: gtpin.Robot, seed: int) -> None:
    q = np.random.default_rng(100 + seed).uniform(robot.lower, robot.upper, (25, 3))
    nominal = gtpin.Geometry.nominal(robot)
    wide = 2.0 * nominal.tolerance * np.random.default_rng(seed).standard_normal(len(nominal.values))
    agree(nominal.with_values(nominal.values + wide), q, 1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_both_agree_with_fsolve_on_the_numbers_of_the_exported_urdf(robot: gtpin.Robot, seed: int) -> None:
    geometry = drawn(robot, 50 + seed)
    closures = read(calibrated_urdf(gtpin.Model(geometry)))
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper, (15, 3))
    poses = Kinematics(geometry).forward(q)
    near_T, near_R = closures.follow(q, stride=0.05)
    for i, row in enumerate(q):
        rng = np.random.default_rng(i)
        T, R, closed = closures.fsolve(row, near_T[i] + rng.uniform(-0.01, 0.01, 3), near_R[i])
        assert closed
        assert np.abs(T - poses.T[i]).max() <= 1e-11
        assert np.abs(log(R @ poses.R[i].T)).max() <= 1e-11


@dataclass(frozen=True)
class Rods:
    """At all commands 0 and at all commands 0.5: joints on the platform, TCP frame, and on the carts, base frame (2, 6, 3), and
    lengths (2, 6), m; v (6, 3): travel of the joints on the carts per metre of the commands."""

    P: Floats
    C: Floats
    L: Floats
    v: Floats


def rods_of(geometry: gtpin.Geometry) -> Rods:
    here, q = Kinematics(geometry), np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
    poses = here.forward(q)
    ends, C = here.rod_ends(q, poses)
    P = np.einsum("nji,nkj->nki", poses.R, ends - poses.T[:, None])
    return Rods(P, C, np.linalg.norm(ends - C, axis=2), (C[1] - C[0]) / 0.5)


def test_parameters_move_what_their_names_say(robot: gtpin.Robot) -> None:
    nominal = gtpin.Geometry.nominal(robot, scale="actuator")
    moved = nominal.values.copy()
    for name, by in {
        "length[2a]": 1e-3,
        "platform_joint[3b].y": 2e-3,
        "cart_joint[1].z": -3e-3,
        "scale[cart2]": 1e-4,
    }.items():
        moved[nominal.names.index(name)] += by
    before, after = rods_of(nominal), rods_of(nominal.with_values(moved))
    np.testing.assert_allclose(after.L - before.L, np.tile([0, 1e-3, 0, 0, 0, 0], (2, 1)), rtol=0, atol=1e-13)
    expected = np.zeros((2, 6, 3))
    expected[:, 4, 1] = 2e-3
    np.testing.assert_allclose(after.P - before.P, expected, rtol=0, atol=1e-13)
    expected = np.zeros((6, 3))
    expected[0, 2] = -3e-3
    np.testing.assert_allclose(after.C[0] - before.C[0], expected, rtol=0, atol=1e-13)
    # A scale is travel per commanded metre, of one cart alone.
    travel = (after.C[1] - after.C[0]) - (before.C[1] - before.C[0])
    np.testing.assert_allclose(np.linalg.norm(travel, axis=1), [0, 5e-5, 5e-5, 0, 0, 0], rtol=0, atol=1e-12)


def test_track_directions_turn_and_stay_unit_vectors(robot: gtpin.Robot) -> None:
    nominal = gtpin.Geometry.nominal(robot)
    before = rods_of(nominal).v
    for name in ("track_direction[cart2].a", "track_direction[cart2].b"):
        moved = nominal.values.copy()
        moved[nominal.names.index(name)] += 1e-3
        after = rods_of(nominal.with_values(moved)).v
        np.testing.assert_allclose(np.linalg.norm(after, axis=1), 1.0, rtol=0, atol=1e-13)
        turned = np.arccos(np.clip(np.einsum("ki,ki->k", before, after), -1, 1))
        np.testing.assert_allclose(turned, [0, 1e-3, 1e-3, 0, 0, 0], atol=1e-7)


def test_the_default_set_is_48_parameters(robot: gtpin.Robot) -> None:
    default = gtpin.Geometry.nominal(robot).names
    rods = ("1", "2a", "2b", "3a", "3b", "3c")
    expected = {f"length[{r}]" for r in rods}
    expected |= {f"{kind}[{r}].{x}" for kind in ("platform_joint", "cart_joint") for r in rods for x in "xyz"}
    expected |= {f"track_direction[cart{k}].{x}" for k in (1, 2, 3) for x in "ab"}
    assert set(default) == expected
    assert len(default) == 48
    assert len(gtpin.Geometry.nominal(robot, without=["track_direction", "length[2a]"]).names) == 41
