"""Diagnoses of machines of the plant, and pages of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from report_findings import ambiguous, unknown

from gtpin.bench.simulator.case import make_case
from gtpin.diagnosis.diagnose import diagnose
from gtpin.diagnosis.result import Diagnosis
from gtpin.extras.view.gap import DrawnGap
from gtpin.model.model import Model
from gtpin.report.diagnosis import DiagnosisPresentation
from gtpin.report.figure import Drawing, Plot

if TYPE_CHECKING:
    from gtpin.extras.view.scene import Scene


@pytest.fixture(scope="session")
def single() -> Diagnosis:
    """One cause: a periodic rack. Pose ids and a session want to be more than text."""
    dataset = make_case(7, effects=[("rack_periodic", "cart2")], noncentrality=900.0, poses=150, held_out=1).dataset
    pose = dataset.pose.copy()
    for wanted, hostile in (("3", "<script>alert(1)</script>"), ("5", "<b>#@${component}</b>&amp;")):
        pose[dataset.pose.astype(str) == wanted] = hostile
    time = np.asarray(dataset.covariates["time"], dtype=float)
    session = np.where(time > np.median(time), "<i>one</i>", "two").astype(object)
    found = replace(dataset, pose=pose, covariates={**dataset.covariates, "session": session})
    return diagnose(found)


@pytest.fixture(scope="session")
def none() -> Diagnosis:
    """Nothing but noise; only positions were measured."""
    without = ("qw", "qx", "qy", "qz")
    case = make_case(7, effects=[], held_out=1, background=False, poses=140, without=without)
    return replace(diagnose(case.dataset), verdict="none", causes=())


@pytest.fixture(scope="session")
def findings(single: Diagnosis, none: Diagnosis) -> dict[str, Diagnosis]:
    """A diagnosis of each verdict."""
    return {"explained": single, "none": none, "ambiguous": ambiguous(single), "unknown": unknown(single)}


@pytest.fixture(scope="session")
def pages(findings: dict[str, Diagnosis]) -> Callable[[str], tuple[str, list[Drawing]]]:
    """The page of a verdict with the drawings on it, made once."""

    @cache
    def page(kind: str) -> tuple[str, list[Drawing]]:
        drawings, made = list[Drawing](), Plot.drawings

        def noted(plot: Plot) -> list[Drawing]:
            found = made(plot)
            drawings.extend(found)
            return found

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Plot, "drawings", noted)
            return DiagnosisPresentation(findings[kind]).page(), drawings

    return page


@pytest.fixture
def served() -> Iterator[Callable[..., Scene]]:
    """Serves 3-D pages of models, until the test ends."""
    pytest.importorskip("viser", reason="viser is not installed")
    from gtpin.extras.view.scene import Scene

    made = list[Scene]()

    def serve(model: Model, gap: DrawnGap | None = None, **more: object) -> Scene:
        made.append(Scene(model, gap, port=0, **more))  # type: ignore[arg-type]
        return made[-1]

    yield serve
    for scene in made:
        scene.stop()
