"""A gear's line, and play, beside an error of the whole workspace that no effect describes: a UR5 by Pinocchio alone."""

import numpy as np
import pinocchio as pin
import pytest
from diagnosed import quietly

import gtpin

pytestmark = pytest.mark.slow

POSES, SIGMA = 220, 6e-5


def measured(seed: int, line: float = 0.0, play: float = 0.0) -> gtpin.Dataset:
    """Positions of a machine within its tolerances, in a space that an unlisted field distorts by .3 mm.

    ``line``: error of the elbow, rad, with 38 periods a turn. ``play``: of the first wrist joint, rad to either side.
    """
    rng, robot = np.random.default_rng(seed), gtpin.load_robot("ur5")
    model, off = robot.model.copy(), rng.normal(0.0, 2e-4, (robot.model.njoints, 6))
    q, approach = rng.uniform(-1.5, 1.5, (POSES, 6)), rng.choice([-1.0, 1.0], (POSES, 6))
    for joint in range(1, model.njoints):
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(off[joint])
    there = q.copy()
    there[:, 2] += line * np.cos(38.0 * q[:, 2] + rng.uniform(0.0, 6.0))
    there[:, 3] += play * approach[:, 3]
    data, T = model.createData(), np.zeros((POSES, 3))
    for row, one in zip(T, there, strict=True):
        pin.framesForwardKinematics(model, data, one)
        row[:] = data.oMf[model.getFrameId(robot.tcp_frame)].translation
    x, y, z = T.T
    T = T + 3e-4 * np.stack([np.sin(4.0 * y + 1.0), np.cos(3.0 * x * z), np.sin(3.0 * x + 2.0 * y)], axis=1)
    moves = {f"approach{k + 1}": approach[:, k] for k in range(6)} if play else {}
    ids, noise = np.array([f"p{n}" for n in range(POSES)]), rng.normal(0.0, SIGMA, T.shape)
    return gtpin.Dataset("ur5", ids, q, T + noise, None, moves, {"position_sigma": SIGMA})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_gear_s_line_is_named_beside_an_unknown_field(seed: int) -> None:
    found = quietly(gtpin.diagnose, measured(seed, line=6e-4))
    assert found.verdict == "unknown"
    assert [(c.effect, c.site) for c in found.causes if c.probability >= 0.9] == [("rack_periodic", "elbow_joint")]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_play_is_named_beside_an_unknown_field(seed: int) -> None:
    found = quietly(gtpin.diagnose, measured(seed, play=1.2e-3))
    assert found.verdict == "unknown"
    assert [(c.effect, c.site) for c in found.causes] == [("backlash", "wrist_1_joint")]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_field_alone_is_no_line(seed: int) -> None:
    found = quietly(gtpin.diagnose, measured(seed))
    assert (found.verdict, found.causes) == ("unknown", ())
