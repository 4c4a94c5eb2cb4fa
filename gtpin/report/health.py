"""A check against an earlier model as text, JSON, table, page and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.diagnosis.result import HealthCheck
from gtpin.output.results import fields
from gtpin.report.diagnosis import DIAGNOSIS, diagnosis_json, write_findings
from gtpin.report.page import Lead, PagePresentation, Section, Table, provenance
from gtpin.report.phrases import badge, cause_lines, cause_rows, doubt_words, named, overlap, remedy
from gtpin.report.sections.causes import causes_of
from gtpin.report.sections.evidence import evidence_of, untestable_of
from gtpin.report.sketch import drawing
from gtpin.report.steps import check_steps
from gtpin.report.verdict import TONES, gap_words, untested
from gtpin.report.words import joined, percent, quantity, site_words, whole
from gtpin.threads import in_one_thread

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class HealthCheckPresentation(PagePresentation):
    """A check; its table is that of the smallest changes that its poses show. Its files are those of a diagnosis, so that one
    replaces the other."""

    check: HealthCheck
    files = DIAGNOSIS

    @cached_property
    def lead(self) -> Lead:
        """The changes, what to do about them, and what limits the check."""
        c, size = self.check, gap_words(self.check.gap)
        what = "the earlier model" if _identified(c) else "the nominal model"
        error = "error of readings" if c.gap.by_instrument else "position error"
        numbers = [(size.before, f"{error}, each pose predicted by {what} and all others, RMS")]
        numbers += [(size.after, "with the changes")] if c.causes else []
        numbers.append((size.floor, "noise alone" if c.noise_known else "residuals of the earlier model's fit"))
        short = badge(c) or ("no change" if _identified(c) else "as nominal")
        changes = Table(("change", "probability", "parameters", "part of the error"), cause_rows(c), (1,), wide=(0, 2))
        return Lead(
            f"Check of {c.model.robot.name} against {what} · {c.poses} poses",
            headline(c),
            [*advice(c), power_words(c), untested(c)],
            numbers,
            short,
            TONES[c.verdict],
            drawing(c.baseline, np.median(c.dataset.q, axis=0), causes=[cause.site for cause in c.causes]),
            content=[changes] if c.causes else [],
            steps=check_steps(c),
            warnings=c.warnings,
            tab=f"{c.model.robot.name}: {short}",
        )

    @cached_property
    def sections(self) -> Sequence[Section]:
        """The changes, the evidence, and the changes that the poses show and don't show."""
        c = self.check
        limit = (
            "Gain in log evidence of each change by itself, the largest first. An unchanged machine exceeds "
            f"{whole(f'{c.threshold:.1f}')} nats, or the limit of chi-square, in {percent(c.false_alarm)} of checks like this "
            "one: the limit is found by simulating such checks."
        )
        about = "By how much each parameter differs from the earlier model."
        changes = [Section("changes", "The changes", [about, *causes_of(c, {})])] if c.causes else []
        return [*changes, evidence_of(c, [limit]), _power(c), untestable_of(c)]

    @property
    def origin(self) -> Table:
        """Versions, seed and digests."""
        return provenance(self.check.dataset, self.check.model.robot, self.check.seed)

    def table(self) -> pd.DataFrame:
        """By effect and site: evidence, probability, and the smallest change that the poses show."""
        import pandas as pd

        smallest = {(s.effect, s.site): s for s in self.check.smallest}
        rows = []
        for c in self.check.candidates:
            s = smallest.get((c.effect, c.site))
            found = ("", None, "") if s is None else (s.parameter, s.value, s.unit)
            rows.append((c.effect, c.site, c.testable, c.log_evidence, c.probability, *found))
        names = ["effect", "site", "testable", "log_evidence", "probability", "parameter", "smallest", "unit"]
        return pd.DataFrame(rows, columns=names).set_index(["effect", "site"])

    @in_one_thread
    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin diagnose --against``; return the content of the JSON."""
        return write_findings(self.check, self.check.baseline, self.json(), self.page(), folder)

    def json(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``: that of a diagnosis, and the key ``against``."""
        check = self.check
        found = diagnosis_json(check)
        found["gap"]["method"] = "each pose left out in turn, and predicted by the earlier model and all other poses"
        found["against"] = {
            "robot": check.baseline.robot.name,
            "poses": check.poses,
            "set_aside": list(check.set_aside),
            "frame": "free" if check.free_frame else "robot",
            **fields(check, "false_alarm", "threshold", "power"),
            "assumed": list(check.assumed),
            "unexplained": fields(check.unexplained_before, "position", "orientation") | fields(check, "noise_known"),
            "smallest": [asdict(s) for s in check.smallest],
        }
        return found


