"""The results of a diagnosis, and of a check against an earlier model."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.experiment import Experiment
from gtpin.diagnosis.findings import (
    Cause,
    Considered,
    Doubt,
    Question,
    Smallest,
    Undecided,
    Unexplained,
    Verdict,
)
from gtpin.diagnosis.gap import Gap
from gtpin.diagnosis.shown_noise import Source
from gtpin.diagnosis.where import Where
from gtpin.effects.catalogue import catalogue, effect_of
from gtpin.effects.effect import Effect
from gtpin.model.fit_conditions import ModelDiscrepancy as LeftBefore
from gtpin.model.model import Model
from gtpin.output.shown import Shown, present

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True, repr=False, kw_only=True)
class Findings:
    """What a diagnosis and a check have in common: the parameters are those of :class:`Diagnosis`."""

    verdict: Verdict
    causes: tuple[Cause, ...]
    candidates: tuple[Considered, ...]
    where: Where
    gap: Gap
    unexplained: Unexplained
    model: Model
    set_aside: tuple[str, ...]
    set_aside_rows: tuple[int, ...]
    dataset: Dataset
    next_experiment: tuple[Experiment, ...] = ()
    questions: tuple[Question, ...] = ()
    effects: tuple[Effect, ...] = field(default_factory=catalogue)
    seed: int = 0
    doubts: tuple[Doubt, ...] = ()
    warnings: tuple[str, ...] = ()
    also: tuple[Undecided, ...] = ()

    def effect(self, name: str) -> Effect:
        """The effect with the id ``name``, of those that were tried; raises `ModelError` where there is none."""
        return effect_of(self.effects, name)

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        content: dict[str, Any] = present(self).json()
        return content

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write what ``gtpin diagnose`` writes: ``diagnosis.json``, ``report.html``, ``baseline/``, ``model/`` and next poses.

        With ``force``, files of these names that gtpin has not written are renamed (``NAME.old-1``).
        """
        present(self).save(Path(folder), force=force)


@dataclass(frozen=True, repr=False, kw_only=True)
class Diagnosis(Findings, Shown):
    """Verdict, causes, where the gap lies and how much of it the causes explain; see ``docs/diagnosis.md``.

    Parameters
    ----------
    verdict
        ``none``, ``explained``, ``ambiguous`` or ``unknown``: see ``docs/glossary.md``.
    causes
        The causes that are named, each with its class, parameters and explained fraction of the gap.
    candidates
        Every hypothesis that was considered: its gain in log evidence, or why it can't be tested.
    where
        Where the gap lies: by rod, site, axis, covariate and region.
    gap
        Errors on left-out poses, of the geometry alone and with the causes, and the noise floor.
    noise_source
        Where the noise floor comes from: ``declared``, ``repeats`` (repeated visits), or ``residuals``: an assumption.
    unexplained
        What the causes do not explain.
    baseline
        The calibration of the geometry alone.
    model
        The geometry and the causes, fitted together. The model without causes is ``baseline.model``.
    set_aside
        Ids of the poses with rows that are outliers even if the causes are taken into account.
    set_aside_rows
        Line numbers of these rows in their file.
    dataset
        The input data.
    next_experiment
        Proposals of what to measure next.
    questions
        Parameters of causes whose values physics does not allow, or are unusual for machines.
    effects
        The effects that were tried.
    seed
        Seed of the random numbers.
    warnings
        Texts of all warnings, also of those when the dataset was read.
    also
        What is weak and undecided beside the causes, and does not change the verdict.
    doubts
        Reasons for which something unknown is assumed. Each makes the verdict ``unknown``.

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

    baseline: Calibration
    noise_source: Source = "declared"

    def plot_residuals(self, against: str, component: str | None = None, *, after: bool = False) -> Figure:
        """Plot a component of the residuals against a command or covariate, with the prediction by the causes.

        Parameters
        ----------
        against
            The column: ``q1``, ``time``, ...
        component
            An axis of the pose (``x``, ``y``, ``z``, ``rx``, ``ry``, ``rz``), or the site of an actuator for the error of its
            travel. By default the first cause's site that is an actuator, else the axis with the largest share of the gap. For
            a dataset of schema 2 a component of its readings takes the place of the axis: its name (``range``) where there is
            one instrument; where there are several, the instrument's name (``wire``), followed by the component if it reads
            more than one (``cup.x``). The default is then the component of which the causes explain most.
        after
            True: the residuals of the geometry with the causes; False: those of the geometry alone.

        Raises
        ------
        DatasetError
            If there is no such column or component.
        """
        figure: Figure = present(self).residuals(against, component, after=after)
        return figure

    def plot_effect(self, cause: int = 0, quantity: str | None = None) -> Figure:
        """The curve of a cause with its 95 % interval, and the measurements less everything else that the model explains.

        Parameters
        ----------
        cause
            Index of the cause in ``causes``, counted from 0.
        quantity
            One of the quantities that the cause changes, ``travel of cart2`` for example; by default the first that the report
            shows.

        Raises
        ------
        GtpinError
            If there is no such cause, or it has no curve of this quantity; the message lists those that it has.
        """
        figure: Figure = present(self).effect(cause, quantity)
        return figure

    def plot_workspace(self, view: str = "xy", *, after: bool = False) -> Figure:
        """Plot the position residuals in a plane of the base frame: ``xy``, ``xz`` or ``yz``.

        ``after``: true for the residuals of the geometry with the causes, False for those of the geometry alone. For a dataset
        of schema 2: the size of each reading's residual over its sigma.
        """
        figure: Figure = present(self).workspace(view, after=after)
        return figure

    def plot_ball_bar(self, circle: int = 0) -> Figure:
        """Polar plots of a circular test: deviations of the radius as measured, and those that geometry and causes leave.

        The dataset needs a ``range`` instrument with readings along half a turn or more about a station, as a ball bar gives.

        Parameters
        ----------
        circle
            Index of the circle, counted from 0, where the dataset has several.

        Raises
        ------
        DatasetError
            If there is no such circle.
        """
        figure: Figure = present(self).ball_bar(circle)
        return figure

    def plot_parameters(self) -> Figure:
        """The table of the causes' parameters, as a figure."""
        figure: Figure = present(self).parameters()
        return figure


