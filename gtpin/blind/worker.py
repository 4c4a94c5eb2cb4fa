"""Diagnoses one case in a separate process that has no information on how the case was made.

It receives the files of a dataset's folder and writes them into a folder that contains nothing else. It must not import
the plant, and it stops with an error if the plant is already imported.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field

from gtpin.data import Commands, Dataset
from gtpin.diagnosis.diagnose import diagnose
from gtpin.errors import GtpinError
from gtpin.model.model import Model
from gtpin.threads import in_one_thread

Number = Annotated[float, Field(allow_inf_nan=False)]


class Outcome(BaseModel):
    """The outcome of diagnosing one case.

    Parameters
    ----------
    diagnosis
        The content of ``diagnosis.json``; None if the diagnosis failed.
    baseline, model
        (H, 3) positions, m, at ``commands.csv``, of the geometry alone and with the causes; None without such a file.
    error
        Message of the error with which the diagnosis failed.
    """

    diagnosis: dict[str, Any] | None = None
    baseline: list[list[Number]] | None = None
    model: list[list[Number]] | None = None
    error: str | None = None


@in_one_thread
def diagnose_alone(files: Mapping[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[Outcome, float]:
    """Diagnose the dataset with these files; return the outcome and the time that it took, s.

    An error of the diagnosis is part of the outcome and is not raised.
    """
    start = time.perf_counter()
    try:
        outcome = _diagnosed(files, exclude)
    except Exception as error:
        kind = "" if isinstance(error, GtpinError) else f"{type(error).__name__}: "
        outcome = Outcome(error=f"{kind}{error}")
    return outcome, time.perf_counter() - start


def _diagnosed(files: Mapping[str, bytes], exclude: tuple[str, ...]) -> Outcome:
    known = [name for name in sys.modules if name.startswith(("gtpin.plant", "gtpin.blind.draw"))]
    if known:
        raise GtpinError(f"this process knows the plant ({known[0]})", hint="diagnose in one that does not")
    with tempfile.TemporaryDirectory(prefix="gtpin-") as place, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(place) / "dataset"
        folder.mkdir()
        for name, content in files.items():
            (folder / name).write_bytes(content)
        diagnosis = diagnose(Dataset.read(folder), exclude=exclude)
        if not {"commands.csv", "commands.parquet"} & set(files):
            return Outcome(diagnosis=diagnosis.to_json())
        commands = Commands.read(folder / "commands.csv", diagnosis.baseline.model.robot.n_actuators)
        return Outcome(
            diagnosis=diagnosis.to_json(),
            baseline=_positions(diagnosis.baseline.model, commands),
            model=_positions(diagnosis.model, commands),
        )


def _positions(model: Model, commands: Commands) -> list[list[float]]:
    found: list[list[float]] = model.predict(commands.q, commands.covariates).T.tolist()
    return found
