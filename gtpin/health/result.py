"""The result of a check."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gtpin.data import Dataset
from gtpin.diagnosis.inference.findings import Cause, Considered, Doubt, Question, Undecided, Unexplained, Verdict
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.effects.catalogue import effect_of
from gtpin.effects.effect import Effect
from gtpin.health.power import Smallest
from gtpin.model.model import Model
from gtpin.model.unexplained import Unexplained as LeftBefore
from gtpin.output.shown import Shown, present


@dataclass(frozen=True, repr=False)
class HealthCheck(Shown):
    """What has changed since an earlier model was identified; see ``docs/health.md``.

    Parameters
    ----------
    verdict, causes, candidates, where, gap, unexplained, doubts
        As in a :class:`~gtpin.diagnosis.result.Diagnosis`, but the causes are changes since the earlier model.
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
    questions, next_experiment, also
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

    verdict: Verdict
    causes: tuple[Cause, ...]
    candidates: tuple[Considered, ...]
    where: Where
    gap: Gap
    unexplained: Unexplained
    doubts: tuple[Doubt, ...]
    baseline: Model
    model: Model
    poses: int
    set_aside: tuple[str, ...]
    set_aside_rows: tuple[int, ...]
    false_alarm: float
    threshold: float
    power: float
    smallest: tuple[Smallest, ...]
    assumed: tuple[str, ...]
    unexplained_before: LeftBefore
    noise_known: bool
    free_frame: bool
    effects: tuple[Effect, ...]
    dataset: Dataset
    seed: int = 0
    questions: tuple[Question, ...] = ()
    next_experiment: tuple[Experiment, ...] = ()
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
        """Write what ``gtpin diagnose --against`` writes: ``diagnosis.json``, ``report.html``, ``baseline/`` and ``model/``.

        With ``force``, files of these names that gtpin has not written are renamed (``NAME.old-1``).
        """
        present(self).save(Path(folder), force=force)
