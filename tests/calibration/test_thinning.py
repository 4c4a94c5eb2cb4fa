"""A calibration of some of very many poses, against that of all."""

from __future__ import annotations

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator.case import make_case
from gtpin.calibration.robust_fit import EXPECTED
from gtpin.calibration.thinning import VISITS, gains, thinned
from gtpin.data import Dataset
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.paper.geometry import nominal_geometry

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.GtpinWarning")


def parted(robot: str, poses: int = 6000) -> tuple[Dataset, Dataset]:
    """A dataset, and poses that are held out of it."""
    whole = make_case(11, robot=robot, effects=[], poses=poses).dataset
    out = np.random.default_rng(3).permutation(whole.visits.max() + 1) < poses // 4
    return whole.take(~out[whole.visits]), whole.take(out[whole.visits])


def error(model: Model, held: Dataset) -> float:
    return float(np.sqrt(((held.position - model.predict(held.q).T) ** 2).sum(axis=1).mean()))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur5", "gantry_tau"])
def test_errors_on_poses_held_out_are_within_five_percent_of_those_with_all_rows(robot: str) -> None:
    rest, held = parted(robot)
    whole, some = gtpin.calibrate(rest), gtpin.calibrate(rest, poses=600)
    assert error(some.model, held) == pytest.approx(error(whole.model, held), rel=0.05)
    # The difference of the two has the variance that some poses lack, less than their own.
    off = (some.values - whole.values) / [some[name].sigma for name in some.names]
    assert float((off**2).mean()) < 1.5
    assert some.dataset.rows_of == len(rest) > len(some.dataset) >= 600
    assert some.to_json()["rows"] == {"used": len(some.dataset), "of": len(rest)}
    assert whole.to_json()["rows"] == {"used": len(rest), "of": len(rest)}
    assert any(f"of {len(rest):,} rows are used" in text for text in some.warnings)


def test_chosen_poses_determine_more_than_as_many_at_random() -> None:
    rest, _ = parted("gantry_tau", 1200)
    some = gtpin.calibrate(rest, poses=200)
    ids = np.random.default_rng(5).permutation(np.unique(some.dataset.pose.astype(str)).size)
    assert len(ids) == 200
    kept = np.random.default_rng(5).permutation(rest.visits.max() + 1)[:200]
    random = gtpin.calibrate(rest.take(np.isin(rest.visits, kept)))
    assert np.linalg.slogdet(some.covariance)[1] < np.linalg.slogdet(random.covariance)[1]


def test_no_more_poses_than_asked_for_with_their_first_visits_in_their_order() -> None:
    rest, _ = parted("ur5", 1000)
    often = rest.take(np.concatenate([np.arange(len(rest)), np.zeros(30, dtype=int)]))
    geometry = nominal_geometry(robot_of(often), tolerance=often.tolerance)
    found = thinned(often, geometry, 100)
    assert len(set(found.pose)) == 100
    assert np.bincount(found.visits).max() <= VISITS
    assert (np.diff([list(often.row).index(line) for line in found.row]) >= 0).all()
    assert thinned(often, geometry, 100_000) is often
    again = thinned(often, geometry, 100)
    assert list(again.pose) == list(found.pose)
    for wrong in (0, -3, 2.5, True):
        with pytest.raises(gtpin.GtpinError, match="poses="):
            thinned(often, geometry, wrong)  # type: ignore[arg-type]


def test_the_gain_of_a_measurement_is_what_its_information_adds_to_the_determinant() -> None:
    rng = np.random.default_rng(0)
    B, M = rng.standard_normal((7, 3, 5)), np.diag(rng.uniform(0.1, 4.0, 5))
    added = [np.linalg.slogdet(M + one.T @ one)[1] - np.linalg.slogdet(M)[1] for one in B]
    np.testing.assert_allclose(gains(B, M), added, rtol=1e-9)


def test_a_diagnosis_of_some_poses_names_what_that_of_all_names() -> None:
    whole = make_case(2, effects=[("linearity", "cart2")], noncentrality=4000.0, poses=600).dataset
    found = gtpin.diagnose(
        whole, poses=150, effects=[e for e in gtpin.catalogue() if e.id in ("backlash", "linearity")]
    )
    assert [(cause.effect, cause.site) for cause in found.causes] == [("linearity", "cart2")]
    assert found.to_json()["rows"] == {"used": len(found.dataset), "of": len(whole)}
    assert len(set(found.dataset.pose)) == 150


def test_memory_and_time_are_told_before_the_first_step_of_very_many_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    few = make_case(11, robot="ur5", effects=[], poses=60).dataset
    steps: list[str] = []
    monkeypatch.setattr("gtpin.calibration.calibrate.ANNOUNCED_POSES", len(few))
    gtpin.calibrate(few, progress=lambda step, number, rms: steps.append(step))
    assert steps[0].startswith(f"{EXPECTED} 80 MB of memory and ")
    assert f"min for {len(few)} poses" in steps[0]
    assert not any(step.startswith(EXPECTED) for step in steps[1:])
