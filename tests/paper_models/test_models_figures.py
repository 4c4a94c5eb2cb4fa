"""Figures of a comparison, and its files."""

import builtins
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gtpin.comparison import figures
from gtpin.comparison.result import Comparison, Held
from gtpin.errors import GtpinError, GtpinWarning

N = 25


def comparison(models: tuple[int, ...] = (1, 2, 3, 4, 5), *, turned: bool = True) -> Comparison:
    rng = np.random.default_rng(0)
    found = []
    for model in models:
        position = np.linalg.norm(1e-4 * rng.standard_normal((N, 3)), axis=1)
        angles = 1e-4 * rng.standard_normal((N, 3)) if turned else None
        turn = np.abs(angles[:, 0]) if turned else None
        pose = np.arange(N).astype(str).astype(object)
        found.append(Held(model, np.arange(N), pose, position, turn, angles, None, (False,) * 6))
    return Comparison(tuple(found), 0, "pose")


def without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest, **named):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)


@pytest.mark.parametrize(("turned", "panels"), [(True, 4), (False, 3)])
def test_position_errors_have_a_bar_for_each_model_and_figure(turned: bool, panels: int):
    pytest.importorskip("matplotlib")
    result = comparison((1, 3), turned=turned)
    axes = figures.position_errors(result).axes
    assert len(axes) == panels
    heights = [bar.get_height() for bar in axes[0].patches]
    assert np.allclose(heights, result.table()["mean_um"])


@pytest.mark.slow
def test_a_comparison_on_disk_is_a_table_a_json_and_a_figure_with_the_same_bytes_each_time(tmp_path: Path):
    pytest.importorskip("matplotlib")
    result = comparison()
    figures.write_comparison(result, tmp_path)
    table = pd.read_csv(tmp_path / "compare.csv")
    assert list(table.columns) == ["model", "mean_um", "max_um", "rms_um", "orientation_rms_mrad", "poses"]
    assert np.allclose(table["mean_um"], result.table()["mean_um"], rtol=1e-15)
    told = json.loads((tmp_path / "compare.json").read_text(encoding="utf-8"))
    assert told["schema"] == "gtpin-compare/1"
    for row, model in zip(table.itertuples(), told["models"], strict=True):
        low, high = model["interval"]["mean_um"]
        assert low < row.mean_um == model["mean_um"] < high
    assert [file.name for file in tmp_path.glob("*.png")] == ["position_errors.png"]
    first = {name: (tmp_path / name).read_bytes() for name in ("compare.csv", "compare.json")}
    figures.write_comparison(comparison(), tmp_path)
    assert {name: (tmp_path / name).read_bytes() for name in first} == first


@pytest.mark.slow
def test_without_matplotlib_the_numbers_are_written_with_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    without_matplotlib(monkeypatch)
    with pytest.raises(GtpinError, match="matplotlib"):
        figures.position_errors(comparison())
    with pytest.warns(GtpinWarning, match="matplotlib"):
        figures.write_comparison(comparison(), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"compare.csv", "compare.json"}
