"""A log of checks: added to, never written over where it is damaged, lost or of another machine."""

import json

import pytest
from checked_machines import later, machine

import gtpin
from gtpin.extras.history.page import history
from gtpin.output.shown import present
from gtpin.report.words import length

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning"),  # a later day holds conditions constant
]


@pytest.fixture(scope="module")
def checks():
    case, model = machine(23)
    return [gtpin.diagnose(later(case, 1, shift=shift), against=model) for shift in (None, {1: 1e-4})]


def added(path, *checks):
    for check in checks:
        with history(path) as log:
            log.add(check)


def test_each_check_is_one_more_line_and_stands_on_the_page(tmp_path, checks):
    added(tmp_path / "log", checks[0])
    first = (tmp_path / "log" / "history.jsonl").read_text()
    added(tmp_path / "log", checks[1])
    lines = (tmp_path / "log" / "history.jsonl").read_text()
    assert lines.startswith(first)
    told = [json.loads(line) for line in lines.splitlines()]
    assert [one["verdict"] for one in told] == [check.verdict for check in checks]
    assert told[1]["changes"][0]["effect"] == "zero_shift"
    page = (tmp_path / "log" / "history.html").read_text()
    assert "zero shift at cart2" in page
    for check in checks:  # one number for the noise: in the check's words and in the history
        assert length(check.gap.floor) in present(check).short()
        assert length(check.gap.floor) in page
    assert "2 checks, 1 of them with a change" in page


def test_a_history_can_be_named_by_its_page(tmp_path, checks):
    added(tmp_path / "tau.html", checks[0])
    assert {path.name for path in tmp_path.iterdir()} >= {"tau.html", "tau.jsonl"}


@pytest.mark.parametrize(
    "damage", [lambda text: text[:-40], lambda text: text.replace("none", "fine"), lambda text: "\n" + text]
)
def test_a_damaged_history_is_refused_by_its_line_and_stays_as_it_is(tmp_path, checks, damage):
    added(tmp_path, checks[0], checks[0])
    file = tmp_path / "history.jsonl"
    file.write_text(damage(file.read_text()))
    before = file.read_bytes()
    with pytest.raises(gtpin.GtpinError, match="damaged") as refused:
        added(tmp_path, checks[1])
    assert refused.value.row in (1, 2)
    assert file.read_bytes() == before


def test_a_history_that_somebody_changed_is_not_written_over(tmp_path, checks):
    added(tmp_path, checks[0])
    file = tmp_path / "history.jsonl"
    file.write_text(file.read_text() * 2)
    with pytest.raises(gtpin.GtpinError, match=r"history\.jsonl"):
        added(tmp_path, checks[1])
    assert len(file.read_text().splitlines()) == 2


def test_a_lost_history_is_not_begun_anew_beside_its_page(tmp_path, checks):
    added(tmp_path, checks[0])
    (tmp_path / "history.jsonl").unlink()
    with pytest.raises(gtpin.GtpinError, match="lost"):
        added(tmp_path, checks[1])
    assert not (tmp_path / "history.jsonl").exists()


def test_a_check_that_fails_leaves_the_history_as_it_was(tmp_path, checks):
    added(tmp_path, checks[0])
    before = (tmp_path / "history.jsonl").read_bytes()
    with pytest.raises(RuntimeError), history(tmp_path):
        raise RuntimeError
    assert (tmp_path / "history.jsonl").read_bytes() == before
