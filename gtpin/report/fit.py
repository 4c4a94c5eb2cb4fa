"""What the pages and figures of calibrations and diagnoses are made from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from gtpin.calibration.checks.before_fit import with_positions
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.ball_bar import ball_bar_figure
from gtpin.report.effect_curves import EffectCurve, curves
from gtpin.report.figure import PlotChoice
from gtpin.report.page import PagePresentation, Table, provenance
from gtpin.report.residual_plots import LAYERS, ONE_LAYER, View, components, leading, residual_figure, workspace_figure
from gtpin.report.residuals import Residuals

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class FitPresentation(PagePresentation):
    """A calibration or a diagnosis, and what its sections and figures are made from."""

    result: Calibration | Diagnosis

    @property
    def diagnosis(self) -> Diagnosis | None:
        """The diagnosis; None for a calibration."""
        return self.result if isinstance(self.result, Diagnosis) else None

    @property
    def calibration(self) -> Calibration:
        """The calibration of the geometry alone."""
        return self.result.baseline if isinstance(self.result, Diagnosis) else self.result

    @cached_property
    def dataset(self) -> Dataset:
        """The data; for readings, the positions are those of the nominal TCP."""
        return with_positions(self.result.dataset, self.calibration.model.robot)

    @cached_property
    def residuals(self) -> Residuals:
        """Residuals of geometry alone, and of geometry with the causes."""
        if (d := self.diagnosis) is None:
            return Residuals.of(self.dataset, self.calibration)
        return Residuals.of(self.dataset, self.calibration, d.model, d.set_aside_rows)

    @property
    def origin(self) -> Table:
        """Versions and digests; of a diagnosis, its seed."""
        seed = None if self.diagnosis is None else self.diagnosis.seed
        return provenance(self.dataset, self.result.model.robot, seed)

    @property
    def causes(self) -> bool:
        """Whether there are causes."""
        return self.diagnosis is not None and bool(self.diagnosis.causes)

    @property
    def layers(self) -> PlotChoice:
        """The choice between residuals of geometry alone and of geometry with the causes."""
        return LAYERS if self.causes else ONE_LAYER

    def first_component(self, *sites: str) -> str:
        """The component that is shown where none is chosen; ``sites``: where to look if there are no causes."""
        if (d := self.diagnosis) is None:
            return self.residuals.first_component
        return leading(self.residuals, [c.site for c in d.causes] or sites, d.where.axis)

    @cached_property
    def components(self) -> tuple[dict[str, View], PlotChoice]:
        """Views of the residuals along every component, and the choice between them."""
        correlates = () if self.diagnosis is None else self.diagnosis.unexplained.correlates
        return components(self.residuals, self.first_component(*(one.site for one in correlates)))

    @cached_property
    def curves(self) -> dict[tuple[str, str], tuple[EffectCurve, ...]]:
        """The curves of the causes, by effect and site."""
        effects = () if self.diagnosis is None else self.diagnosis.model.effects
        return {(active.effect.id, active.site): curves(active, self.residuals) for active in effects}

    def against(self, column: str, component: str | None, *, after: bool = False) -> Figure:
        """Residuals against a column, with the causes' prediction."""
        component = component or self.first_component()
        return residual_figure(self.residuals, column, component, causes=self.causes, after=after)

    def ball_bar(self, circle: int) -> Figure:
        """Deviations of the radius along a circle."""
        return ball_bar_figure(self.residuals, circle, self.causes)

    def workspace(self, view: str, *, after: bool = False) -> Figure:
        """Position residuals, or errors of readings, over the workspace."""
        return workspace_figure(self.residuals, view, after=after)
