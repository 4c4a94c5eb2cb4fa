"""Diagnoses of machines of the plant, and pages of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from report_findings import Found, ambiguous, unknown

from gtpin.bench.simulator.case import make_case
from gtpin.diagnosis.diagnose import diagnose


def _found(effects: list[tuple[str, str]], **options: object) -> Found:
    dataset = make_case(7, effects=effects, held_out=1, background=False, **options).dataset  # type: ignore[arg-type]
    return Found(diagnose(dataset), dataset)


@pytest.fixture(scope="session")
def single() -> Found:
    """One cause: a periodic rack. Pose ids and a session want to be more than text."""
    dataset = make_case(7, effects=[("rack_periodic", "cart2")], energy=900.0, poses=150, held_out=1).dataset
    pose = dataset.pose.copy()
    for wanted, hostile in (("3", "<script>alert(1)</script>"), ("5", "<b>#@${component}</b>&amp;")):
        pose[dataset.pose.astype(str) == wanted] = hostile
    time = np.asarray(dataset.covariates["time"], dtype=float)
    session = np.where(time > np.median(time), "<i>one</i>", "two").astype(object)
    found = replace(dataset, pose=pose, covariates={**dataset.covariates, "session": session})
    return Found(diagnose(found), found)


@pytest.fixture(scope="session")
def none() -> Found:
    """Nothing but noise; only positions were measured."""
    found = _found([], poses=140, without=("qw", "qx", "qy", "qz"))
    return Found(replace(found.diagnosis, verdict="none", causes=()), found.dataset)


@pytest.fixture(scope="session")
def findings(single: Found, none: Found) -> dict[str, Found]:
    """A finding of each verdict."""
    return {"explained": single, "none": none, "ambiguous": ambiguous(single), "unknown": unknown(single)}
