"""A flexible family that fits is a cause only where a mechanism's form explains as much; else it is told as a description."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.diagnosis import verdict as rules
from gtpin.diagnosis.classes import ClassMember
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.verdict import Conclusion, with_also
from gtpin.effects.catalogue import catalogue, effect_of
from gtpin.typing import Floats


def diagnosed(robot: str, joint: int, ahead: Callable[[Floats], Floats]) -> gtpin.Diagnosis:
    """The diagnosis of a machine without effects, one of whose joints is ahead of its command by a function of all commands."""
    data = simulate(gtpin.load_robot(robot), robot, poses=150, held_out=10, seed=31).dataset
    q = data.q.copy()
    q[:, joint] -= ahead(data.q)
    return gtpin.diagnose(replace(data, q=q))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "joint", "site", "ahead"),
    [
        ("ur5", 4, "wrist_2_joint", lambda q: 5e-4 * q[:, 3]),  # gears of a wrist: in proportion
        ("gantry_tau", 2, "cart3", lambda q: 2e-4 * (q[:, 1] - q[:, 1].mean()) ** 2),  # a beam that another cart bends
    ],
    ids=["ur5", "gantry_tau"],
)
def test_a_joint_that_follows_one_other_joint_is_a_mechanism(robot, joint, site, ahead) -> None:
    found = diagnosed(robot, joint, ahead)
    assert [(c.effect, c.site, c.nature) for c in found.causes] == [("cross_coupling", site, "mechanism")]
    assert found.unexplained.descriptions == ()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:panda_finger_joint1 does not carry the TCP")  # it is on the finger that follows
@pytest.mark.parametrize(("joint", "other"), [(2, 1), (4, 3)])
def test_a_joint_that_follows_the_one_before_it_is_in_the_class_of_a_motion_of_its_axis(joint: int, other: int) -> None:
    # The axes are perpendicular: what turns one joint with the other's command also tilts the other's axis.
    found = diagnosed("panda", joint, lambda q: 2e-4 * (q[:, other] - q[:, other].mean()))
    assert [len(found.causes), found.causes[0].nature] == [1, "mechanism"]
    assert ("cross_coupling", f"panda_joint{joint + 1}") in [(m.effect, m.site) for m in found.causes[0].members]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "joint", "site"), [("ur5", 4, "wrist_2_joint"), ("gantry_tau", 2, "cart3")], ids=["ur5", "gantry_tau"]
)
def test_a_smooth_error_over_several_commands_is_described_and_not_named(robot: str, joint: int, site: str) -> None:
    def wavy(q: Floats) -> Floats:
        a, b = ((x - x.mean()) / x.std() for x in (q[:, 0], q[:, 1]))
        return np.asarray(1.5e-4 * np.sin(1.6 * a + 0.5) * np.cos(1.9 * b - 0.3))

    found = diagnosed(robot, joint, wavy)
    assert found.verdict == "unknown"
    assert not [cause for cause in found.causes if cause.effect == "cross_coupling"]
    assert site in [told.site for told in found.unexplained.descriptions] or site in [d.site for d in found.doubts]


def concluded(probabilities: dict[str, float]) -> tuple[Conclusion, dict[str, Hypothesis]]:
    causes = {site: Hypothesis(effect_of(catalogue(), "backlash"), site) for site in probabilities}
    other = Hypothesis(effect_of(catalogue(), "linearity"), "cart3")
    classes = {
        cause: (ClassMember(cause, probabilities[site]), ClassMember(other, 1.0 - probabilities[site]))
        for site, cause in causes.items()
    }
    return Conclusion(NOTHING, classes, ()), causes


@pytest.mark.parametrize(
    ("leader", "weak", "verdict"),
    [(0.27, True, "explained"), (0.27, False, "ambiguous"), (0.6, True, "ambiguous")],
    ids=["weak and undecided", "undecided", "weak"],
)
def test_only_what_is_weak_and_undecided_leaves_the_verdict_alone(
    leader: float, weak: bool, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, causes = concluded({"cart1": 0.99, "cart2": leader})
    monkeypatch.setattr(rules, "weak", lambda hypotheses, model, cause: weak and cause == causes["cart2"])
    told = with_also(None, found)  # type: ignore[arg-type]
    assert told.verdict == verdict
    assert set(told.also) == ({causes["cart2"]} if verdict == "explained" else set())


def test_what_is_weak_and_undecided_alone_stays_a_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = concluded({"cart2": 0.3})
    monkeypatch.setattr(rules, "weak", lambda *_: True)
    assert with_also(None, found).verdict == "ambiguous"  # type: ignore[arg-type]


def test_a_flexible_family_is_a_mechanism_only_where_its_form_was_found_to_be_one() -> None:
    family = Hypothesis(effect_of(catalogue(), "cross_coupling"), "cart1")
    track = Hypothesis(effect_of(catalogue(), "straightness"), "cart2")
    untried = Conclusion(NOTHING, {}, ())
    assert [untried.nature(cause) for cause in (family, track)] == ["description", "profile"]
    assert replace(untried, mechanisms=frozenset({family.place})).nature(family) == "mechanism"


def test_each_form_of_a_description_is_part_of_the_family() -> None:
    robot = gtpin.load_robot("ur5")
    for effect in catalogue():
        forms = effect.forms(robot, "elbow_joint")
        assert bool(forms) == (effect.nature == "description")
        assert all(len(form) == len(set(form)) for form in forms)
