"""A plan of poses as sentences, table, terminal text and JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType

from gtpin.output.results import fields, json_text
from gtpin.output.shown import SavedPresentation
from gtpin.planning.plan import PosePlan, checked_first
from gtpin.report.page import Table, as_text
from gtpin.report.phrases import known_as
from gtpin.report.residuals import columns_of
from gtpin.report.words import counted, length, percent, quantity

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PosePlanPresentation(SavedPresentation):
    """A plan; its table is that of its commands."""

    plan: PosePlan
    files = ("commands.csv", "plan.json")

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin plan``; return the content of the JSON."""
        self.plan.commands.write(folder / "commands.csv")
        (folder / "plan.json").write_text(json_text(self.json()), encoding="utf-8")
        return self.json()

    def short(self) -> str:
        """The purpose of the poses, and what they can show."""
        shown = self._shown()
        return "\n".join([*self.words(), *(": ".join(row[:2]) for row in (shown.rows if shown else ()))])

    def text(self) -> str:
        """The sentences, and the table of changes or effects that the poses can show."""
        return as_text(self.terminal())

    def terminal(self, folder: Path | None = None) -> RenderableType:
        """The sentences, and the table of changes or effects that the poses can show."""
        shown = self._shown()
        return Group(*self.words(), *([shown.printed()] if shown else []))

    def table(self) -> pd.DataFrame:
        """The commands, with the conditions to set."""
        import pandas as pd

        commands = self.plan.commands
        return pd.DataFrame({"pose": commands.pose, **columns_of(commands)}).set_index("pose")

    def json(self) -> dict[str, Any]:
        """The content of ``plan.json``; docs/health.md explains the keys."""
        plan = self.plan
        found: dict[str, Any] = {
            "schema": "gtpin-plan/1",
            "for": plan.purpose,
            "robot": plan.model.robot.name,
            "poses": len(plan.commands),
            "frame": plan.frame,
            "noise": fields(plan.noise, "position_sigma", "orientation_sigma") | {"drives": plan.noise.repeatability},
        }
        if plan.purpose == "health":
            found |= fields(plan, "false_alarm", "power", "threshold")
            found["smallest"] = [asdict(one) for one in plan.smallest]
        elif plan.purpose == "discrimination":
            found["told"] = [asdict(one) for one in plan.told]
        elif plan.information is not None:
            found |= asdict(plan.information)
        return found

    def words(self) -> list[str]:
        """The purpose of the poses, and what they can show."""
        plan, count = self.plan, len(self.plan.commands)
        if plan.purpose == "calibration" and (own := plan.information) is not None:
            nats = f"{own.nats:.0f} nats (random poses: {own.nats_random:.0f})"
            error = f"{length(own.error)} (random poses: {length(own.error_random)})"
            return [
                f"{count} poses for a calibration. Information on the geometry: {nats}.",
                f"Error of predicted positions after the calibration: {error}.",
            ]
        if plan.purpose == "discrimination":
            effects = counted(len(plan.told), "effect")
            return [f"{count} poses that distinguish {effects} from each other and from no effect."]
        place = "by an instrument that may stand anywhere" if plan.frame == "free" else "in the base frame"
        return [
            f"{count} poses for a check, measured {place}. A change of the size in the table is detected in "
            f"{percent(plan.power)} of checks; false alarms: {percent(plan.false_alarm)}."
        ]

    def _shown(self) -> Table | None:
        """The changes or, at most 12, effects for which the plan chose its poses, each with its smallest size or its sigma."""
        plan, rows = self.plan, list[list[str]]()
        if plan.purpose == "discrimination":
            for told in sorted(plan.told, key=lambda one: one.sigma / max(one.sigma_random, 1e-300))[:12]:
                name = f"{known_as(told.effect, told.site)}, {told.parameter.replace('_', ' ')}"
                rows.append([name, *(quantity(sigma, told.unit) for sigma in (told.sigma, told.sigma_random))])
            return Table(("effect", "1 sigma", "of random poses"), rows, whole=True)
        for one in plan.smallest:
            if one.effect in checked_first():
                size = "not detected"
                if one.value is not None:
                    size = f"{one.parameter.replace('_', ' ')} {quantity(one.value, one.unit)}"
                rows.append([known_as(one.effect, one.site), size])
        return Table(("change", "smallest"), rows, whole=True) if rows else None
