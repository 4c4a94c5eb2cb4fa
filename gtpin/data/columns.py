"""From a table's columns to the parts of a dataset: commands, measurements, covariates."""

from __future__ import annotations

from collections.abc import Collection

from gtpin.data.names import ORIENTATION, command_names, is_command, lookalikes
from gtpin.data.table import Column, Table
from gtpin.errors import DatasetError, warn
from gtpin.typing import Floats


def commands(table: Table) -> Floats:
    """Give q1 .. qn, (N, n); raises `DatasetError` for a gap in the numbers or none at all."""
    found = sum(is_command(name) for name in table.names)
    return table.matrix(command_names(max(found, 1)))


def orientation(table: Table) -> Floats | None:
    """Give qw qx qy qz, (N, 4); None where all four are missing, `DatasetError` where some are."""
    missing = [name for name in ORIENTATION if name not in table.names]
    if len(missing) == 4:
        return None
    if missing:
        hint = "give all of qw qx qy qz, or none where only positions were measured"
        raise DatasetError("the column is missing", file=table.file, row=1, column=missing[0], hint=hint)
    return table.matrix(ORIENTATION)


def covariates(table: Table, taken: Collection[str]) -> dict[str, Column]:
    """Give all columns that are not taken, by name."""
    return {name: values for name, values in table.columns.items() if name not in taken}


def warn_of_covariates(table: Table, taken: Collection[str]) -> None:
    """Warn of columns that were left out because they hold words, and of names that look like a known one but differ."""
    names = [name for name in table.names if name not in taken]
    words = [name for name in names if name not in table.columns]
    if words:
        text = f"{table.file}: {', '.join(words)}: no numbers, so no covariate; ignored"
        warn(text)
    alike = lookalikes(names)
    if alike:
        pairs = ", ".join(f"{name!r} is not {known!r}" for name, known in alike.items())
        text = (
            f"{table.file}: {pairs}: kept as covariates of their own, which no effect of gtpin's looks at; "
            "rename them if the known ones are meant"
        )
        warn(text)
