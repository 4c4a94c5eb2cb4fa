"""Datasets of a machine that knows nothing of gtpin's effects are diagnosed right."""

import warnings

import pytest
from soft_machines import Day
from spring_machine import Springs

from gtpin.diagnosis.diagnose import diagnose
from gtpin.errors import GtpinWarning

pytestmark = pytest.mark.slow

RIGID = [0.0] * 6
CASES = {
    "rigid": (Springs(RIGID), []),
    "a soft link": (Springs([0.0, 0.0, 2e-7, 0.0, 0.0, 0.0]), [("link_compliance", "link2b")]),
    "a cart along": (Springs(RIGID, {1: [2e-7, 0.0, 0.0, 0.0, 0.0, 0.0]}), [("cart_compliance", "cart2")]),
    "a cart across": (Springs(RIGID, {2: [0.0, 3e-7, 3e-7, 0.0, 0.0, 0.0]}), [("cart_compliance", "cart3")]),
    "a cart tips": (Springs(RIGID, {2: [0.0, 0.0, 0.0, 8e-6, 8e-6, 8e-6]}), [("cart_compliance", "cart3")]),
}


@pytest.mark.parametrize("name", CASES)
def test_what_gives_way_is_named_and_nothing_else(name: str) -> None:
    number, (springs, causes) = list(CASES).index(name), CASES[name]
    dataset = Day.draw(20 + number, 100).dataset(springs, number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        diagnosis = diagnose(dataset)
    assert [(cause.effect, cause.site) for cause in diagnosis.causes] == causes
    assert diagnosis.verdict == ("explained" if causes else "none")
    if name == "a soft link":
        found = diagnosis.causes[0].parameters["compliance"]
        assert found.unit == "m/N"
        assert abs(found.value - 2e-7) < 3.0 * found.sigma < 1.2e-7
