"""The files that ``gtpin calibrate``, ``gtpin diagnose`` and the results' ``save`` write."""

from __future__ import annotations

from pathlib import Path

from gtpin.calibration.result import Calibration
from gtpin.diagnosis.result import Diagnosis
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.report.calibration_page import calibration_page
from gtpin.report.calibration_text import calibration_text
from gtpin.report.diagnosis_page import diagnosis_page
from gtpin.report.experiments import FOLDER, write_experiments
from gtpin.threads import in_one_thread

CALIBRATION = ("calibration.json", "report.html", "report.txt", "model")
"""Names of the files of a calibration's folder."""
DIAGNOSIS = ("baseline", "model", "diagnosis.json", "report.html", FOLDER)
"""Names of the files of a diagnosis's folder."""


def write_calibration(calibration: Calibration, folder: Path) -> dict[str, object]:
    """Write ``model/``, ``calibration.json``, ``report.txt`` and ``report.html``; return the content of the JSON."""
    result = calibration.to_json()
    write_model(calibration.model, folder / "model")
    (folder / "calibration.json").write_text(json_text(result), encoding="utf-8")
    (folder / "report.txt").write_text(calibration_text(calibration), encoding="utf-8")
    (folder / "report.html").write_text(calibration_page(calibration, calibration.dataset), encoding="utf-8")
    return result


@in_one_thread
def write_diagnosis(found: Diagnosis, folder: Path) -> dict[str, object]:
    """Write ``baseline/``, ``model/``, ``diagnosis.json``, ``report.html`` and the next experiments' commands.

    Returns the content of ``diagnosis.json``.
    """
    result = found.to_json()
    write_model(found.baseline.model, folder / "baseline")
    write_model(found.model, folder / "model")
    (folder / "diagnosis.json").write_text(json_text(result), encoding="utf-8")
    write_experiments(found, found.dataset, folder)
    page = diagnosis_page(found, found.dataset, seed=found.seed)
    (folder / "report.html").write_text(page, encoding="utf-8")
    return result
