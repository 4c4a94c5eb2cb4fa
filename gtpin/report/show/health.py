"""How a check against an earlier model is shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from gtpin.diagnosis.result import HealthCheck
from gtpin.output.shown import Presentation
from gtpin.report.health_json import health_json
from gtpin.report.health_page import CHECK, write_check
from gtpin.report.health_words import advice, headline, power_words, unseen


@dataclass(frozen=True)
class HealthPresentation(Presentation):
    """A check; its table is that of the smallest changes that its poses show."""

    check: HealthCheck
    files = CHECK

    def short(self) -> str:
        """Verdict, changes and power."""
        c = self.check
        return f"Check against an earlier model: {c.verdict}\n{headline(c)}\n{power_words(c)}"

    def text(self) -> str:
        """All sentences."""
        c = self.check
        return "\n".join([headline(c), *advice(c), power_words(c), "Not shown by these poses:", *unseen(c)]) + "\n"

    def table(self) -> pd.DataFrame:
        """By effect and site: evidence, probability, and the smallest change that the poses show."""
        smallest = {(s.effect, s.site): s for s in self.check.smallest}
        rows = []
        for c in self.check.candidates:
            s = smallest.get((c.effect, c.site))
            rows.append(
                {
                    "effect": c.effect,
                    "site": c.site,
                    "testable": c.testable,
                    "log_evidence": c.log_evidence,
                    "probability": c.probability,
                    "parameter": s.parameter if s else "",
                    "smallest": s.value if s else None,
                    "unit": s.unit if s else "",
                }
            )
        return pd.DataFrame(rows).set_index(["effect", "site"])

    def write(self, folder: Path) -> None:
        """Write the files of ``gtpin diagnose --against``."""
        write_check(self.check, folder)

    def json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        return health_json(self.check)


present = HealthPresentation
