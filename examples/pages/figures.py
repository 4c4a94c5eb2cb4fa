"""Which figures the pages of docs show, which script measures each, and where its records lie.

A script has three functions: ``jobs(machines)`` gives what is to be measured, as dictionaries; ``measured(**job)`` measures
one, and gives rows of a table as dictionaries; ``table(records)`` makes Markdown of all rows. The rows, with their jobs,
are the records: a CSV file in docs/figures, from which the pages are made, and against which tests measure some again.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pandas as pd
from joblib import Parallel, delayed

ROOT = Path(__file__).parents[2]
RECORDS = ROOT / "docs" / "figures"
Row = Mapping[str, object]


@dataclass(frozen=True)
class Figure:
    """A table of the docs that a script measures; ``machines`` is how many of each kind it rests on."""

    name: str
    script: str
    machines: int

    @property
    def record(self) -> Path:
        """Where its rows lie."""
        return RECORDS / f"{self.name}.csv"

    def module(self) -> ModuleType:
        """The script as a module, loaded once: what a script keeps of one job serves the next ones."""
        name = f"figure_{self.name}"
        if name in sys.modules:
            return sys.modules[name]
        path = ROOT / "examples" / self.script
        if str(path.parent) not in sys.path:
            sys.path.insert(0, str(path.parent))
        found = importlib.util.spec_from_file_location(name, path)
        if found is None or found.loader is None:
            raise FileNotFoundError(path)
        module = importlib.util.module_from_spec(found)
        sys.modules[found.name] = module
        found.loader.exec_module(module)
        return module

    def measure(self, machines: int) -> pd.DataFrame:
        """Measure all rows anew."""
        jobs = self.module().jobs(machines)
        found = Parallel(n_jobs=-1)(delayed(rows_of)(self, job) for job in jobs)
        return pd.DataFrame([row for rows in found for row in rows])

    def records(self) -> pd.DataFrame:
        """The rows as they were measured last."""
        return pd.read_csv(self.record, keep_default_na=False)

    def table(self) -> str:
        """The table as the pages have it."""
        return str(self.module().table(self.records())).strip()


def rows_of(figure: Figure, job: Row) -> Sequence[Row]:
    """Measure one job: its rows, each with what the job was."""
    return [{**job, **row} for row in figure.module().measured(**job)]


FIGURES = (
    Figure("false_alarms", "diagnosis/false_alarms.py", 8),
    Figure("missing_covariates", "diagnosis/missing_covariates.py", 20),
    Figure("mistakes", "mistakes/bench.py", 5),
    Figure("next_experiment", "next_experiment/compare.py", 6),
    Figure("closed_loop", "next_experiment/closed_loop.py", 5),
    Figure("noise_floor", "diagnosis/noise_floor.py", 15),
    Figure("priors", "diagnosis/priors.py", 16),
    Figure("imitators", "effects/confusable.py", 1),
    Figure("instruments", "instruments/smallest_shown.py", 3),
    Figure("closed_circle", "simulator/closed_circle.py", 2),
    Figure("health", "health/power.py", 40),
    Figure("unlisted", "health/unlisted.py", 200),
    Figure("certificate", "certificate/unseen_poses.py", 100),
    Figure("pairs", "blind/pairs.py", 114),
    Figure("forms", "blind/forms.py", 2),
)
