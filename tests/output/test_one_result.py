"""A folder holds one result of each kind: what is left of another one would be taken for a part of it."""

from pathlib import Path

import pytest

from gtpin.errors import GtpinError
from gtpin.output.results import result_file, results_folder


def test_a_folder_holds_one_result_and_another_kind_is_refused_or_moves_all_of_it_aside(tmp_path: Path) -> None:
    with results_folder(tmp_path, ("one.json", "report.html", "model")) as new:
        (new / "one.json").write_text("1", encoding="utf-8")
        (new / "report.html").write_text("one", encoding="utf-8")
        (new / "model").mkdir()
    with result_file(tmp_path / "table.csv") as file:
        file.write_text("1", encoding="utf-8")
    with (
        pytest.raises(GtpinError, match=r"another result is here \(model, one\.json\)"),
        results_folder(tmp_path, ("two.json", "report.html")),
    ):
        pytest.fail("the work begins")
    with results_folder(tmp_path, ("three.json",)) as new:  # shares no name: each is whole
        (new / "three.json").write_text("3", encoding="utf-8")
    with results_folder(tmp_path, ("two.json", "report.html"), force=True) as new:
        (new / "two.json").write_text("2", encoding="utf-8")
        (new / "report.html").write_text("two", encoding="utf-8")
    assert (tmp_path / "one.json.old-1").read_text(encoding="utf-8") == "1"
    assert (tmp_path / "report.html.old-1").read_text(encoding="utf-8") == "one"
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "two"
    assert not (tmp_path / "one.json").exists()
    with results_folder(tmp_path, ("two.json", "report.html")) as new:  # the same kind is replaced
        (new / "two.json").write_text("4", encoding="utf-8")
    assert {file.name for file in tmp_path.iterdir() if not file.name.startswith(".")} == {
        "one.json.old-1",
        "report.html.old-1",
        "model.old-1",
        "two.json",
        "table.csv",
        "three.json",
    }
