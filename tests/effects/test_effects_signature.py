"""An effect's signature is the derivative of its exact application, and its application is Pinocchio's closed chain."""

from functools import cache

import numpy as np
import pytest
from effect_places import (
    ARM_FIT,
    EFFECTS,
    FIT,
    GEOMETRY,
    ROBOT,
    active,
    applied,
    arm_points,
    basis,
    displaced,
    drawn,
    moved,
    operating_points,
    some,
)
from scipy.spatial.transform import Rotation
from test_effects_loops import parallelogram

import gtpin
from gtpin.effects.operating_points import OperatingPoints
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription

OTHERS = ["tau", "stewart", "linear_delta", "gantry_tau_6dof"]
slow = pytest.mark.slow


@cache
def machine(name: str) -> OperatingPoints:
    """Commands of a machine at which effects show."""
    if name == "arm":
        return arm_points(6, seed=1, fixed=ARM_FIT.references)
    if name == "gantry_tau":
        return operating_points(8, seed=1, fixed=FIT.references)
    return operating_points(6, seed=1, kinematics=drawn(parallelogram() if name == "parallelogram" else name))


@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("name", ["gantry_tau", "arm", "parallelogram", *(pytest.param(o, marks=slow) for o in OTHERS)])
def test_the_signature_is_the_derivative_of_the_exact_application(name: str, effect: str) -> None:
    at = machine(name)
    assert at.poses.reached.all()
    size, within = (1.0, 1e-6) if name == "gantry_tau" else (0.1, 1e-5)
    for site in EFFECTS[effect].sites(at.robot):
        if not set(EFFECTS[effect].covariates(at.robot, site)) <= set(at.covariates):
            continue
        c = size * some(effect, site, at)
        predicted = basis(effect, site, at).displacement(at) @ c
        forth, back, none = (moved(at, active(effect, site, s * c, at.references)) for s in (1, -1, 0))
        atol = within * np.abs(predicted).max() + 1e-12
        np.testing.assert_allclose((forth - back) / 2.0, predicted, rtol=0, atol=atol, err_msg=site)
        np.testing.assert_allclose(none, 0.0, rtol=0, atol=1e-13)
        assert np.abs(predicted).max() > 0.0 or name in OTHERS or (effect, site) == ("cart_rotation", "cart1")


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
    at = operating_points(3, seed=2, fixed=FIT.references)
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
    at = operating_points(6, seed=4, fixed=FIT.references)
    effects = [
        active(n, s, some(n, s, at))
        for n, s in (("linearity", "cart2"), ("backlash", "cart2"), ("thermal_links", "arm"))
    ]
    together, apart = moved(at, *effects), sum(moved(at, effect) for effect in effects)
    np.testing.assert_allclose(together, apart, rtol=0, atol=2e-3 * np.abs(apart).max())
