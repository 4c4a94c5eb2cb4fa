"""The files that ``gtpin certify`` and the result's ``save`` write."""

from __future__ import annotations

from pathlib import Path

from gtpin.certificate.result import Certificate
from gtpin.output.json_text import json_text
from gtpin.report.certificate_page import certificate_page

CERTIFICATE = ("certificate.json", "certificate.html")
"""Names of the files of a certificate's folder."""


def write_certificate(certificate: Certificate, folder: Path) -> dict[str, object]:
    """Write ``certificate.json`` and ``certificate.html``; return the content of the JSON."""
    result = certificate.to_json()
    (folder / "certificate.json").write_text(json_text(result), encoding="utf-8")
    (folder / "certificate.html").write_text(certificate_page(certificate), encoding="utf-8")
    return result
