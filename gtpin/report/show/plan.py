"""How a plan of poses is shown."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from gtpin.health.plan import PosePlan
from gtpin.output.shown import Presentation
from gtpin.report.plan_json import plan_json
from gtpin.report.plan_words import plan_words, smallest_words, usual


@dataclass(frozen=True)
class PlanPresentation(Presentation):
    """A plan; its table is that of its commands."""

    plan: PosePlan

    def short(self) -> str:
        """The purpose of the poses, and what they can show."""
        worst = [f"{one.effect} at {one.site}: {smallest_words(one)}" for one in usual(self.plan.smallest)]
        return "\n".join([*plan_words(self.plan), *worst])

    def text(self) -> str:
        """The sentences, and the numbers of all changes or effects that the poses can show."""
        rows = [*map(asdict, self.plan.smallest), *map(asdict, self.plan.told)]
        table = [pd.DataFrame(rows).to_string(index=False)] if rows else []
        return "\n".join([*plan_words(self.plan), *table]) + "\n"

    def table(self) -> pd.DataFrame:
        """The commands, with the conditions to set."""
        commands = self.plan.commands
        columns = {f"q{i + 1}": commands.q[:, i] for i in range(commands.n_actuators)}
        return pd.DataFrame({"pose": commands.pose, **columns, **commands.covariates}).set_index("pose")

    def json(self) -> dict[str, Any]:
        """The content of ``plan.json``."""
        return plan_json(self.plan)


present = PlanPresentation