@dataclass(frozen=True, repr=False, kw_only=True)
class HealthCheck(Findings, Shown):
    """What has changed since an earlier model was identified; see ``docs/health.md``.

    Parameters
    ----------
    verdict, causes, candidates, where, gap, unexplained, doubts
        As in a :class:`Diagnosis`, but the causes are changes since the earlier model.
    baseline
        The earlier model, with the present pose of the instrument.
    model
        The earlier model with the changes added, fitted again with the check's poses. A change whose covariate is in
        ``assumed`` is left out: the model could not predict it.
    poses, set_aside, set_aside_rows
        Number of rows that were used; ids of the poses with rows that are gross errors, and the line numbers of these rows.
    false_alarm, threshold
        Probability of an alarm where nothing has changed, and the gain in log evidence, nats, from which a change is named.
    power, smallest
        For each tested effect, the smallest change that poses like these show with the probability ``power``.
    assumed
        Names of the temperatures whose change since the earlier model is not known. A check assumes that they may have
        changed.
    unexplained_before
        What the earlier model left unexplained of the data that it was fitted to. It is a part of the uncertainty of what the
        model predicts, so that changes that are smaller can't be told from it.
    noise_known
        Whether the noise was declared, or shown by repeated visits. Otherwise the noise floor of ``gap`` is what was left of
        the earlier model's fit.
    free_frame
        Whether the pose of the instrument is unknown and identified too.
    effects
        The effects that were tried.
    dataset, seed
        The input data, and the seed of the random draws.
    questions, next_experiment
        Empty: a check finds neither.
    warnings
        Texts of all warnings, also of those when the dataset was read.

    Examples
    --------
    >>> import gtpin
    >>> dataset = gtpin.Dataset.read("measured")
    >>> model = gtpin.calibrate(dataset).model
    >>> check = gtpin.diagnose(dataset.take(slice(0, 10)), against=model)
    >>> check.poses, check.power
    (10, 0.95)
    """

    baseline: Model
    poses: int
    false_alarm: float
    threshold: float
    power: float
    smallest: tuple[Smallest, ...]
    assumed: tuple[str, ...]
    unexplained_before: LeftBefore
    noise_known: bool
    free_frame: bool
