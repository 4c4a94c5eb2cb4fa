"""No answer depends on earlier questions."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator.case import make_case
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.hypothesis import Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.verdict import decide

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.GtpinWarning")
PACKAGE = Path(gtpin.__file__).parent


@pytest.fixture(scope="module")
def measured() -> Dataset:
    return make_case(5, robot="ur5", effects=[("backlash", "elbow_joint")], noncentrality=2000.0, poses=40).dataset


@pytest.mark.slow
def test_a_diagnosis_after_others_is_that_of_a_new_process(tmp_path: Path) -> None:
    make_case(5, effects=[("backlash", "cart1")], noncentrality=2000.0, poses=40).dataset.write(tmp_path / "set")
    gtpin.diagnose(make_case(6, effects=[], poses=40).dataset)
    here = json.dumps(gtpin.diagnose(Dataset.read(tmp_path / "set")).to_json())
    program = (
        "import json, sys, warnings, gtpin\n"
        "warnings.simplefilter('ignore')\n"
        "print(json.dumps(gtpin.diagnose(gtpin.Dataset.read(sys.argv[1])).to_json()))\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "set")]
    path = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    alone = subprocess.run(command, check=True, capture_output=True, text=True, env=path).stdout
    assert json.loads(here) == json.loads(alone)


def proposed(dataset: Dataset, calibration: Calibration) -> HypothesisSet:
    """Hypotheses of which nothing was asked."""
    scope = Scope.of(gtpin.catalogue(), (), 0.01, calibration.model.robot)
    return propose(Observed.of(dataset, calibration).design(calibration.model), scope)


def test_hypotheses_answer_alike_whatever_was_asked_before(measured: Dataset) -> None:
    calibration = gtpin.calibrate(measured)
    fresh, asked = proposed(measured, calibration), proposed(measured, calibration)
    first = decide(fresh)
    decide(asked.at_threshold(2.0))  # another search of the same hypotheses, whose gains and models are kept
    again = decide(asked)
    assert again.model.terms == first.model.terms
    np.testing.assert_allclose(again.model.log_evidence, first.model.log_evidence, rtol=1e-12)
    np.testing.assert_allclose(again.model.mean, first.model.mean, rtol=1e-9, atol=1e-12)
    first_gains, again_gains = (one.gains(NOTHING, one.every) for one in (fresh, asked))
    assert [gain.value for gain in again_gains.values()] == [gain.value for gain in first_gains.values()]
