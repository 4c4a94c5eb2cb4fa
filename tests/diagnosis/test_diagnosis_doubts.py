"""What looks like a cause and is a mistake in the data is not named: noise, frames, signs."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosed import LARGE, machine, quietly, said
from linear_problems import every_effect

import gtpin
from gtpin.bench.simulator import make_case, simulate
from gtpin.data import Dataset
from gtpin.diagnosis import diagnose
from gtpin.diagnosis import doubts as rules
from gtpin.diagnosis.classes import ClassMember
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.gap import leave_out
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.result import Diagnosis
from gtpin.diagnosis.verdict import Conclusion, decide
from gtpin.errors import ConvergenceError
from gtpin.output.shown import present
from gtpin.report.verdict import verdict

pytestmark = pytest.mark.slow


def warned(dataset: Dataset) -> tuple[Diagnosis, str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = gtpin.diagnose(dataset)
    return found, "; ".join(str(w.message) for w in caught)


def understated(dataset: Dataset, factor: float) -> Dataset:
    own = dataset.instrument
    sigmas = {key: factor * getattr(own, key) for key in ("position_sigma", "orientation_sigma")}
    return replace(dataset, instrument=own.model_copy(update=sigmas))


@pytest.mark.parametrize("factor", [0.5, 0.01])
def test_noise_declared_too_small_makes_no_cause(factor):
    found, said = warned(understated(machine(3).dataset, factor))
    assert "position_sigma" in said
    # Repeated visits show the noise, and what the geometry leaves is no larger.
    assert (found.verdict, found.causes, found.doubts) == ("none", (), ())
    assert found.noise_ratio == pytest.approx(1.0 / factor, rel=0.3)


def test_noise_declared_too_small_hides_no_cause():
    found, _ = warned(understated(machine(2, "backlash").dataset, 0.2))
    truth = machine(2, "backlash").effects[0]
    assert [(c.effect, c.site) for c in found.causes] == [(truth.effect, truth.site)]


@pytest.mark.parametrize("effect", ["backlash", "straightness", "joint_runout"])
def test_structure_is_not_taken_for_noise(effect):
    case = machine(5, effect, None, 6.0 * LARGE)
    assert said(5, effect, None, 6.0 * LARGE).baseline.instrument == case.dataset.instrument


@pytest.mark.parametrize(
    ("effect", "column", "mirrored"),
    [("thermal_links", "temp_link", 40.0), ("thermal_track", "temp_frame", 40.0), ("link_compliance", "payload", 20.0)],
)
def test_a_coefficient_of_a_sign_that_no_machine_has_is_a_question_and_no_cause(effect, column, mirrored):
    site = "arm" if effect != "thermal_track" else "cart2"
    dataset = make_case(6, effects=[(effect, site)], noncentrality=LARGE, poses=130).dataset
    wrong = replace(dataset, covariates={**dataset.covariates, column: mirrored - dataset.covariates[column]})
    found, _ = warned(wrong)
    assert found.verdict == "unknown"
    assert effect not in {c.effect for c in found.causes}
    asked = [q for q in found.questions if q.effect == effect]
    if asked:  # else nothing of the kind was found in the first place
        assert not asked[0].believed
        assert asked[0].value < 0.0
        assert any(asked[0].why in line for line in verdict(found).advice)


def test_a_question_reaches_summary_and_file():
    dataset = make_case(6, effects=[("servo_lag", "cart1")], noncentrality=LARGE, poses=130).dataset
    speeds = {name: -values for name, values in dataset.covariates.items() if name.startswith("speed")}
    found, _ = warned(replace(dataset, covariates={**dataset.covariates, **speeds}))
    assert [(c.effect, c.site) for c in found.causes] == [("servo_lag", "cart1")]
    (question,) = found.to_json()["unexplained"]["questions"]
    assert (question["effect"], question["parameter"], question["believed"]) == ("servo_lag", "lag", True)
    assert question["expected"] == [0.0, None]
    assert any("unusual" in str(part) for part in present(found).terminal().renderables)


def test_an_instrument_beside_the_base_makes_no_cause():
    dataset = machine(3).dataset
    found, said = warned(replace(dataset, position=dataset.position + np.array([0.0, 0.005, -0.003])))
    assert "frame" in said
    assert (found.verdict, found.causes) == ("none", ())


@pytest.fixture(scope="module")
def backlash():
    """Hypotheses of a machine with a backlash, and what was decided of them."""
    dataset = machine(2, "backlash").dataset
    baseline = gtpin.calibrate(dataset)
    hypotheses = propose(Observed.of(dataset, baseline).design(baseline.model), every_effect())
    return hypotheses, decide(hypotheses)


@pytest.mark.parametrize(
    ("nearer", "straighter", "kept"), [(0.9, 1.0, True), (1.01, 0.7, True), (1.1, 0.999, False), (1.0, 1.0, False)]
)
def test_causes_must_make_left_out_positions_and_orientations_together_better(
    monkeypatch, backlash, nearer, straighter, kept
):
    hypotheses, found = backlash
    design = hypotheses.design
    assert found.classes
    every = np.ones(len(design.y) // design.components, dtype=bool)
    alone = leave_out(design, np.zeros((len(design.y), 0)), [every])

    def left(_, causes, __):
        if not causes.shape[1]:
            return alone
        return replace(alone, errors=nearer * alone.errors, turned=straighter * alone.turned)

    monkeypatch.setattr(rules, "leave_out", left)
    after = rules.worse_predictions(SimpleNamespace(hypotheses=hypotheses, found=found, blocks=[])) or found
    assert bool(after.classes) == kept
    assert [doubt.reason for doubt in after.doubts] == ([] if kept else ["held_out"])


@pytest.mark.slow
def test_causes_with_which_the_fit_does_not_converge_are_not_named_and_end_no_diagnosis(monkeypatch):
    solve = diagnose.fit_together

    def to_first_order_only(observed, start, causes, *others):
        if causes:
            raise ConvergenceError("the fit has not converged")
        return solve(observed, start, causes, *others)

    monkeypatch.setattr(diagnose, "fit_together", to_first_order_only)
    found = quietly(gtpin.diagnose, machine(2, "backlash").dataset)
    assert (found.verdict, found.causes) == ("unknown", ())
    assert [doubt.reason for doubt in found.doubts] == ["held_out"]


@pytest.mark.slow
def test_a_wrist_that_rotates_the_tool_is_a_cause_though_other_errors_are_as_large_at_its_place():
    """The lag rotates the tool by 11 times the noise and does not move the TCP; the waves of the shoulder move it by 14 um."""
    robot = gtpin.load_robot("ur5")
    data = simulate(robot, "ur5", poses=220, seed=5).dataset
    rng, q = np.random.default_rng(5), data.q.copy()
    visits = np.unique(data.visits, return_inverse=True)[1]
    speed = rng.uniform(-0.5, 0.5, visits.max() + 1)[visits]
    q[:, 5] += 2e-3 * speed
    q[:, 0] += 2.5e-5 * np.sin(9.0 * data.q[:, 0]) + 2.5e-5 * np.sin(14.0 * data.q[:, 0] + 1.0)
    found = quietly(gtpin.diagnose, replace(data, q=q, covariates={**data.covariates, "speed6": speed}))
    assert [(c.effect, c.site) for c in found.causes if c.probability >= 0.95][:1] == [("servo_lag", "wrist_3_joint")]


@pytest.mark.parametrize(("named", "left", "doubts"), [(True, 0.5, ["held_out"]), (True, 0.1, []), (False, 1.0, [])])
def test_what_causes_leave_is_compared_with_the_likeliest_noise_and_silence_with_the_largest(
    monkeypatch, named, left, doubts
):
    """``left``: of all that was measured; of the positions it is a fifth."""
    sizes = {"likeliest": 1.0, "largest": 1.4}
    monkeypatch.setattr(rules, "floor_of", lambda noise, design: np.array([sizes[noise] ** 2]))
    shown = SimpleNamespace(
        source="declared",
        contradicted=False,
        visits=20,
        noise="likeliest",
        most="largest",
        floor=lambda design: np.array([1.0]),
        excess=lambda noise, *_: (1.5 / sizes[noise], 0.0, ""),
        share_left=lambda *_: left,
    )
    cause = Hypothesis(gtpin.catalogue()[0], "cart1")
    found = Conclusion(NOTHING, {cause: (ClassMember(cause, 1.0),)} if named else {}, ())
    hypotheses = SimpleNamespace(priors=PRIORS, design=None)
    monkeypatch.setattr(rules, "class_of", lambda *_, unlisted: (ClassMember(cause, 1.0),))
    monkeypatch.setattr(Conclusion, "whole", lambda *_: NOTHING)
    gap, settled = SimpleNamespace(before=2.8, after=1.6, floor=1.0), SimpleNamespace(observed=None)
    context = SimpleNamespace(found=found, hypotheses=hypotheses, gap=gap, settled=settled, shown=shown)
    after = rules.errors_beyond_noise(context) or found
    assert [doubt.reason for doubt in after.doubts] == doubts
