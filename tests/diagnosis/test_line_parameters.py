"""Amplitude and phase of a periodic error are stated with the uncertainty of its period."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest
from scipy.stats import chi2

import gtpin

NOISE, DRAWS, POSES, JOINT = 2e-5, 12, 120, 1
PHASE, PERIOD, AMPLITUDE = 0.8, 2.0 * np.pi / 3.0, 4e-4


@pytest.mark.slow
@pytest.mark.study
def test_phases_and_amplitudes_are_within_their_sigmas_of_the_truth() -> None:
    """Of a joint that moves far from zero: there the phase at zero depends most on the period."""
    robot = gtpin.load_robot("ur5")
    model = pin.buildModelFromXML(robot.description.xml)
    tool, data = model.getFrameId("tool0"), model.createData()
    off = []
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        q = rng.uniform(-2.0, 2.0, (POSES, 6))
        q[:, JOINT] = rng.uniform(-4.5, -1.0, POSES)
        moved, T = q.copy(), np.empty((POSES, 3))
        moved[:, JOINT] += AMPLITUDE * np.cos(2.0 * np.pi * q[:, JOINT] / PERIOD - PHASE)
        for i, row in enumerate(moved):
            pin.framesForwardKinematics(model, data, row)
            T[i] = data.oMf[tool].translation
        T += NOISE * rng.standard_normal(T.shape)
        dataset = gtpin.Dataset("ur5", [f"p{i}" for i in range(POSES)], q, T, instrument={"position_sigma": NOISE})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gtpin.GtpinWarning)
            found = gtpin.diagnose(dataset)
        (cause,) = (c for c in found.causes if (c.effect, c.site) == ("rack_periodic", "shoulder_lift_joint"))
        said = cause.parameters
        turned = (said["phase"].value - PHASE + np.pi) % (2.0 * np.pi) - np.pi
        off.append([turned / said["phase"].sigma, (said["amplitude"].value - AMPLITUDE) / said["amplitude"].sigma])
    for power in (np.array(off) ** 2).sum(axis=0):
        assert power < chi2.isf(1e-3, DRAWS)
