"""Ways to write the small dataset, to spoil it, and to compare what was read."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_dataset import LINES, TOML, table

from gtpin.data import Dataset
from gtpin.errors import DatasetError

Make = Callable[..., Path]
Fails = Callable[..., DatasetError]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Write a dataset folder; the default is the valid one."""

    def write(poses: str | bytes | None = None, toml: str | bytes | None = TOML, **tables: str | bytes) -> Path:
        folder = tmp_path / "set"
        folder.mkdir(exist_ok=True)
        tables["poses"] = table(*LINES) if poses is None else poses
        contents = {f"{name}.csv": text for name, text in tables.items()}
        if toml is not None:
            contents["dataset.toml"] = toml
        for name, text in contents.items():
            (folder / name).write_bytes(text.encode() if isinstance(text, str) else text)
        return folder

    return write


@pytest.fixture
def write(tmp_path: Path) -> Make:
    """Write a dataset folder of schema 2: its dataset.toml, and tables by name."""

    def put(toml: str, **tables: str) -> Path:
        folder = tmp_path / "several"
        folder.mkdir(exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
        (folder / "dataset.toml").write_text(toml)
        for name, text in tables.items():
            (folder / f"{name}.csv").write_text(text)
        return folder

    return put


@pytest.fixture
def fails() -> Fails:
    """Read a folder that can't be read, and give its error after checking where it points."""

    def read(folder: Path, row: int | None = None, column: str | None = None, file: str = "poses.csv") -> DatasetError:
        with pytest.raises(DatasetError) as caught:
            Dataset.read(folder)
        assert Path(str(caught.value.file)) == folder / file
        assert (caught.value.row, caught.value.column) == (row, column)
        assert "\n" not in str(caught.value)
        assert caught.value.hint
        return caught.value

    return read


@pytest.fixture
def same() -> Callable[[Dataset, Dataset], None]:
    """Assert that two datasets hold the same bits."""

    def compare(one: Dataset, other: Dataset) -> None:
        assert one.robot == other.robot
        assert (one.instrument, one.conditions, one.tolerance) == (other.instrument, other.conditions, other.tolerance)
        _same_rows(one, other, ("pose", "q", "position", "orientation"))
        assert (one.carts is None) == (other.carts is None)
        if one.carts is not None:
            _same_rows(one.carts, other.carts, ("cart", "q", "position", "orientation"))

    return compare


def _same_rows(one: object, other: object, fields: tuple[str, ...]) -> None:
    for name in fields:
        _same_bits(getattr(one, name), getattr(other, name))
    mine, theirs = one.covariates, other.covariates  # type: ignore[attr-defined]
    assert list(mine) == list(theirs)
    for name in mine:
        _same_bits(mine[name], theirs[name])


def _same_bits(one: np.ndarray | None, other: np.ndarray | None) -> None:
    if one is None or other is None:
        assert one is other
    elif one.dtype == object:
        assert one.tolist() == other.tolist()
    else:
        assert one.shape == other.shape
        assert one.astype(one.dtype, order="C").tobytes() == other.astype(one.dtype, order="C").tobytes()
