"""Results in a session and in a notebook: short, whole, saved as the commands write, and drawn as the report draws."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import gtpin
from gtpin.accuracy.analysis import analyse
from gtpin.bench.simulator import make_case
from gtpin.cli import app
from gtpin.comparison.compare import compare

pytestmark = pytest.mark.slow  # a diagnosis, a comparison of models

RESULTS = ("dataset", "poses", "calibration", "diagnosis", "accuracy", "comparison")
LINES, LETTERS = 8, 700
"""A short form: lines, and letters."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("data") / "measured"
    case = make_case(3, effects=[("backlash", "cart1")], noncentrality=1500.0, poses=60)
    case.dataset.save(path)
    return path


@pytest.fixture(scope="module")
def results(folder) -> dict[str, object]:
    dataset = gtpin.Dataset.read(folder)
    diagnosis = gtpin.diagnose(dataset)
    calibration = gtpin.calibrate(dataset)
    poses = calibration.model.predict(dataset.q)
    found = (dataset, poses, calibration, diagnosis, analyse(gtpin.read_model("gantry_tau")), compare(dataset))
    return dict(zip(RESULTS, found, strict=True))


@pytest.mark.parametrize("name", RESULTS)
def test_the_repr_of_a_result_is_a_few_lines_and_says_what_it_is_of(results, name):
    told = repr(results[name])
    assert len(told.splitlines()) <= LINES
    assert len(told) <= LETTERS
    assert "array(" not in told
    assert any(word in told.lower() for word in (name, "expected error", "models"))


@pytest.mark.parametrize("name", RESULTS)
def test_a_notebook_shows_the_short_form_and_a_table(results, name):
    html = results[name]._repr_html_()
    assert html.startswith("<p><b>")
    assert "<table" in html
    assert len(html) < 20_000


@pytest.mark.parametrize("name", RESULTS)
def test_a_summary_is_text_and_a_table_is_a_dataframe_of_rows(results, name):
    summary, table = results[name].summary(), results[name].to_dataframe()
    assert isinstance(summary, str)
    assert len(summary) > len(repr(results[name]).splitlines()[0])
    assert isinstance(table, pd.DataFrame)
    assert len(table) > 0


def test_tables_hold_what_the_results_hold(results):
    calibration, diagnosis, dataset = (results[name] for name in ("calibration", "diagnosis", "dataset"))
    table = calibration.to_dataframe()
    np.testing.assert_array_equal(table["value"], calibration.values)
    np.testing.assert_array_equal(table["sigma"], calibration.sigma)
    assert dataset.to_dataframe().columns.tolist()[:4] == ["pose", "q1", "q2", "q3"]
    first = diagnosis.causes[0]
    name, estimate = next(iter(first.parameters.items()))
    row = diagnosis.to_dataframe().iloc[0]
    assert (row["effect"], row["site"], row["parameter"]) == (first.effect, first.site, name)
    assert (row["low"], row["high"]) == estimate.interval
    assert estimate.interval == (estimate.value - 1.96 * estimate.sigma, estimate.value + 1.96 * estimate.sigma)


@pytest.mark.parametrize("name", ["calibration", "diagnosis", "comparison"])
def test_save_writes_what_the_command_writes(results, folder, tmp_path, name):
    command = {"calibration": "calibrate", "diagnosis": "diagnose", "comparison": "compare"}[name]
    ran = CliRunner().invoke(app, [command, str(folder), "-o", str(tmp_path / "command")])
    assert ran.exit_code == 0, ran.output
    results[name].save(tmp_path / "saved")
    files = {}
    for way in ("command", "saved"):
        found = sorted(path for path in (tmp_path / way).rglob("*") if path.is_file() and path.name != ".gtpin.json")
        files[way] = {str(path.relative_to(tmp_path / way)): path for path in found}
    assert list(files["command"]) == list(files["saved"])
    for file, path in files["command"].items():
        if path.suffix == ".json":
            assert json.loads(path.read_text()) == json.loads(files["saved"][file].read_text()), file
        else:
            assert path.read_bytes() == files["saved"][file].read_bytes(), file


def test_save_does_not_overwrite_what_others_wrote(results, tmp_path):
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(gtpin.GtpinError, match=r"report\.html"):
        results["calibration"].save(tmp_path)
    assert (tmp_path / "report.html").read_text() == "mine"


