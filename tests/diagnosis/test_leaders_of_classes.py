"""The cause that a model has is the most probable of its class."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed, torques

import gtpin

NOISE, POSES, COMPLIANCE = 3e-5, 150, {1: 3e-6, 2: 6e-6}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_two_joints_that_give_way_lead_their_classes(seed: int) -> None:
    """By Pinocchio alone. The search's penalty of a second cause like the first does not let another effect lead."""
    robot = gtpin.load_robot("ur10")
    model = pin.buildModelFromXML(robot.description.xml)
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.0, 2.0, (POSES, 6))
    given, torque = q.copy(), torques(model, q)
    for joint, compliance in COMPLIANCE.items():
        given[:, joint] -= compliance * torque[:, joint]
    T = placed(model, given)[0] + NOISE * rng.standard_normal((POSES, 3))
    dataset = gtpin.Dataset("ur10", [f"p{i}" for i in range(POSES)], q, T, instrument={"position_sigma": NOISE})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(dataset, exclude=["link_compliance"])
    for cause in found.causes:
        assert cause.probability == max(member.probability for member in cause.members)
    by_site = {cause.site: cause for cause in found.causes if cause.effect == "joint_compliance"}
    for joint, compliance in COMPLIANCE.items():
        said = by_site[robot.sites[joint]].parameters["compliance"]
        assert abs(said.value - compliance) < 4.0 * said.sigma


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize(("waves", "size"), [(2.0, 1.2e-4), (1.0, 2e-4)])
@pytest.mark.parametrize("seed", range(3))
def test_a_wave_of_a_whole_or_half_a_turn_leads_its_class(waves: float, size: float, seed: int) -> None:
    """By Pinocchio alone: the range of the joint has less than two periods, and a smooth drive error looks like it."""
    robot = gtpin.load_robot("ur10")
    model, rng = pin.buildModelFromXML(robot.description.xml), np.random.default_rng([seed, 4])
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(rng.normal(0.0, 4e-4, 6))
    q = rng.uniform([-2.6, -2.4, -2.2, -2.5, -2.4, -2.8], [2.6, -0.4, 2.2, 2.5, 2.4, 2.8], (POSES, 6))
    given = q.copy()
    given[:, 1] += size * np.sin(waves * q[:, 1] + rng.uniform(0.0, 6.0))
    T = placed(model, given)[0] + NOISE * rng.standard_normal((POSES, 3))
    dataset = gtpin.Dataset("ur10", [f"p{i}" for i in range(POSES)], q, T, instrument={"position_sigma": NOISE})
    for cause in gtpin.diagnose(dataset).causes:
        assert cause.probability == max(member.probability for member in cause.members)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("seed", range(3))
def test_backlash_is_named_beside_a_cause_of_several_names_and_something_unknown(seed: int) -> None:
    """By Pinocchio alone: a joint that gives way, which a link and a bearing explain as well, and a wrist that errs by the
    difference of two others' angles, which nothing of the catalogue does."""
    robot = gtpin.load_robot("ur10")
    model = pin.buildModelFromXML(robot.description.xml)
    rng = np.random.default_rng([seed, 9])
    half = np.array([2.4, 0.7, 1.1, 1.5, 1.5, 2.4])
    q = np.array([0.0, -1.4, 1.2, 0.0, 0.0, 0.0]) + half * rng.uniform(-1.0, 1.0, (180, 6))
    approach, given = rng.choice([-1.0, 1.0], (180, 6)), q.copy()
    given[:, 1] -= 3e-6 * torques(model, q)[:, 1]
    given[:, 0] -= 1e-4 * approach[:, 0]
    given[:, 4] += 1e-3 * np.tanh(3.0 * np.sin(q[:, 5] - q[:, 3]))
    T = placed(model, given)[0] + NOISE * rng.standard_normal((180, 3))
    columns = {f"approach{j + 1}": approach[:, j] for j in range(6)}
    names = [f"p{i}" for i in range(180)]
    found = gtpin.diagnose(gtpin.Dataset("ur10", names, q, T, None, columns, {"position_sigma": NOISE}))
    likely = {(cause.effect, cause.site) for cause in found.causes if cause.probability > 0.8}
    assert ("backlash", "shoulder_pan_joint") in likely
