"""How a proposed experiment is shown."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.diagnosis.planning.experiment import Experiment
from gtpin.report.measurements import measure_words


@dataclass(frozen=True)
class ExperimentPresentation:
    """A proposed experiment."""

    experiment: Experiment

    def short(self) -> str:
        """What to measure, in a sentence or two."""
        return measure_words(self.experiment)


present = ExperimentPresentation
