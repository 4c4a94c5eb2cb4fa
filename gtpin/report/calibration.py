"""A calibration as text, table, figures, page and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gtpin.calibration.observability import UNSEEN
from gtpin.calibration.result import Calibration
from gtpin.model.model_folder import write_model
from gtpin.output.results import json_text
from gtpin.report.calibration_text import (
    best_frame,
    cannot_judge,
    elsewhere,
    exact_scales,
    lost,
    scatters,
    unseen_words,
    visits_over_declared,
)
from gtpin.report.fit import FitPresentation
from gtpin.report.geometry import geometry_words
from gtpin.report.page import Lead, Section
from gtpin.report.sections import sections
from gtpin.report.sections.parameters import parameter_table
from gtpin.report.sketch import drawing
from gtpin.report.steps import calibration_steps
from gtpin.report.words import quantity

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

CALIBRATION = ("calibration.json", "report.html", "report.txt", "model")
"""Names of the files of a calibration's folder."""
UNKNOWN = "residuals of the fit: the noise is not known"
"""Name of the noise where it was neither declared nor shown by repeated visits."""


@dataclass(frozen=True)
class CalibrationPresentation(FitPresentation):
    """A calibration; its table is that of its parameters."""

    files = CALIBRATION

    @cached_property
    def lead(self) -> Lead:
        """From the nominal to the calibrated geometry, which parameters make it, and what to do."""
        c, q, name = self.calibration, self.dataset.q, f"Calibration of {self.calibration.model.robot.name}"
        geometry, table = geometry_words(c.model, q)
        tone, badge, headline, advice = _verdict(c)
        return Lead(
            f"{name} · {len(c.names)} parameters from {c.poses} measurements",
            "\n".join(filter(None, (geometry, headline))),
            [*advice, *elsewhere(c), *exact_scales(c)],
            _numbers(c),
            badge,
            tone,
            drawing(c.model, q.mean(axis=0)),
            content=table,
            steps=calibration_steps(c),
            warnings=c.warnings,
            tab=name,
        )

    @cached_property
    def sections(self) -> Sequence[Section]:
        """The sections of the page."""
        return sections(self)

    def table(self) -> pd.DataFrame:
        """A row for each parameter: ``value sigma low high unit nominal tolerance learned``, by its name."""
        import pandas as pd

        c = self.calibration
        estimates = zip(map(c.__getitem__, c.names), c.model.geometry.parameters, c.variance_reduction, strict=True)
        rows = [(e.value, e.sigma, *e.interval, e.unit, p.nominal, p.tolerance, share) for e, p, share in estimates]
        columns = ["value", "sigma", "low", "high", "unit", "nominal", "tolerance", "learned"]
        return pd.DataFrame(rows, columns=columns, index=pd.Index(c.names, name="parameter"))

    def parameters(self) -> Figure:
        """The report's table of all parameters."""
        return parameter_table(self.calibration).figure("Parameters of the geometry")

    def write(self, folder: Path) -> dict[str, object]:
        """Write ``model/``, ``calibration.json``, ``report.txt`` and ``report.html``; return the content of the JSON."""
        c, result = self.calibration, self.calibration.to_json()
        write_model(c.model, folder / "model")
        (folder / "calibration.json").write_text(json_text(result), encoding="utf-8")
        (folder / "report.txt").write_text(self.text(), encoding="utf-8")
        (folder / "report.html").write_text(self.page(), encoding="utf-8")
        return result

    def unseen(self) -> tuple[str, ...]:
        """A sentence for each direction that the data do not determine."""
        c, found = self.calibration, self.calibration.observability
        unseen = found.variance_reduction < UNSEEN
        return unseen_words(c.model.geometry, found.directions[:, unseen], found.variance_reduction[unseen], c.remedies)


def _verdict(c: Calibration) -> tuple[str, str, str, list[str]]:
    """Tone, badge, headline and advice."""
    if c.model.doubt:
        return "warn", "geometry in doubt", "", [f"{c.model.doubt[:1].upper()}{c.model.doubt[1:]}."]
    if c.worse:
        return "bad", "worse than nominal", f"{c.worse[0].upper()}{c.worse[1:]}.", []
    if not c.explained:
        headline = (
            f"Geometry alone does not explain these data: the mean residuals of the poses are {c.sigma_scale:.2f} times their "
            "noise."
        )
        advice = [
            "The sigmas are multiplied by this ratio. Effects can change the parameters by more: gtpin diagnose looks for them."
        ]
        return "warn", "not all explained", headline, advice
    for one in lost(c):
        before, out = (quantity(value, one.unit) for value in (one.before, one.left_out))
        headline = (
            f"These poses are too few for {len(c.names)} parameters: at poses left out of the fit, the {one.what} is "
            f"{out}, and {before} with the nominal geometry."
        )
        return "bad", "too few poses", headline, []
    if why := cannot_judge(c):
        headline = "Whether the geometry explains these data can't be judged: their noise is not known."
        return "accent", "fit not judged", headline, [f"Declare the sigmas. Chi-square can't judge the fit: {why}."]
    if (ratio := visits_over_declared(c)) > 1.0:
        headline = (
            f"The residuals agree with the scatter between visits, which is {ratio:.2g} times the declared noise."
        )
        wrong = "The declared sigma is wrong, or something changes between the visits: gtpin diagnose looks for it."
        return "warn", "fits within its scatter", headline, [wrong]
    if hidden := scatters(c):
        headline = "The residuals agree with the noise, of which the scatter between visits is a large part."
        return "accent", "fits within its scatter", headline, [hidden]
    return "good", "fits", "The residuals agree with the noise of instrument and repeatability.", []


def _numbers(c: Calibration) -> list[tuple[str, str]]:
    numbers = []
    noise = "noise alone, by repeated visits" if visits_over_declared(c) > 1.0 else "noise alone"
    for one in c.by_instrument:
        numbers.append((quantity(one.before, one.unit), f"nominal geometry{best_frame(c)}: {one.what}, RMS"))
        numbers.append((quantity(one.left_out, one.unit), "calibrated geometry, at left-out poses"))
        numbers.append((quantity(one.floor, one.unit), noise if c.shows_noise(one) else UNKNOWN))
    meaning = ", which can't judge the fit here" if cannot_judge(c) else f", 1 ± {np.sqrt(2.0 / c.dof):.2f} if it fits"
    return [*numbers, (f"{c.chi2_per_dof:.2f}", f"chi-square per degree of freedom{meaning}")]
