"""The check of the declared noise does not search where repeated visits already show that the noise is not larger."""

import pytest
from diagnosed import machine

import gtpin
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference import shown_noise as check
from gtpin.diagnosis.preparation.prepare import prepare
from gtpin.diagnosis.priors import PRIORS
from gtpin.model.measured_robot import robot_of

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]


class SearchedError(Exception):
    """There was a search."""


def searched(*_: object) -> None:
    raise SearchedError


def test_repeated_visits_without_more_noise_end_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = machine(1, "linearity", "cart2").dataset
    robot = robot_of(dataset)
    prepared = prepare(dataset, robot)
    assert prepared.baseline.chi2_per_dof > PRIORS.misfit
    scope = Scope.of(gtpin.catalogue(), (), FALSE_ALARM, robot, PRIORS)
    without = dataset.take(
        [int(row) for row in dict(zip(dataset.visits.tolist(), range(len(dataset)), strict=True)).values()]
    )
    monkeypatch.setattr(check, "rough_guess", searched)
    assert check.understated_noise(prepared, scope) == {}
    with pytest.raises(SearchedError):  # one visit of each pose says nothing of the noise
        check.understated_noise(prepare(without, robot), scope)
