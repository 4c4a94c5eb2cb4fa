"""Without pyarrow a CSV is read, and a Parquet file is refused with the extra that reads it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from gtpin.data import Commands, Dataset
from gtpin.errors import DatasetError


@pytest.fixture
def both(make, tmp_path: Path) -> Path:
    """A dataset as CSV, and beside it the same as Parquet: ``columns/``."""
    folder = make()
    (tmp_path / "columns").mkdir()
    (tmp_path / "columns" / "dataset.toml").write_bytes((folder / "dataset.toml").read_bytes())
    pd.read_csv(folder / "poses.csv", dtype={"pose": str}).to_parquet(tmp_path / "columns" / "poses.parquet")
    return tmp_path


@pytest.mark.slow
def test_a_csv_needs_no_pyarrow(both: Path) -> None:
    """In a process of its own: pandas decides at its import whether pyarrow is there."""
    code = "import sys; sys.modules['pyarrow'] = None; import gtpin; print(len(gtpin.Dataset.read(sys.argv[1])))"
    command = [sys.executable, "-c", code, str(both / "set")]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert int(printed) == len(pd.read_csv(both / "set" / "poses.csv"))


def test_a_parquet_file_is_refused_with_the_extra_s_name(both: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DatasetError, match="Parquet files need pyarrow") as refused:
        Dataset.read(both / "columns")
    assert refused.value.hint is not None
    assert "gtpin[parquet]" in refused.value.hint
    assert refused.value.file == both / "columns" / "poses.parquet"


def test_nothing_is_left_of_a_parquet_file_that_can_t_be_written(both: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = Dataset.read(both / "set")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(DatasetError, match="Parquet files need pyarrow"):
        dataset.write(both / "new", table="parquet")
    with pytest.raises(DatasetError, match="Parquet files need pyarrow"):
        Commands(dataset.pose, dataset.q).write(both / "commands.parquet")
    assert sorted(path.name for path in both.iterdir()) == ["columns", "set"]
