"""Effects that a geometry beyond its tolerances could follow, and parts that are far off, by statics of the tests."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Floats, nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation
from test_further_load import tensions

import gtpin
from gtpin.errors import GtpinWarning

POSES = 70


def soft_rod(seed: int, rod: str, gives: float) -> gtpin.Dataset:
    """Poses of a Gantry-Tau with one rod that gives way by ``gives``, m/N, within its tolerances."""
    rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
    machine = plain.off({name: rng.normal(0.0, size) for name, size in plain.parameters().items()})
    q, mass = machine.in_range(rng, POSES), rng.choice([0.0, 5.0, 10.0], POSES)
    T, R = machine.follow(q, 0.02)
    longer = np.zeros((POSES, 6))
    longer[:, machine.rod(rod)] = gives * tensions(machine, q, mass, T, R)[:, machine.rod(rod)]
    T, R = replace(machine, L0=machine.L0 + longer).close(q, T, R)
    return measured("gantry_tau", rng, q, T, R, {"payload": mass})


def arm(
    seed: int, q: Floats, part: float = 0.0, wave: float = 0.0, tolerance: float = 2e-4, free: bool = False
) -> gtpin.Dataset:
    """Poses of a UR5 near nominal, m and rad.

    ``part``: how much farther the elbow sits along its axis, m. ``wave``: error of the last joint, rad, with eight waves a
    radian of the joint before it, through which it is driven.
    """
    rng, robot = np.random.default_rng(seed), gtpin.load_robot("ur5")
    model, off = robot.model.copy(), rng.normal(0.0, tolerance, (robot.model.njoints, 6))
    off[model.getJointId("elbow_joint"), 2] += part
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(off[joint])
    data, places, there = model.createData(), [], q.copy()
    there[:, 5] += wave * np.cos(8.0 * q[:, 4] + rng.uniform(0.0, 6.0))
    for row in there:
        pin.framesForwardKinematics(model, data, row)
        places.append(data.oMf[model.getFrameId(robot.tcp_frame)].copy())
    T, R = np.array([M.translation for M in places]), np.array([M.rotation for M in places])
    return measured("ur5", rng, q, T, R, {}, free)


def measured(
    robot: str,
    rng: np.random.Generator,
    q: Floats,
    T: Floats,
    R: Floats,
    covariates: dict[str, Floats],
    free: bool = False,
) -> gtpin.Dataset:
    noise = rng.standard_normal((len(q), 6)) * np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
    turned = (Rotation.from_rotvec(noise[:, 3:]) * Rotation.from_matrix(R)).as_quat(scalar_first=True)
    instrument = {"position_sigma": POSITION_SIGMA, "orientation_sigma": ORIENTATION_SIGMA}
    instrument |= {"frame": "free"} if free else {}
    return gtpin.Dataset(
        robot, np.array([f"p{n}" for n in range(len(q))]), q, T + noise[:, :3], turned, covariates, instrument
    )


SMALL = np.array([-0.4, -1.0, 1.3, -0.05, 1.2, 0.6])
"""The middle of a small region, rad."""


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_wrist_whose_joint_is_driven_through_another_is_no_joint_that_is_turned(seed: int) -> None:
    q = SMALL + np.random.default_rng(seed).uniform(-0.2, 0.2, (120, 6))
    found = quietly(gtpin.diagnose, arm(seed, q, wave=2e-3, tolerance=4e-4, free=True))
    assert [(cause.effect, cause.site) for cause in found.causes][:1] == [("cross_coupling", "wrist_3_joint")]
    geometry = found.model.geometry
    assert not geometry.is_widened
    assert np.abs(geometry.deviation / geometry.declared_tolerance).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("rod", ["link2b", "link3a"])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_data_are_not_refused_for_a_geometry_that_only_wider_tolerances_move_far(seed: int, rod: str) -> None:
    found = quietly(gtpin.calibrate, soft_rod(seed, rod, 3e-5))
    assert max(abs(p.nominal - found[p.name].value) for p in found.model.geometry.parameters) < 0.05


def test_a_part_that_is_far_off_stays_a_part() -> None:
    with pytest.warns(GtpinWarning, match=r"placement\[elbow_joint\].z"):
        found = gtpin.diagnose(arm(1, np.random.default_rng(1).uniform(-2.0, 2.0, (POSES, 6)), part=0.012))
    assert found.verdict == "none"
    off = found.model.geometry.deviation[found.model.geometry.names.index("placement[elbow_joint].z")]
    assert off == pytest.approx(0.012, abs=1e-3)
