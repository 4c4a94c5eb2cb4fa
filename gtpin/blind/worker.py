"""Diagnoses one case, in a process of its own that knows nothing of how the case was made.

It is handed the files of a dataset's folder and puts them into a folder that holds nothing else. It must not import
the plant, and refuses to work where something else has.
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


class Said(BaseModel):
    """What came of diagnosing a case.

    Parameters
    ----------
    diagnosis
        The content of ``diagnosis.json``; None where it failed.
    baseline, model
        (H, 3) positions, m, at ``commands.csv``, before and after the causes were added; None without such a file.
    error
        What it failed with.
    """

    diagnosis: dict[str, Any] | None = None
    baseline: list[list[Number]] | None = None
    model: list[list[Number]] | None = None
    error: str | None = None


@in_one_thread
def diagnose_alone(files: Mapping[str, bytes], exclude: tuple[str, ...] = ()) -> tuple[Said, float]:
    """Diagnose the dataset whose files these are; give what was said, and how many seconds it took.

    Never raises but for the end of the process: an error is what came of the case.
    """
    start = time.perf_counter()
    try:
        said = _diagnosed(files, exclude)
    except Exception as error:
        kind = "" if isinstance(error, GtpinError) else f"{type(error).__name__}: "
        said = Said(error=f"{kind}{error}")
    return said, time.perf_counter() - start


def _diagnosed(files: Mapping[str, bytes], exclude: tuple[str, ...]) -> Said:
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
            return Said(diagnosis=diagnosis.to_json())
        commands = Commands.read(folder / "commands.csv", diagnosis.baseline.model.robot.n_actuators)
        return Said(
            diagnosis=diagnosis.to_json(),
            baseline=_positions(diagnosis.baseline.model, commands),
            model=_positions(diagnosis.model, commands),
        )


def _positions(model: Model, commands: Commands) -> list[list[float]]:
    found: list[list[float]] = model.predict(commands.q, commands.covariates).T.tolist()
    return found
