"""Sections of the pages of calibrations and diagnoses. Each file of this folder has some, each with its place on the page.

A new section is a new file here, with a function that is marked by :func:`section`. Places: 10 where it lies, 20 the causes, 30
what is left, 40 the instruments, 50 circular tests, 60 over the workspace, 70 against what was recorded, 80 evidence, 90 what
can't be told apart, 100 what could not be tested, 110 parameters, 120 what the data can't see, 130 data.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pkgutil import iter_modules

from gtpin.calibration.checks.prepared import with_positions
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.effect_curves import EffectCurve, curves
from gtpin.report.embedded import PlotChoice
from gtpin.report.page import Section
from gtpin.report.residual_plots import LAYERS, ONE_LAYER, View, components, leading
from gtpin.report.residuals import Residuals


@dataclass(frozen=True)
class Reported:
    """What a page is made from: a calibration; or a diagnosis, and the calibration of the geometry alone."""

    calibration: Calibration
    diagnosis: Diagnosis | None = None

    @cached_property
    def dataset(self) -> Dataset:
        """The data; for readings, the positions are those of the nominal TCP."""
        return with_positions((self.diagnosis or self.calibration).dataset, self.calibration.model.robot)

    @cached_property
    def residuals(self) -> Residuals:
        """Residuals of geometry alone, and of geometry with the causes."""
        d = self.diagnosis
        model, aside = (None, None) if d is None else (d.model, d.set_aside_rows)
        return Residuals.of(self.dataset, self.calibration, model, aside)

    @property
    def causes(self) -> bool:
        """Whether there are causes."""
        return self.diagnosis is not None and bool(self.diagnosis.causes)

    @property
    def layers(self) -> PlotChoice:
        """The choice between residuals of geometry alone and of geometry with the causes."""
        return LAYERS if self.causes else ONE_LAYER

    @cached_property
    def components(self) -> tuple[dict[str, View], PlotChoice]:
        """Views of the residuals along every component, and the choice between them."""
        d, first = self.diagnosis, self.residuals.first_component
        if d is not None:
            sites = [c.site for c in d.causes] or [site for site, _, _ in d.unexplained.correlates]
            first = leading(self.residuals, sites, d.where.axis)
        return components(self.residuals, first)

    @cached_property
    def curves(self) -> dict[tuple[str, str], tuple[EffectCurve, ...]]:
        """The curves of the causes, by effect and site."""
        effects = () if self.diagnosis is None else self.diagnosis.model.effects
        return {(active.effect.id, active.site): curves(active, self.residuals) for active in effects}


Make = Callable[[Reported], Section | None]
"""Makes a section; None where the page has none."""
_SECTIONS: list[tuple[float, Make]] = []


def section(place: float) -> Callable[[Make], Make]:
    """Mark a function that makes a section; sections stand in the order of their places."""

    def marked(make: Make) -> Make:
        _SECTIONS.append((place, make))
        return make

    return marked


def sections(reported: Reported) -> list[Section]:
    """All sections of a page, in their order."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    made = [make(reported) for _, make in sorted(_SECTIONS, key=lambda one: one[0])]
    return [one for one in made if one is not None]
