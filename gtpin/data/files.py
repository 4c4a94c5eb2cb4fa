"""Files: a file is read completely or not at all, and written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import importlib.util
import os
import stat
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from gtpin.data.csv_file import read_csv
from gtpin.data.table import Column, DataTable
from gtpin.errors import CONTROL, DatasetError, GtpinError, warn
from gtpin.memory import amount, require

LARGEST = 4e9
"""Largest size of a table, bytes."""
LARGEST_TEXT = 1e8
"""Largest size of a robot, a model, a description or a history, bytes."""
READING = 40e6
"""Bytes of memory that the libraries need to read a table of any size."""
READING_A_BYTE = 4.0
"""Bytes of memory for each byte of a table, in addition. Measured: 2.6 to 4.2 on CSV of 11 to 22 columns (docs/speed.md)."""


def warn_of(file: Path | str | None, text: str) -> None:
    """Warn of a file's content; the file comes first where it is known."""
    warn(f"{file}: {text}" if file else text)


def read_bytes(
    file: Path, error: type[GtpinError] = DatasetError, *, most: float = LARGEST, hint: str = "check the path"
) -> bytes:
    """Read a regular file; the one way in which gtpin reads its input files.

    Only regular files are opened for reading: a pipe can keep the process waiting, and a device may never end.

    ``error``: the kind of error to raise. ``most``: largest size, bytes. ``hint``: what to do where the file is not there.

    Raises `GtpinError` of the kind ``error``: the file is missing, is a folder, a pipe or a device, is too large, or is not
    readable.
    """
    try:
        found = file.stat()
        if stat.S_ISDIR(found.st_mode):
            raise error("this is a folder, not a file", file=file, hint=hint)
        if not stat.S_ISREG(found.st_mode):
            raise error("this is a pipe or a device, not a regular file", file=file, hint="save it as a file")
        if found.st_size > most:
            raise error(f"the file is larger than {amount(most)}", file=file, hint="give the file that was meant")
        return file.read_bytes()
    except FileNotFoundError:
        raise error("the file is missing", file=file, hint=hint) from None
    except (OSError, ValueError) as failed:
        reason = getattr(failed, "strerror", None) or str(failed)
        raise error(f"the file can't be read ({reason})", file=file, hint="check the path and rights") from None


def read_text(file: Path, error: type[GtpinError] = DatasetError, *, hint: str = "check the path") -> str:
    """Read a small text file in UTF-8, with or without BOM; see `read_bytes`. No text is an error of the kind ``error``."""
    try:
        return read_bytes(file, error, most=LARGEST_TEXT, hint=hint).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error("the file is not UTF-8", file=file, hint="save it as UTF-8") from None


def refuse_control(content: object, file: Path | str, error: type[GtpinError] = DatasetError) -> None:
    """Refuse control characters in names and texts of JSON, TOML or XML, because they would reach the terminal.

    ``content``: texts, and lists and mappings of them. Raises an error of the kind ``error``.
    """
    waiting = [content]
    while waiting:
        part = waiting.pop()
        if isinstance(part, str):
            if CONTROL.search(part):
                what = f"{part[:60]!r} has a control character"
                raise error(what, file=file, hint="write names in plain characters")
        elif isinstance(part, Mapping):
            waiting += [*part.keys(), *part.values()]
        elif isinstance(part, (list, tuple)):
            waiting += part


def check_folder(folder: Path, hint: str) -> None:
    """Raise `DatasetError` where a folder does not exist, is a file or can't be looked into."""
    try:
        if stat.S_ISDIR(folder.stat().st_mode):
            return
        what = "this is a file, not a folder"
    except (FileNotFoundError, NotADirectoryError):
        what, hint = "the folder does not exist", "check the path"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        what, hint = f"the folder can't be read ({reason})", "check the path and rights"
    raise DatasetError(what, file=folder, hint=hint)


def find_table(folder: Path, stem: str) -> Path | None:
    """Find STEM.csv or STEM.parquet in a folder; None where neither is there, `DatasetError` where both are."""
    found = [file for suffix in (".csv", ".parquet") if os.path.lexists(file := folder / f"{stem}{suffix}")]
    if len(found) > 1:
        what = f"both {stem}.csv and {stem}.parquet are there"
        raise DatasetError(what, file=folder, hint="keep the one that is meant")
    return found[0] if found else None


def read_table(file: Path, ignore: Collection[str] = (), ids: Collection[str] = ()) -> DataTable:
    """Read a CSV, or a Parquet file by its suffix; see `read_csv` and `read_parquet`.

    Raises `GtpinError` where the file needs more memory than is free, and `DatasetError` for a Parquet file without pyarrow.
    """
    with contextlib.suppress(OSError, ValueError):  # read_bytes reports these
        require(f"reading {file}", READING + file.stat().st_size * READING_A_BYTE)
    if file.suffix.lower() == ".parquet":
        _require_pyarrow(file)
        from gtpin.data.parquet_file import read_parquet

        return read_parquet(file, read_bytes(file), ignore, ids)
    return read_csv(file, read_bytes(file), ignore, ids)


def write_table(file: Path, columns: Mapping[str, Column]) -> None:
    """Write columns as CSV, or as Parquet by the file's suffix, so that reading gives bit-identical values.

    Raises `DatasetError` for a Parquet file without pyarrow.
    """
    if file.suffix.lower() == ".parquet":
        _require_pyarrow(file)
        import pandas as pd

        pd.DataFrame(dict(columns)).to_parquet(file, index=False)
        return
    with file.open("w", encoding="utf-8", newline="") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        # Nothing stands for NaN, which is not equal to itself.
        cells = (["" if v != v else v for v in np.asarray(column).tolist()] for column in columns.values())
        writer.writerows(zip(*cells, strict=True))


def _require_pyarrow(file: Path) -> None:
    if importlib.util.find_spec("pyarrow") is None:
        hint = "pip install 'gtpin[parquet]', or take a CSV file with the same columns"
        raise DatasetError("Parquet files need pyarrow", file=file, hint=hint)
