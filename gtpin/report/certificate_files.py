"""The files that ``gtpin certify`` and the result's ``save`` write."""

from __future__ import annotations

from pathlib import Path

from gtpin.certificate.result import Certificate
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.report.certificate_page import certificate_page

CERTIFICATE = ("certificate.json", "certificate.html", "model")
"""Names of what a certificate's folder holds; the model is the one that corrects the machine."""


def write_certificate(certificate: Certificate, folder: Path) -> dict[str, object]:
    """Write ``certificate.json``, ``certificate.html`` and the certified model; return the content of the JSON."""
    write_model(certificate.model, folder / "model")
    result = certificate.to_json()
    (folder / "certificate.json").write_text(json_text(result), encoding="utf-8")
    (folder / "certificate.html").write_text(certificate_page(certificate), encoding="utf-8")
    return result
