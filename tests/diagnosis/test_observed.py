"""What a diagnosis starts from: noise as it was declared or found, commands that were covariates."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import Noise
from gtpin.diagnosis.inference.outliers import readmit_outliers
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.diagnosis.priors import PRIORS

pytestmark = pytest.mark.slow


def calibrated(dataset: gtpin.Dataset) -> gtpin.Calibration:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        return gtpin.calibrate(dataset)


def test_scatter_stays_what_it_was_where_nobody_declared_the_sigmas() -> None:
    noise = Noise(declared=False, repeatability=(2e-5, 2e-5))
    dataset = make_case(1, effects=[], poses=100, noise=noise).dataset
    baseline = calibrated(dataset)
    assert baseline.noise.repeatability > 0.0
    observed = Observed.of(dataset, baseline)
    J = observed.design(baseline.model).command_jacobian
    before, after = (
        np.trace(n.covariance(J, 6)[:, :3, :3], axis1=1, axis2=2).mean() for n in (baseline.noise, observed.noise)
    )
    assert observed.noise.repeatability == 0.0
    assert after == pytest.approx(before, rel=0.01)


def test_a_command_out_of_reach_is_no_pose_to_believe() -> None:
    dataset = make_case(2, effects=[], poses=80).dataset
    q = dataset.q.copy()
    once = np.flatnonzero(np.bincount(dataset.visits)[dataset.visits] == 1)[
        :4
    ]  # visits to one pose have the same commands
    q[once] = [2.0, -2.0, 2.0]
    wild = replace(dataset, q=q)
    baseline = calibrated(wild)
    rows = readmit_outliers(Prepared(wild, wild, baseline, (None, None)), PRIORS)
    assert not rows[once].any()
    assert (rows == baseline.used(wild)).all()


def test_hysteresis_is_asked_for_its_direction_where_the_fit_knew_it() -> None:
    case = make_case(3, effects=[("link_compliance", "link3a")], energy=2000.0, poses=120)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(case.dataset)
    assert "link_compliance" in {cause.effect for cause in found.causes}
    without = {name: v for name, v in case.commands.covariates.items() if not name.startswith("approach")}
    with pytest.raises(gtpin.GtpinError, match="approach"):
        found.model.predict(case.commands.q, without)
