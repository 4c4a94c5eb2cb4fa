"""``gtpin blind`` on the command line."""

import json
import sys
import warnings
from pathlib import Path

import pytest
from handmade import canned, diagnosis

import gtpin.bench.blind.run
import gtpin.cli
from gtpin.bench.blind.draw import drafts
from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.worker import Outcome


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["gtpin", "blind", *map(str, arguments)])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as ended:
        gtpin.cli.main()
    return int(ended.value.code or 0)


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_score_is_written_and_told(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases) == 0
    told = capsys.readouterr().out
    assert "7 cases, 1 failed" in told
    score = json.loads((tmp_path / "out" / "score.json").read_text())
    assert score["schema"] == "gtpin-score/1"
    assert score["strict"] == 1 / 3
    page = (tmp_path / "out" / "score.html").read_text()
    assert "rack_step@cart2 named" not in page  # of two effects: the false one is listed
    assert "false rack_step@cart2" in page
    assert "it can&#39;t be read" in page
    assert "<script src" not in page
    first = {name: (tmp_path / "out" / name).read_bytes() for name in ("score.json", "judged.json")}
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases, "--json") == 0
    assert json.loads(capsys.readouterr().out) == score
    assert {name: (tmp_path / "out" / name).read_bytes() for name in first} == first


@pytest.mark.usefixtures("here")
def test_a_malformed_truth_is_one_line_and_no_files(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (cases / "c.truth.json").write_text("{")
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases) == 2
    err = capsys.readouterr().err
    assert err.startswith("gtpin: error: ")
    assert "c.truth.json, row 1" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_cases_are_drawn_or_given(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases, "--cases", 3) == 2
    assert "--cases" in capsys.readouterr().err
    assert run(monkeypatch, "-o", tmp_path / "out", "--cases", 0) == 2


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_cases_that_are_drawn_are_made_sealed_opened_and_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[Outcome, float]:
        assert {"dataset.toml", "poses.csv", "commands.csv"} <= set(files)
        return Outcome(diagnosis=diagnosis("none")), 0.1

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", silent)
    assert run(monkeypatch, "-o", tmp_path / "out", "--cases", 3, "--seed", 5150) == 0
    judged = [Judged.model_validate(c) for c in json.loads((tmp_path / "out" / "judged.json").read_text())]
    drawn = list(drafts(3, 5150))
    assert [(case.name, case.kind) for case in judged] == [(draft.name, draft.kind) for draft in drawn]
    assert [case.single.effect for case in judged if case.kind == "one"] == [
        draft.effects[0] for draft in drawn if draft.kind == "one"
    ]
    assert all(case.error is None and not case.strict for case in judged)
    score = json.loads((tmp_path / "out" / "score.json").read_text())
    assert (score["cases"], score["check"]["seed"], score["strict"]) == (3, 5150, 0.0)


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_an_interrupt_ends_in_order_and_can_be_gone_on_from(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        raise KeyboardInterrupt

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", interrupted)
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases) == 130
    manifest, error = capsys.readouterr().err.splitlines()
    assert manifest.startswith("manifest ")
    assert error == "gtpin: error: interrupted"
    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", canned)
    assert run(monkeypatch, "-o", tmp_path / "out", "--from", cases) == 0
