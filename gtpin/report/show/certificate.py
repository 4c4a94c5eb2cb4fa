"""How a certificate is shown."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from gtpin.certificate.result import Certificate
from gtpin.output.shown import Presentation
from gtpin.report.certificate_json import row_of
from gtpin.report.certificate_page import name_of, value_of
from gtpin.report.certificate_words import headline, statement, why


@dataclass(frozen=True)
class CertificatePresentation(Presentation):
    """A certificate; its table is that of its numbers."""

    certificate: Certificate

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