def _power(check: HealthCheck) -> Section:
    rows = [
        [
            check.effect(s.effect).title,
            site_words(s.site),
            s.parameter.replace("_", " "),
            "none" if s.value is None else quantity(s.value, s.unit),
        ]
        for s in check.smallest
    ]
    words = (
        f"The smallest change of each kind that these poses show in {percent(check.power)} of checks; of changes with several "
        "coefficients, the median over their shapes."
    )
    table = Table(("change", "site", "parameter", "smallest"), rows, (3,))
    return Section("power", "Changes that these poses show", [words, table])


def headline(check: HealthCheck) -> str:
    """The changes: at most three lines."""
    known, unknown = _identified(check), check.verdict == "unknown"
    if check.verdict == "none":
        what = "Nothing has changed since the model was identified"
        return f"{what if known else 'Only the geometry differs from nominal'}, as far as these poses show."
    lines = cause_lines(check, "error beyond noise")
    if unknown:
        what = "has changed" if known else "differs from nominal"
        lines.append(f"{'Also s' if lines else 'S'}omething {what} that no known effect explains.")
    return "\n".join(lines)


def _identified(check: HealthCheck) -> bool:
    """Whether the earlier model was fitted to data; a nominal robot was not, and has no covariance."""
    return check.baseline.covariance is not None


def advice(check: HealthCheck) -> list[str]:
    """What to do, and what limits the check."""
    robot, left, found = check.model.robot, check.unexplained_before, list[str]()
    if not _identified(check):
        found.append(
            "This model was never identified: its geometry was fitted to these poses within its tolerances, and errors are "
            "those that such a fit leaves, not those of the nominal geometry. Give a model that gtpin calibrate or diagnose "
            "wrote to see changes."
        )
    found += [f"{named(check.effect(c.effect), c.site)}: {remedy(check.effect(c.effect), robot)}" for c in check.causes]
    found += filter(None, [overlap(check)])
    if check.verdict == "unknown":
        found += doubt_words(check.doubts)
    if not left.none:
        parts = [quantity(size, unit) for size, unit in ((left.position, "m"), (left.orientation, "rad")) if size]
        size, hidden = joined(parts), "a part of its uncertainty: smaller changes are not detected"
        words = (
            f"At its own poses the earlier model has errors of {size} per axis beyond noise. They count as {hidden}. "
            "gtpin diagnose at many poses looks for their causes."
        )
        if not left.noise_known:
            words = (
                "The noise of the earlier model's data is not known: it was not declared, and repeated visits do not show it. "
                f"Its residuals, {size} per axis, count as {hidden}. Declare the noise or repeat visits, and calibrate again."
            )
        found.append(words)
    if check.set_aside:
        found.append(f"Set aside as gross errors: {joined(list(check.set_aside))}. Measure them again.")
    members = [m for c in check.causes for m in c.members]
    if any({*check.assumed} & {*check.effect(m.effect).covariates(robot, m.site)} for m in members):
        recorded = all(name in check.dataset.covariates for name in check.assumed)
        where = "the model's poses too" if recorded else "the model's poses and at the check's"
        found.append(f"{joined(list(check.assumed))} could have changed: record it at {where}.")
    if check.free_frame:
        pose = "The pose of the instrument is unknown"
        found.append(f"{pose}: changes that look like another pose of it are not detected.")
    return found


def power_words(check: HealthCheck) -> str:
    """The smallest of the most common changes that such poses show with the check's power."""
    parts = []
    for effect in dict.fromkeys(s.effect for s in check.smallest if check.effect(s.effect).first_checked):
        rows = (s for s in check.smallest if s.effect == effect)
        worst = max(rows, key=lambda s: np.inf if s.value is None else s.value)
        title = check.effect(effect).title
        parts.append(f"{title} of no size" if worst.value is None else f"{title} {quantity(worst.value, worst.unit)}")
    if not parts:
        return "These poses show none of the changes that crashes and wear cause most often."
    return f"Detected in {percent(check.power)} of checks with such poses, at the worst site: {joined(parts)}."
