"""What the command writes, and the figures."""

import json
import sys
from pathlib import Path

import pandas as pd
import pytest
from accuracy_machines import LINKS, MODEL, commands, other

from gtpin.accuracy import figures, workspace
from gtpin.accuracy.analysis import analyse
from gtpin.errors import GtpinError, GtpinWarning, ModelError
from gtpin.model.model_folder import read_model
from gtpin.output.figure import new_figure

COSTS = dict(zip(LINKS, [2.5e-6, 1.7e-6, 1.5e-6, 4.5e-7, 3.1e-7, 5.7e-7], strict=True))


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workspace, "COUNTS", (3, 5, 5))


@pytest.mark.slow
def test_the_folder_holds_table_numbers_and_figures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    analyse(MODEL, commands(10), costs=COSTS).save(tmp_path / "out")
    names = {file.name for file in (tmp_path / "out").iterdir()}
    maps = {f"map_{name}.png" for name in ("position", "orientation", "condition", "singularity")}
    assert names == {".gtpin.json", "sensitivity.csv", "accuracy.json", "report.html", "sensitivity.png"} | maps
    table = pd.read_csv(tmp_path / "out" / "sensitivity.csv")
    assert list(table) == ["parameter", "link", "position_mm", "rotation_rad", "cost_m4"]
    assert len(table) == 60
    assert (table["cost_m4"] > 0.0).all()
    told = json.loads((tmp_path / "out" / "accuracy.json").read_text())
    assert told["schema"] == "gtpin-accuracy/1"
    assert told["poses"] == 10
    for part in told["expected"].values():
        assert 0.0 < part["mean"] < min(part["p95"], part["maximum"])


@pytest.mark.slow
def test_same_seed_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "all_figures", lambda *_: {})
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        figures.write_accuracy(analyse(MODEL, commands(5), costs=COSTS, seed=4), tmp_path / name)
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_without_matplotlib_there_is_a_warning_and_no_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, name, None)  # type: ignore[arg-type]
    with pytest.warns(GtpinWarning, match="matplotlib"):
        figures.write_accuracy(analyse(MODEL, commands(3)), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"sensitivity.csv", "accuracy.json"}
    with pytest.raises(GtpinError, match="gtpin\\[plots\\]"):
        new_figure(1.0, 1.0)


def test_tolerances_that_nobody_gave_are_said_to_be_assumed() -> None:
    told = analyse(read_model("ur10")).to_json()
    assert told["uncertainty"].startswith(
        "manufacturing tolerances (1 sigma) of 0.5 mm and 0.5 mrad, which are assumed"
    )


def test_without_costs_the_tolerances_are_what_is_uncertain() -> None:
    told = analyse(MODEL, commands(5).tolist()).to_json()  # a list will do
    assert told["uncertainty"] == "manufacturing tolerances (1 sigma) of 1 to 2 mm and 1 mrad"
    assert told["expected"]["position"]["mean"] > 1e-3  # of joints and rods that are off by a millimetre or two


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stewart", "rotary_tau"])
def test_other_robots_with_rods_are_analysed_over_a_default_set(name: str) -> None:
    model = other(name)
    found = analyse(model)
    assert len(found.q) == 180
    json.dumps(found.to_json(), allow_nan=False)
    assert set(found.sensitivity.to_table()["link"]) == {rod.name for rod in model.robot.rods}


@pytest.mark.slow
def test_a_platform_that_lies_level_has_no_zyz_angles_to_change() -> None:
    """A linear delta's TCP frame is turned like the base: alpha and gamma turn about one axis, and only their sum is told."""
    with pytest.warns(GtpinWarning, match="ZYZ angles jump"):
        found = analyse(other("linear_delta"))
    table = found.sensitivity.to_table()
    assert table["rotation_rad"].isna().all()
    assert (table["position_mm"] > 0.0).all()
    told = found.to_json()
    assert told["zyz_range"] is None
    assert told["expected"]["orientation"]["mean"] > 0.0
    json.dumps(told, allow_nan=False)


def test_costs_of_other_links_are_refused() -> None:
    with pytest.raises(ModelError, match="links 1, 2a"):
        analyse(MODEL, commands(3), costs={"1": 1e-6})


@pytest.mark.slow
def test_every_axis_of_every_figure_is_labelled() -> None:
    pytest.importorskip("matplotlib")
    q = commands(12)
    made = figures.all_figures(analyse(MODEL, q, costs=COSTS))
    for figure in made.values():
        assert figure.get_suptitle()
        assert any(axis.get_xlabel() for axis in figure.axes)
        assert any(axis.get_ylabel() for axis in figure.axes)
