"""Diagnoses one case in a separate process that has no information on how the case was made.

It receives the files of a dataset's folder and writes them into a folder that contains nothing else. It must not import
the simulator, and it stops with an error if that is already imported.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from gtpin.data import Commands, Dataset
from gtpin.data.files import read_table
from gtpin.data.names import ORIENTATION
from gtpin.diagnosis.diagnose import diagnose
from gtpin.errors import GtpinError
from gtpin.instruments.predicted import predicted_readings
from gtpin.model.model import Model
from gtpin.threads import in_one_thread

Number = Annotated[float, Field(allow_inf_nan=False)]


class Outcome(BaseModel):
    """The outcome of diagnosing one case."""

    diagnosis: dict[str, Any] | None = None  # The content of ``diagnosis.json``; None if the diagnosis failed
    # `baseline`, `model`: (H, 3) positions, m, at ``commands.csv``, of the geometry alone and with the causes; None
    # without such a file
    baseline: list[list[Number]] | None = None
    model: list[list[Number]] | None = None
    # `baseline_readings`, `model_readings`: (H, c) readings at ``commands.csv`` that these models predict, by name of
    # the instrument, for a dataset of schema 2. Where there is a file ``commands-NAME.csv``, the instrument's readings
    # are at its commands and with its ids.
    baseline_readings: dict[str, list[list[Number]]] = {}
    model_readings: dict[str, list[list[Number]]] = {}
    error: str | None = None  # Message of the error with which the diagnosis failed


@in_one_thread
def diagnose_alone(files: Mapping[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[Outcome, float]:
    """Diagnose the dataset with these files; return the outcome and the time that it took, s.

    An error of the diagnosis is part of the outcome and is not raised.
    """
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="gtpin-") as place:
        try:
            outcome = _diagnosed(files, exclude, Path(place) / "dataset")
        except Exception as error:
            kind = "" if isinstance(error, GtpinError) else f"{type(error).__name__}: "
            outcome = Outcome(error=f"{kind}{error}")
        # Warnings and errors name the folder, which is another one each time: the same case has the same outcome.
        outcome = Outcome.model_validate_json(outcome.model_dump_json().replace(f"{place}/", ""))
    return outcome, time.perf_counter() - start


def _diagnosed(files: Mapping[str, bytes], exclude: tuple[str, ...], folder: Path) -> Outcome:
    known = [name for name in sys.modules if name.startswith(("gtpin.bench.simulator", "gtpin.bench.blind.draw"))]
    if known:
        raise GtpinError(f"this process knows the plant ({known[0]})", hint="diagnose in one that does not")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
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
            baseline_readings=readings_at(diagnosis.baseline.model, folder, commands),
            model_readings=readings_at(diagnosis.model, folder, commands),
        )


def _positions(model: Model, commands: Commands) -> list[list[float]]:
    found: list[list[float]] = model.predict(commands.q, commands.covariates).T.tolist()
    return found


def readings_at(model: Model, folder: Path, commands: Commands) -> dict[str, list[list[float]]]:
    """Readings of each instrument of a model, at ``commands`` or at the instrument's own file; for a tracker, positions."""
    if not model.instruments:
        return {}
    poses = model.predict(commands.q, commands.covariates)
    found: dict[str, list[list[float]]] = {}
    for one in model.instruments:
        file = folder / f"commands-{one.name}.csv"
        if file.exists():
            own = Commands.read(file, model.robot.n_actuators, ids=one.known)
            columns = read_table(file, ids=one.known).columns
            ids = {name: column for name, column in columns.items() if name in one.known}
            read = predicted_readings(model, model.predict(own.q, own.covariates), one.name, ids)
        else:  # ids in alphabetical order, repeated over the rows
            orders = {name: np.array(sorted(known), dtype=object) for name, known in one.known.items() if known}
            ids = {name: order[np.arange(len(commands)) % len(order)] for name, order in orders.items()}
            read = predicted_readings(model, poses, one.name, ids)
        found[one.name] = np.column_stack([values for name, values in read.items() if name not in ORIENTATION]).tolist()
    return found
