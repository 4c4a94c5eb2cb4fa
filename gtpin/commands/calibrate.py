"""``gtpin calibrate``: identify the geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.calibration.calibrate import calibrate as run_calibration
from gtpin.calibration.result import Calibration
from gtpin.commands.terminal import AsJson, DatasetFolder, Force, Output, progress_of, tell, write_json
from gtpin.data import Dataset
from gtpin.model.model_folder import write_model
from gtpin.output.results import results_folder
from gtpin.report.calibration_page import calibration_page
from gtpin.report.calibration_text import calibration_summary, calibration_text

FILES = ("calibration.json", "report.html", "report.txt", "model")


def calibrate(
    dataset: DatasetFolder,
    output: Output,
    model: Annotated[
        int | None,
        typer.Option(
            "--model", help="One of the paper's models 1 to 5 instead of the default parameters.", min=1, max=5
        ),
    ] = None,
    orientations: Annotated[
        bool, typer.Option("--cart-orientation", help="Measured tracks: interpolate the measured cart orientation too.")
    ] = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Identify the robot's geometry from measured poses."""
    with results_folder(output, FILES, force=force) as folder:
        read = Dataset.read(dataset)
        with progress_of("calibrating") as progress:
            calibration = run_calibration(read, model=model, orientations=orientations, progress=progress)
        result = write_calibration(calibration, folder, model)
        (folder / "report.html").write_text(calibration_page(calibration, read), encoding="utf-8")
    written = f"\nWritten: {', '.join(str(output / name) for name in FILES)}\nOpen {output / 'report.html'}"
    tell(result, calibration_summary(calibration) + written, as_json)


def write_calibration(calibration: Calibration, folder: Path, model: int | None = None) -> dict[str, object]:
    """Write ``model/``, ``calibration.json`` and ``report.txt``; give what ``calibration.json`` holds."""
    result = calibration.to_json() | {"model": "default" if model is None else model}
    write_model(calibration.model, folder / "model")
    write_json(folder / "calibration.json", result)
    (folder / "report.txt").write_text(calibration_text(calibration), encoding="utf-8")
    return result
