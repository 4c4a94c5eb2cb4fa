"""An effect's signature is the derivative of its exact application, and its application is Pinocchio's closed chain."""

from __future__ import annotations

import numpy as np
import pytest
from effect_places import (
    EFFECTS,
    FIT,
    GEOMETRY,
    PLACES,
    ROBOT,
    active,
    applied,
    basis,
    displaced,
    drawn,
    moved,
    situation,
    some,
)
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription

OTHERS = ["tau", "stewart", "linear_delta", "gantry_tau_6dof"]


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_the_signature_is_the_derivative_of_the_exact_application(name: str, site: str) -> None:
    at = situation(8, seed=1, fixed=FIT.references)
    found = basis(name, site, at)
    for seed in (3, 4):
        c = some(name, site, at, seed)
        predicted = found.displacement(at) @ c
        forth, back = applied(at, active(name, site, c)), applied(at, active(name, site, -c))
        np.testing.assert_allclose(
            forth.minus(back) / 2.0, predicted, rtol=0, atol=1e-6 * np.abs(predicted).max() + 1e-13
        )


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_coefficients_of_zero_change_nothing(name: str, site: str) -> None:
    at = situation(8, seed=1, fixed=FIT.references)
    left = applied(at, active(name, site, 0.0 * basis(name, site, at).sigma))
    np.testing.assert_allclose(left.minus(at.poses), 0.0, rtol=0, atol=1e-13)


def by_pinocchio(changes: dict[str, float], q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pose of the robot whose parameters were changed by hand, from Pinocchio's own closed posture."""
    values = GEOMETRY.values.copy()
    for parameter, change in changes.items():
        values[GEOMETRY.names.index(parameter)] += change
    urdf = calibrated_urdf(gtpin.Model(GEOMETRY.with_values(values)))
    posture = gtpin.home(gtpin.Robot(RobotDescription.parse(urdf, "changed"))).moved_to(q)
    return posture.T, posture.R


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.sites(ROBOT)])
def test_an_effect_moves_the_platform_as_pinocchio_does_when_joints_and_lengths_are_moved_by_hand(name: str) -> None:
    site = EFFECTS[name].sites(ROBOT)[min(1, len(EFFECTS[name].sites(ROBOT)) - 1)]
    at = situation(3, seed=2, fixed=FIT.references)
    c = 5.0 * some(name, site, at)
    reached, parts = applied(at, active(name, site, c)), displaced(at, name, site, c)
    changes = {}
    for i, rod in enumerate(ROBOT.rods):
        changes[f"length[{rod.name}]"] = float(parts.length[1, i])
        changes |= {f"cart_joint[{rod.name}].{axis}": float(s) for axis, s in zip("xyz", parts.seat[1, i], strict=True)}
    T, R = by_pinocchio(changes, at.q[1] + parts.command[1])
    np.testing.assert_allclose(reached.T[1], T + parts.twist[1, :3], rtol=0, atol=1e-11)
    seen = Rotation.from_rotvec(parts.twist[1, 3:]).as_matrix() @ R
    np.testing.assert_allclose(reached.R[1], seen, rtol=0, atol=1e-11)


def test_several_effects_are_applied_to_one_closed_chain() -> None:
    at = situation(6, seed=4, fixed=FIT.references)
    effects = [
        active(n, s, some(n, s, at))
        for n, s in (("linearity", "cart2"), ("backlash", "cart2"), ("thermal_links", "arm"))
    ]
    together, apart = moved(at, *effects), sum(moved(at, effect) for effect in effects)
    np.testing.assert_allclose(together, apart, rtol=0, atol=2e-3 * np.abs(apart).max())


@pytest.mark.slow
@pytest.mark.parametrize("robot", OTHERS)
def test_signatures_hold_on_other_machines(robot: str) -> None:
    kinematics = RodKinematics(drawn(robot))
    at = situation(6, seed=1, kinematics=kinematics)
    assert at.poses.reached.all()
    for name, effect in EFFECTS.items():
        for site in effect.sites(at.robot)[:2]:
            c = 0.1 * some(name, site, at)
            predicted = basis(name, site, at).displacement(at) @ c
            effects = [active(name, site, sign * c, at.references) for sign in (1.0, -1.0)]
            exact = applied(at, effects[0]).minus(applied(at, effects[1])) / 2.0
            assert np.isfinite(predicted).all()
            np.testing.assert_allclose(
                exact, predicted, rtol=0, atol=1e-5 * np.abs(predicted).max() + 1e-13, err_msg=f"{name}@{site}"
            )
