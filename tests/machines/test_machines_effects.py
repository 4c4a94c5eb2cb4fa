"""Effects speak each machine's own names, and act on legs and arms as they do on carts."""

import numpy as np
import pytest
from family import NAMES, nominal

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.situation import Situation
from gtpin.kinematics.rod_kinematics import RodKinematics

DRIVES = ("encoder_scale", "linearity", "rack_periodic", "rack_step", "zero_shift", "backlash", "servo_lag")
GUIDES = ("straightness", "cart_rotation", "cart_compliance")
LINKS = ("joint_clearance", "joint_runout")


@pytest.mark.parametrize("name", NAMES)
def test_sites_are_the_machine_s_own_parts(name: str) -> None:
    robot, closures = gtpin.load_robot(name), nominal(name)
    sites = {effect: known.sites(robot) for effect, known in effects_by_id().items()}
    for effect in (*DRIVES, "cross_coupling", "thermal_track"):
        assert sites[effect] == closures.sites, effect
    for effect in GUIDES:
        assert sites[effect] == (closures.sites if closures.kind == "track" else ()), effect
    for effect in LINKS:
        assert sites[effect] == closures.rods, effect
    for effect in ("link_compliance", "thermal_links"):
        assert sites[effect] == ("arm", *closures.rods), effect
    for effect in ("tracker_drift", "frame_shift", "tracker_scale"):
        assert sites[effect] == ("frame",), effect
    assert sites["target_offset"] == ("platform",)


@pytest.mark.parametrize("name", ["stewart", "stewart_jugglebot"])
def test_a_drive_s_error_is_a_leg_s_error_in_length(name: str) -> None:
    """The leg's length by its ends, with the error, is the length without it and the error."""
    closures, rng = nominal(name), np.random.default_rng(0)
    kinematics = RodKinematics(gtpin.Geometry.nominal(gtpin.load_robot(name)))
    q = closures.commands(rng, 40)
    session = np.array([f"day{i % 2}" for i in range(len(q))], dtype=object)
    at = Situation(kinematics, q, kinematics.forward(q), {"session": session})
    sizes = {"encoder_scale": 1e-3, "zero_shift": 5e-4}
    for effect, size in sizes.items():
        known = effects_by_id()[effect]
        coefficients = np.zeros(len(known.basis(at, "leg3")))
        coefficients[0] = size
        acting = ActiveEffect(known, "leg3", None, coefficients, np.zeros((len(coefficients),) * 2), at.references)
        poses = with_effects(kinematics, q, at.covariates, [acting])
        error = size * (q[:, 2] if effect == "encoder_scale" else (session == "day0"))
        gap = closures.gap(q, poses.T, poses.R)
        np.testing.assert_allclose(gap[:, 2], error, rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.delete(gap, 2, axis=1), 0.0, atol=1e-12)


def test_an_arm_s_error_is_an_angle() -> None:
    closures = nominal("tau")
    kinematics = RodKinematics(gtpin.Geometry.nominal(gtpin.load_robot("tau")))
    q = closures.commands(np.random.default_rng(1), 40)
    at = Situation(kinematics, q, kinematics.forward(q), {})
    known = effects_by_id()["encoder_scale"]
    coefficients = np.zeros(len(known.basis(at, "arm2")))
    coefficients[0] = 1e-3
    acting = ActiveEffect(known, "arm2", None, coefficients, np.zeros((len(coefficients),) * 2), at.references)
    poses = with_effects(kinematics, q, {}, [acting])
    np.testing.assert_allclose(closures.gap(q * [1.0, 1.001, 1.0], poses.T, poses.R), 0.0, atol=1e-12)
