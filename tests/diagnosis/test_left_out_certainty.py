"""What left-out poses say of each cause: the share that is lost without it, and no certainty where nothing is lost."""

import pytest

from gtpin.diagnosis.classes import ClassMember
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.gap import capped_by_left_out_errors, lost
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import LIKELY
from gtpin.diagnosis.result import Cause, Gap, Turns
from gtpin.diagnosis.verdict import Conclusion
from gtpin.effects.catalogue import effects_by_id
from gtpin.estimate import Estimate

CAUSE, OTHER = (Hypothesis(effects_by_id()["backlash"], site) for site in ("cart1", "cart2"))


def gap(after: float, floor: float = 2e-5, turned: float | None = None) -> Gap:
    turns = None if turned is None else Turns(2e-4, turned, 5e-5)
    return Gap(7e-5, after, floor, 0.5, None, turns=turns)


def test_the_share_of_a_cause_is_counted_with_one_noise_floor():
    """Squares, um^2: 4900 before, 400 of noise; 1600 with all causes, 2500 without this one."""
    assert lost(gap(4e-5), gap(5e-5)) == pytest.approx(0.2)
    assert lost(gap(4e-5), gap(5e-5, floor=4.9e-5)) == pytest.approx(0.2)
    assert lost(gap(5e-5), gap(4e-5)) == pytest.approx(-0.2)


def fitted(sigma: float = 1e-6) -> list[Cause]:
    """Both causes with a size of 10 um; ``sigma``: that of the first."""
    return [
        Cause(*one.place, 1.0, (), {"rms": Estimate(1e-5, s, "m")}, 0.5)
        for one, s in zip((CAUSE, OTHER), (sigma, 1e-6), strict=True)
    ]


@pytest.mark.parametrize("probability", [0.5, 0.55, 0.61, 0.7, 0.96, 1.0])
@pytest.mark.parametrize(
    ("without", "helps"),
    [
        (gap(5e-5), True),
        (gap(4e-5), False),
        (gap(3.9e-5), False),
        (gap(3.9e-5, turned=2e-4), True),
        (gap(4.1e-5, turned=1e-4), False),
    ],
)
def test_a_cause_without_which_nothing_gets_worse_is_not_likely(without, helps, probability):
    turned = without.turns is not None
    whole, other = gap(4e-5, turned=1.1e-4 if turned else None), gap(6e-5, turned=2e-4 if turned else None)
    classes = {CAUSE: (ClassMember(CAUSE, probability), ClassMember(OTHER, 0.03)), OTHER: (ClassMember(OTHER, 1.0),)}
    less = {CAUSE.place: without, OTHER.place: other}
    found = capped_by_left_out_errors(Conclusion(NOTHING, classes, ()), whole, less, fitted(), wrist=True)
    assert found.classes[OTHER] == classes[OTHER]
    leader, second = (member.probability for member in found.classes[CAUSE])
    assert leader == probability if helps else leader < LIKELY
    assert second / leader == pytest.approx(0.03 / probability)


def capped(without: Gap, sigma: float = 1e-6, *, wrist: bool = False) -> float:
    """Probability of a certain cause, with the gap ``without`` it and the ``sigma`` of its size of 10 um."""
    classes = {CAUSE: (ClassMember(CAUSE, 1.0),), OTHER: (ClassMember(OTHER, 1.0),)}
    less = {CAUSE.place: without, OTHER.place: gap(6e-5, turned=2e-4)}
    whole = gap(4e-5, turned=1.1e-4)
    found = capped_by_left_out_errors(Conclusion(NOTHING, classes, ()), whole, less, fitted(sigma), wrist)
    assert found.classes[OTHER] == classes[OTHER]
    return found.classes[CAUSE][0].probability


def test_a_cause_whose_size_could_be_zero_is_not_likely():
    assert capped(gap(5e-5, turned=1.1e-4)) == 1.0
    assert capped(gap(5e-5, turned=1.1e-4), sigma=4.9e-6) == 1.0
    assert capped(gap(5e-5, turned=1.1e-4), sigma=5.1e-6) < LIKELY


def test_orientations_count_alone_only_where_they_are_reported():
    """A wrist turns the tool and hardly shifts it; without one the page states positions."""
    turned = gap(3.9e-5, turned=2e-4)
    assert capped(turned, wrist=True) == 1.0
    assert capped(turned) < LIKELY