def test_poses_and_accuracy_are_saved_as_their_commands_write_them(results, tmp_path):
    results["poses"].save(tmp_path / "poses.csv")
    table = pd.read_csv(tmp_path / "poses.csv", dtype=str)  # numbers exactly as written, by any pandas
    assert table.columns.tolist() == ["pose", "x", "y", "z", "qw", "qx", "qy", "qz"]
    np.testing.assert_array_equal(table[["x", "y", "z"]].astype(float), results["poses"].T)
    results["accuracy"].save(tmp_path / "accuracy")
    assert {"sensitivity.csv", "accuracy.json", "report.html"} <= {p.name for p in (tmp_path / "accuracy").iterdir()}


FIGURES = [
    ("dataset", "plot_workspace", {}),
    ("dataset", "plot_workspace", {"view": "yz", "color": "time"}),
    ("poses", "plot_workspace", {"view": "xz"}),
    ("calibration", "plot_residuals", {"against": "time", "component": "z"}),
    ("calibration", "plot_residuals", {"against": "approach1"}),
    ("calibration", "plot_workspace", {"view": "xz"}),
    ("calibration", "plot_parameters", {}),
    ("diagnosis", "plot_residuals", {"against": "q1"}),
    ("diagnosis", "plot_residuals", {"against": "q1", "after": True}),
    ("diagnosis", "plot_effect", {}),
    ("diagnosis", "plot_workspace", {"after": True}),
    ("diagnosis", "plot_parameters", {}),
    ("accuracy", "plot_workspace", {"quantity": "condition number"}),
    ("accuracy", "plot_parameters", {}),
    ("comparison", "plot_errors", {}),
    ("comparison", "plot_angles", {"angle": "gamma"}),
]


@pytest.mark.parametrize(("name", "method", "options"), FIGURES)
def test_a_plot_is_a_figure_with_data_and_a_title(results, name, method, options):
    from plotly.graph_objects import Figure

    made = getattr(results[name], method)(**options)
    assert isinstance(made, Figure)
    assert made.layout.title.text
    assert made.layout.template.layout.font.family.startswith("system-ui")
    drawn = [t.cells.values if t.type == "table" else t.z if t.type == "heatmap" else t.y for t in made.data]
    assert drawn
    assert all(len(values) > 0 for values in drawn)


def test_residuals_after_the_causes_are_smaller_than_before(results):
    d = results["diagnosis"]
    before, after = (d.plot_residuals("q1", "cart1", after=after).data[0].y for after in (False, True))
    assert np.std(after) < 0.8 * np.std(before)


def test_the_effects_curve_is_its_parameter_within_the_interval(results):
    d = results["diagnosis"]
    half_width = d.causes[0].parameters["half_width"]
    lines = [t for t in d.plot_effect().data if t.mode == "lines" and t.name and t.fill]
    assert len(lines) == 2
    apart = abs(float(np.mean(lines[0].y)) - float(np.mean(lines[1].y))) * 1e-6
    assert apart == pytest.approx(2.0 * abs(half_width.value), abs=2.0 * (half_width.value - half_width.interval[0]))


WRONG = [
    ("calibration", "plot_residuals", {"against": "humidity"}, "temp_frame"),
    ("calibration", "plot_residuals", {"against": "q1", "component": "w"}, "cart1"),
    ("dataset", "plot_workspace", {"view": "zz"}, "xz"),
    ("dataset", "plot_workspace", {"color": "pose"}, "time"),
    ("diagnosis", "plot_effect", {"cause": 7}, "counted from 0"),
    ("diagnosis", "plot_effect", {"quantity": "colour"}, "travel of cart1"),
    ("accuracy", "plot_workspace", {"quantity": "colour"}, "position error"),
    ("comparison", "plot_angles", {"angle": "delta"}, "gamma"),
]


@pytest.mark.parametrize(("name", "method", "options", "hint"), WRONG)
def test_a_plot_of_what_is_not_there_names_what_is(results, name, method, options, hint):
    with pytest.raises(gtpin.GtpinError, match=hint):
        getattr(results[name], method)(**options)


def test_without_plotly_a_plot_says_which_extra_to_install(results, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "plotly.graph_objects", None)
    with pytest.raises(gtpin.GtpinError, match=r"pip install 'gtpin\[plots\]'"):
        results["dataset"].plot_workspace()
