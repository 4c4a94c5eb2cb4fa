"""The files that ``gtpin diagnose --against`` and the result's ``save`` write."""

from __future__ import annotations

from pathlib import Path

from gtpin.health.result import HealthCheck
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.report.experiments import FOLDER
from gtpin.report.files import DIAGNOSIS
from gtpin.report.health_page import health_page
from gtpin.threads import in_one_thread

CHECK = DIAGNOSIS
"""Names of the files of a check's folder: those of a diagnosis, so that one replaces the other."""


@in_one_thread
def write_check(check: HealthCheck, folder: Path) -> dict[str, object]:
    """Write ``baseline/``, ``model/``, ``diagnosis.json`` and ``report.html``; return the content of the JSON."""
    result = check.to_json()
    write_model(check.baseline, folder / "baseline")
    write_model(check.model, folder / "model")
    (folder / FOLDER).mkdir()  # a check proposes no experiments: an older diagnosis's are removed
    (folder / "diagnosis.json").write_text(json_text(result), encoding="utf-8")
    (folder / "report.html").write_text(health_page(check), encoding="utf-8")
    return result
