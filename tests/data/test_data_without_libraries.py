"""Without pyarrow a CSV is read and a Parquet file is refused; without pandas the same is done as with it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gtpin.data import Commands, Dataset
from gtpin.data.files import write_table
from gtpin.data.ids import codes
from gtpin.errors import DatasetError


@pytest.fixture
def both(make, tmp_path: Path) -> Path:
    """A dataset as CSV, and beside it the same as Parquet: ``columns/``."""
    folder = make()
    (tmp_path / "columns").mkdir()
    (tmp_path / "columns" / "dataset.toml").write_bytes((folder / "dataset.toml").read_bytes())
    pd.read_csv(folder / "poses.csv", dtype={"pose": str}).to_parquet(tmp_path / "columns" / "poses.parquet")
    return tmp_path


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


COLUMNS = (
    np.array(["b", "a", "b", "10", "9", "é", ""], dtype=object),
    np.array([0.5, -0.0, 0.0, 2.0, -3.0, 2.0, 1e300]),
    np.array([3, 1, 3, 2, 2, 0, -1]),
)


@pytest.mark.parametrize("column", COLUMNS)
def test_codes_are_those_of_pandas(column):
    code, distinct = codes(column)
    wanted, names = pd.factorize(column, sort=True)
    assert code.tolist() == wanted.tolist()
    assert distinct.tolist() == list(names)


def test_there_are_no_codes_without_values():
    code, distinct = codes(np.array([], dtype=object))
    assert len(code) == len(distinct) == 0


def test_a_written_table_is_that_of_pandas(tmp_path):
    columns = {
        "text": np.array(["a", 'quoted "b"', "comma, c", "é", "", "two\nlines"], dtype=object),
        "number": np.array([0.1, -0.0, 1e-300, np.nan, np.inf, 123456789.125]),
        "count": np.array([1, -2, 3, 0, 10**12, 5]),
        "flag": np.array([True, False, True, True, False, False]),
        "missing": np.array([None, "x", np.nan, "y", None, "z"], dtype=object),
    }
    write_table(tmp_path / "ours.csv", columns)
    pd.DataFrame(columns).to_csv(tmp_path / "theirs.csv", index=False, lineterminator="\n", encoding="utf-8")
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "theirs.csv").read_bytes()


@pytest.mark.slow
def test_reading_a_csv_needs_no_pyarrow_and_imports_no_pandas(make):
    """In a process of its own: pandas decides at its import whether pyarrow is there."""
    code = "import sys; sys.modules['pyarrow'] = None; import gtpin; data = gtpin.Dataset.read(sys.argv[1]); "
    code += "print(data.visits.tolist(), 'pandas' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code, str(make())], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[0, 1, 2, 0] False"
