"""How a certificate is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from gtpin.certificate.result import Certificate
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.output.shown import Presentation
from gtpin.report.certificate_json import certificate_json, row_of
from gtpin.report.certificate_page import certificate_page, name_of, value_of
from gtpin.report.certificate_words import headline, statement, why

CERTIFICATE = ("certificate.json", "certificate.html", "model")
"""Names of what a certificate's folder holds; the model is the one that corrects the machine."""


@dataclass(frozen=True)
class CertificatePresentation(Presentation):
    """A certificate; its table is that of its numbers."""

    certificate: Certificate
    files = CERTIFICATE

    def short(self) -> str:
        """The certified uncertainty."""
        c = self.certificate
        return f"Certificate of {c.model.robot.name}\n{headline(c)}\n{statement(c)[0]}"

    def text(self) -> str:
        """The statement, and all numbers."""
        c = self.certificate
        numbers = [f"{name_of(q)}: {value_of(q) or f'blank: {why(q)}'}" for q in c.quantities]
        return "\n".join([headline(c), *statement(c), *numbers]) + "\n"

    def table(self) -> pd.DataFrame:
        """By symbol and site: value, standard uncertainty, unit, numbers of poses and rows, and why it is blank."""
        rows = [row_of(q) for q in self.certificate.quantities]
        return pd.DataFrame(rows).set_index(["symbol", "site"])

    def write(self, folder: Path) -> None:
        """Write the files of ``gtpin certify``."""
        write_certificate(self.certificate, folder)

    def json(self) -> dict[str, Any]:
        """The content of ``certificate.json``."""
        return certificate_json(self.certificate)


present = CertificatePresentation


def write_certificate(certificate: Certificate, folder: Path) -> dict[str, object]:
    """Write ``certificate.json``, ``certificate.html`` and the certified model; return the content of the JSON."""
    write_model(certificate.model, folder / "model")
    result = certificate.to_json()
    (folder / "certificate.json").write_text(json_text(result), encoding="utf-8")
    (folder / "certificate.html").write_text(certificate_page(certificate), encoding="utf-8")
    return result
