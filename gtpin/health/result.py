"""What a check says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gtpin.data import Dataset
from gtpin.diagnosis.inference.findings import Cause, Considered, Doubt, Question, Unexplained, Verdict
from gtpin.diagnosis.inference.where import Where
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.effects.effect import Effect
from gtpin.health.power import Smallest
from gtpin.model.model import Model
from gtpin.output.results import results_folder
from gtpin.output.shown import Presentation, Shown


@dataclass(frozen=True, repr=False)
class HealthCheck(Shown):
    """What has changed since an earlier model was identified; see ``docs/health.md``.

    Parameters
    ----------
    verdict, causes, candidates, where, gap, unexplained, doubts
        As of a :class:`~gtpin.diagnosis.result.Diagnosis`; the causes are changes since the model.
    baseline
        The earlier model, the instrument where it stands now.
    model
        It with the changes in, and updated by the check's poses.
    poses, set_aside, set_aside_rows
        Number of rows that were used; ids of poses that are gross errors, and their lines in the file.
    false_alarm, threshold
        Chance of an alarm where nothing has changed, and the gain in log evidence, nats, from which there is one.
    power, smallest
        The smallest change of each tested effect that poses like these show with that probability.
    assumed
        Covariates that were not recorded or did not vary, whose change since the model is possible all the same.
    noise
        Expected position error of the earlier model at these poses if nothing has changed, RMS, m: noise alone.
    free_frame
        Whether the instrument may stand anywhere.
    effects
        Those that were tried.
    dataset, seed
        The data, and the seed of the draws.

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
    noise: float
    free_frame: bool
    effects: tuple[Effect, ...]
    dataset: Dataset
    seed: int = 0
    questions: tuple[Question, ...] = ()
    next_experiment: tuple[Experiment, ...] = ()

    def effect(self, name: str) -> Effect:
        """The effect that has an id, of those that were tried."""
        return next(effect for effect in self.effects if effect.id == name)

    def to_json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        from gtpin.report.health_json import health_json  # sentences are made in the report

        return health_json(self)

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write what ``gtpin diagnose --against`` writes: ``diagnosis.json``, ``report.html``, ``baseline/`` and ``model/``.

        With ``force``, files of these names that gtpin has not written are moved aside (``NAME.old-1``).
        """
        from gtpin.report.health_files import CHECK, write_check

        with results_folder(Path(folder), CHECK, force=force) as new:
            write_check(self, new)

    def _presentation(self) -> Presentation:
        from gtpin.report.show.health import HealthPresentation

        return HealthPresentation(self)
