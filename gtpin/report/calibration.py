"""A calibration as text, table, figures, page and files."""

from __future__ import annotations

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
    calibration_summary,
    calibration_text,
    cannot_judge,
    elsewhere,
    scatters,
    unseen_words,
)
from gtpin.report.page import Lead, report
from gtpin.report.provenance import provenance
from gtpin.report.sections import FitPresentation, Reported, sections
from gtpin.report.sections.parameters import geometry_tables
from gtpin.report.sketch import drawing
from gtpin.report.words import joined, quantity

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

CALIBRATION = ("calibration.json", "report.html", "report.txt", "model")
"""Names of the files of a calibration's folder."""
UNKNOWN = "noise as the fit shows it: neither declared nor shown by repeated visits"
"""What the noise is called where it was neither declared nor shown by repeated visits."""


@dataclass(frozen=True)
class CalibrationPresentation(FitPresentation):
    """A calibration; its table is that of its parameters."""

    calibration: Calibration
    files = CALIBRATION

    def short(self) -> str:
        """Numbers of parameters and poses, the errors, and chi-square."""
        c = self.calibration
        sizes = [(b.what, quantity(b.before, b.unit), quantity(b.after, b.unit)) for b in c.by_instrument]
        errors = "\n".join(f"{what}, RMS: {before} nominal, {after} calibrated" for what, before, after in sizes)
        return (
            f"Calibration of {c.model.robot.name}: {len(c.names)} parameters from {c.poses} measurements\n"
            f"{errors}\n"
            f"chi-square per degree of freedom: {c.chi2_per_dof:.3f}"
        )

    def text(self) -> str:
        """The content of ``report.txt``."""
        return calibration_text(self.calibration)

    def terminal(self) -> str:
        """The fit, the noise, and the number of observable directions."""
        return calibration_summary(self.calibration)

    def table(self) -> pd.DataFrame:
        """A row for each parameter: ``value sigma low high unit nominal tolerance learned``, by its name."""
        import pandas as pd

        c = self.calibration
        estimates = zip(map(c.__getitem__, c.names), c.model.geometry.parameters, c.variance_reduction, strict=True)
        rows = [(e.value, e.sigma, *e.interval, e.unit, p.nominal, p.tolerance, share) for e, p, share in estimates]
        columns = ["value", "sigma", "low", "high", "unit", "nominal", "tolerance", "learned"]
        return pd.DataFrame(rows, columns=columns, index=pd.Index(c.names, name="parameter"))

    @cached_property
    def reported(self) -> Reported:
        """What page and figures are made from."""
        return Reported(self.calibration)

    def parameters(self) -> Figure:
        """The report's table of all parameters."""
        _, every = geometry_tables(self.calibration)
        return every.figure("Parameters of the geometry")

    def write(self, folder: Path) -> dict[str, object]:
        """Write ``model/``, ``calibration.json``, ``report.txt`` and ``report.html``; return the content of the JSON."""
        c, result = self.calibration, self.calibration.to_json()
        write_model(c.model, folder / "model")
        (folder / "calibration.json").write_text(json_text(result), encoding="utf-8")
        (folder / "report.txt").write_text(calibration_text(c), encoding="utf-8")
        (folder / "report.html").write_text(calibration_page(c), encoding="utf-8")
        return result

    def unseen(self) -> tuple[str, ...]:
        """A sentence for each direction that the data hardly show."""
        c, found = self.calibration, self.calibration.observability
        unseen = found.variance_reduction < UNSEEN
        return unseen_words(c.model.geometry, found.directions[:, unseen], found.variance_reduction[unseen], c.remedies)


def calibration_page(c: Calibration) -> str:
    """The whole report of a calibration as one self-contained HTML file: fit, parameters, unobservable directions."""
    robot, reported = c.model.robot, Reported(c)
    tone, badge, headline, advice = _verdict(c)
    lead = Lead(
        f"Calibration of {robot.name} · {len(c.names)} parameters from {c.poses} measurements",
        headline,
        advice,
        _numbers(c),
        badge,
        tone,
        drawing(c.model, reported.dataset.q.mean(axis=0)),
    )
    return report(f"Calibration of {robot.name}", lead, sections(reported), provenance(reported.dataset, robot))


def _verdict(c: Calibration) -> tuple[str, str, str, list[str]]:
    changes, others = [], []
    for one in c.by_instrument:
        before, after, out = (quantity(value, one.unit) for value in (one.before, one.after, one.left_out))
        changes.append(f"the {one.what} from {before} to {after}")
        others.append(out if len(c.by_instrument) == 1 else f"{out} ({one.what})")
    headline = (
        f"Calibration reduces {joined(changes)}, RMS, on the fitted poses. "
        f"At poses that are left out of the fit {'it is' if len(others) == 1 else 'they are'} {joined(others)}."
    )
    headline = " ".join([headline, *elsewhere(c)])
    if not c.explained:
        advice = [
            f"The mean residuals of the poses are {c.sigma_scale:.2f} times their noise: "
            "geometry alone does not explain these data.",
            "gtpin diagnose finds the causes of the rest. The sigmas below are enlarged accordingly.",
        ]
        return "warn", "not all explained", headline, advice
    if why := cannot_judge(c):
        advice = [f"Declare the sigmas. Of chi-square: {why}."]
        return "accent", "fit not judged", headline, advice
    if hidden := scatters(c):
        advice = [hidden, "gtpin diagnose tests whether it has a cause."]
        return "accent", "fits within its scatter", headline, advice
    return "good", "fits", headline, ["The residuals agree with the noise of instrument and repeatability."]


def _numbers(c: Calibration) -> list[tuple[str, str]]:
    numbers = []
    for one in c.by_instrument:
        numbers.append((quantity(one.before, one.unit), f"{one.what}, nominal"))
        numbers.append((quantity(one.after, one.unit), "calibrated"))
        numbers.append((quantity(one.left_out, one.unit), "at poses left out of the fit"))
        numbers.append((quantity(one.floor, one.unit), "noise alone" if c.noise_known else UNKNOWN))
    meaning = ", which can't judge the fit here" if cannot_judge(c) else f", 1 ± {np.sqrt(2.0 / c.dof):.2f} if it fits"
    return [*numbers, (f"{c.chi2_per_dof:.2f}", f"chi-square per degree of freedom{meaning}")]
