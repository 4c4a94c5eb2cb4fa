"""Amplitude and phase of a periodic error are stated with the uncertainty of its period."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed
from scipy.stats import chi2

import gtpin
from gtpin.estimate import Estimate

NOISE, DRAWS, POSES, JOINT = 2e-5, 12, 120, 1
PHASE, PERIOD, AMPLITUDE, ECCENTRIC = 0.8, 2.0 * np.pi / 3.0, 4e-4, 1e-3


def measured(seed: int, lower: float, upper: float, period: float, amplitude: float) -> gtpin.Dataset:
    """Poses of a UR5 by Pinocchio, one of whose joints has a periodic error and moves between two commands."""
    model = pin.buildModelFromXML(gtpin.load_robot("ur5").description.xml)
    rng = np.random.default_rng(seed)
    q = rng.uniform(-2.0, 2.0, (POSES, 6))
    q[:, JOINT] = rng.uniform(lower, upper, POSES)
    moved = q.copy()
    moved[:, JOINT] += amplitude * np.cos(2.0 * np.pi * q[:, JOINT] / period - PHASE)
    T = placed(model, moved)[0] + NOISE * rng.standard_normal((POSES, 3))
    return gtpin.Dataset("ur5", [f"p{i}" for i in range(POSES)], q, T, instrument={"position_sigma": NOISE})


def said_of(dataset: gtpin.Dataset) -> dict[str, Estimate]:
    """Parameters of the periodic error, wherever it stands in the class: of its largest line."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(dataset)
    members = [m for c in found.causes for m in c.members if m.site == "shoulder_lift_joint"]
    (own,) = (m.parameters for m in members if m.effect == "rack_periodic")
    line = max((name for name in own if name.startswith("amplitude")), key=lambda name: own[name].value)
    return {name: own[line.replace("amplitude", name)] for name in ("period", "amplitude", "phase")}


def off_by(said: dict[str, Estimate], amplitude: float) -> list[float]:
    """Phase and amplitude less the true ones, in sigmas."""
    turned = (said["phase"].value - PHASE + np.pi) % (2.0 * np.pi) - np.pi
    return [turned / said["phase"].sigma, (said["amplitude"].value - amplitude) / said["amplitude"].sigma]


@pytest.mark.slow
@pytest.mark.study
def test_phases_and_amplitudes_are_within_their_sigmas_of_the_truth() -> None:
    """Of a joint that moves far from zero: there the phase at zero depends most on the period."""
    draws = (measured(seed, -4.5, -1.0, PERIOD, AMPLITUDE) for seed in range(DRAWS))
    off = [off_by(said_of(one), AMPLITUDE) for one in draws]
    for power in (np.array(off) ** 2).sum(axis=0):
        assert power < chi2.isf(1e-3, DRAWS)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_amplitude_of_an_eccentricity_seen_over_a_third_of_a_turn_is_within_its_sigma(seed: int) -> None:
    """A period that the joint has not seen once: a larger amplitude with a longer period looks the same."""
    said = said_of(measured(seed, -2.4, -2.4 + np.radians(125.0), 2.0 * np.pi, ECCENTRIC))
    assert np.abs(off_by(said, ECCENTRIC)).max() < 2.6
    assert abs(said["period"].value - 2.0 * np.pi) < 2.6 * said["period"].sigma
    assert said["amplitude"].sigma < ECCENTRIC  # not so large that it says nothing
