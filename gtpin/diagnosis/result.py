"""What a diagnosis says."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.inference.findings import Cause, Considered, Doubt, Question, Unexplained, Verdict
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.effects.catalogue import catalogue
from gtpin.effects.effect import Effect
from gtpin.model.model import Model
from gtpin.output.results import results_folder
from gtpin.output.shown import Presentation, Shown

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """Verdict, causes, where the gap lies and how far it shrinks; see ``docs/diagnosis.md``.

    Parameters
    ----------
    model
        Predicts with the causes in; ``baseline.model`` without.
    set_aside
        Ids of the poses of which rows were taken for outliers, given the causes.
    set_aside_rows
        Lines of these rows in their file.
    next_experiment
        What to measure to tell more.
    dataset
        The data, as they were given.
    questions
        Parameters that are outside what physics allows or machines have.
    effects
        Those that were tried.
    doubts
        Why something unknown is inferred; each makes the verdict ``unknown``.
    seed
        Of the resampling behind intervals.

    Examples
    --------
    >>> import gtpin
    >>> diagnosis = gtpin.diagnose(gtpin.Dataset.read("measured"))
    >>> diagnosis.verdict
    'explained'
    >>> cause = diagnosis.causes[0]
    >>> cause.effect, cause.site
    ('backlash', 'cart1')
    >>> half_width = cause.parameters["half_width"]
    >>> half_width.unit, 0.0 < half_width.sigma < abs(half_width.value)
    ('m', True)
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    candidates: tuple[Considered, ...]
    where: Where
    gap: Gap
    unexplained: Unexplained
    baseline: Calibration
    model: Model
    set_aside: tuple[str, ...]
    set_aside_rows: tuple[int, ...]
    dataset: Dataset
    next_experiment: tuple[Experiment, ...] = ()
    questions: tuple[Question, ...] = ()
    effects: tuple[Effect, ...] = field(default_factory=catalogue)
    seed: int = 0
    doubts: tuple[Doubt, ...] = ()

    def effect(self, name: str) -> Effect:
        """The effect that has an id, of those that were tried."""
        return next(effect for effect in self.effects if effect.id == name)

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        from gtpin.report.diagnosis_json import diagnosis_json  # sentences are made in the report

        return diagnosis_json(self)

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write what ``gtpin diagnose`` writes: ``diagnosis.json``, ``report.html``, ``baseline/``, ``model/`` and next poses.

        With ``force``, files of these names that gtpin has not written are moved aside (``NAME.old-1``).
        """
        from gtpin.report.files import DIAGNOSIS, write_diagnosis

        with results_folder(Path(folder), DIAGNOSIS, force=force) as new:
            write_diagnosis(self, new)

    def plot_residuals(self, against: str, component: str | None = None, *, after: bool = False) -> Figure:
        """Residuals against a command (``q1``) or covariate, with what the causes make of them.

        Parameters
        ----------
        against
            The column.
        component
            ``x``, ``y``, ``z``, ``rx``, ``ry``, ``rz`` or the travel of an actuator by its site; by default that of the first
            cause's site, or the axis of which the gap has most.
            Of readings also a reading, by default: ``range`` of a single instrument; ``wire`` or ``cup.x`` of several.
        after
            Show what the geometry with the causes leaves, not what geometry alone leaves.
        """
        from gtpin.report.show.diagnosis import residuals_against

        return residuals_against(self, against, component, after=after)

    def plot_effect(self, cause: int = 0, quantity: str | None = None) -> Figure:
        """The curve of a cause with its 95 % interval, and the measurements less everything else that the model explains.

        Parameters
        ----------
        cause
            Its place in ``causes``.
        quantity
            Which of the quantities that it moves, ``travel of cart2`` for example; by default the first that is seen.
        """
        from gtpin.report.show.diagnosis import effect_curve

        return effect_curve(self, cause, quantity)

    def plot_workspace(self, view: str = "xy", *, after: bool = False) -> Figure:
        """Position residuals, of other readings their size over sigma, in a plane of the base frame (``xy``, ``xz``, ``yz``).

        Those of geometry alone, or ``after`` the causes were added.
        """
        from gtpin.report.show.diagnosis import workspace

        return workspace(self, view, after=after)

    def plot_ball_bar(self, circle: int = 0) -> Figure:
        """Polar plots of a circular test: deviations of the radius as measured, left by geometry alone, and with the causes.

        The data need a ``range`` instrument with readings along half a turn or more about a station, as a ball bar's are.

        Parameters
        ----------
        circle
            Place of the circle among those of the data, counted from 0.

        Raises
        ------
        DatasetError
            If there is no such circle.
        """
        from gtpin.report.show.diagnosis import ball_bar

        return ball_bar(self, circle)

    def plot_parameters(self) -> Figure:
        """The table of the causes' parameters."""
        from gtpin.report.show.diagnosis import parameter_table

        return parameter_table(self)

    def _presentation(self) -> Presentation:
        from gtpin.report.show.diagnosis import DiagnosisPresentation

        return DiagnosisPresentation(self)
