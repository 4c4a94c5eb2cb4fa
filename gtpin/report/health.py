"""A check against an earlier model as sentences, JSON, table, terminal text and page: the changes, what to do, and what the
poses can't show."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType

from gtpin.diagnosis.result import Cause, Considered, HealthCheck, Member, Smallest
from gtpin.output.shown import Presentation
from gtpin.report.diagnosis import DIAGNOSIS, write_findings
from gtpin.report.diagnosis_json import diagnosis_json
from gtpin.report.page import Items, Lead, Section, Table, report
from gtpin.report.phrases import (
    badge,
    cause_lines,
    cause_rows,
    doubt_words,
    interval,
    named,
    others,
    overlap,
    parameter,
    reason_words,
    remedy,
)
from gtpin.report.provenance import provenance
from gtpin.report.sketch import drawing
from gtpin.report.verdict import TONES, gap_words
from gtpin.report.words import chance, counted, joined, percent, quantity, site_words, whole
from gtpin.threads import in_one_thread

if TYPE_CHECKING:
    import pandas as pd

NEVER = (
    "This model was never identified: its geometry was fitted to these poses within its tolerances, and errors are those that "
    "such a fit leaves, not those of the nominal geometry. Give a model that gtpin calibrate or diagnose wrote to see changes."
)
"""What a check against a nominal robot can say."""
SHOWN = 12
"""Largest number of candidates in the table of evidence."""


@dataclass(frozen=True)
class HealthCheckPresentation(Presentation):
    """A check; its table is that of the smallest changes that its poses show. Its files are those of a diagnosis, so that one
    replaces the other."""

    check: HealthCheck
    files = DIAGNOSIS

    def short(self) -> str:
        """Verdict, changes and power."""
        c = self.check
        return f"Check against an earlier model: {c.verdict}\n{headline(c)}\n{power_words(c)}"

    def text(self) -> str:
        """All sentences."""
        c = self.check
        return "\n".join([headline(c), *advice(c), power_words(c), "Not shown by these poses:", *unseen(c)]) + "\n"

    def terminal(self) -> RenderableType:
        """The changes, with class and probability, and the smallest changes that such poses show."""
        c = self.check
        changes = Table(("change", "probability", "by how much", "of the error"), cause_rows(c), (1, 3))
        untested = sum(not one.testable for one in c.candidates)
        return Group(
            headline(c),
            *([changes.printed()] if c.causes else []),
            *advice(c),
            power_words(c),
            f"{untested} of {len(c.candidates)} candidates can't be tested with these poses; the report gives the reasons.",
        )

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
        return write_findings(self.check, self.check.baseline, self.json(), health_page(self.check), folder)

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
            "false_alarm": check.false_alarm,
            "threshold": check.threshold,
            "power": check.power,
            "assumed": list(check.assumed),
            "unexplained": {
                "position": check.unexplained_before.position,
                "orientation": check.unexplained_before.orientation,
                "noise_known": check.noise_known,
            },
            "smallest": [asdict(s) for s in check.smallest],
        }
        return found


def health_page(check: HealthCheck) -> str:
    """The whole report of a check as one self-contained HTML file."""
    robot, size, counts = (
        check.model.robot,
        gap_words(check.gap),
        badge(check) or ("no change" if _identified(check) else "as nominal"),
    )
    numbers = [(str(check.poses), "poses"), (size.before, f"{_error(check).lower()}, {_predicted(check)}, RMS")]
    numbers += [(size.after, "with the changes")] if check.causes else []
    eyebrow = f"What has changed since the last model · {robot.name} · {check.poses} poses"
    sketch = drawing(check.baseline, np.median(check.dataset.q, axis=0), causes=[c.site for c in check.causes])
    numbers.append((size.floor, _floor(check)))
    lead = Lead(eyebrow, headline(check), advice(check), numbers, counts, TONES[check.verdict], sketch)
    sections = [*([_changes(check)] if check.causes else []), *_evidence(check)]
    return report(f"{robot.name}: {counts}", lead, sections, provenance(check.dataset, robot, check.seed))


def _changes(check: HealthCheck) -> Section:
    rows = []
    for cause in check.causes:
        for name, e in cause.parameters.items():
            size = (*parameter(name, e.value, e.unit, e.sigma), whole(" to ".join(interval(name, e))))
            rows.append([*_named(check, cause), chance(cause.probability), *size])
        for m in others(cause):
            sizes = [parameter(name, e.value, e.unit, e.sigma) for name, e in m.parameters.items()] or [("", "")]
            title, site = _named(check, m)
            rows.append([f"or {title}", site, chance(m.probability), *sizes[0], ""])
    table = Table(("change", "site", "probability", "parameter", "by how much", "95 %"), rows, (2, 4, 5))
    return Section("changes", "The changes", ["By how much each parameter differs from the earlier model.", table])


def _evidence(check: HealthCheck) -> tuple[Section, Section, Section]:
    tested = [[*_named(check, c), f"{c.log_evidence:.1f}"] for c in check.candidates if c.testable]
    untested = [[*_named(check, c), reason_words(c.reason, c.site)] for c in check.candidates if not c.testable]
    smallest = [
        [*_named(check, s), s.parameter.replace("_", " "), "none" if s.value is None else quantity(s.value, s.unit)]
        for s in check.smallest
    ]
    limit = (
        f"Gain in log evidence of each change by itself, the largest first. An unchanged machine exceeds "
        f"{whole(f'{check.threshold:.1f}')} nats, or the chi-square's limit, in {percent(check.false_alarm)} of checks like "
        "this one: the limit is found by simulating such checks."
    )
    shown = (
        f"{power_words(check)} The table has the smallest change of each kind that raises an alarm in {percent(check.power)} "
        "of checks at these poses; of changes with several coefficients, the median over their shapes."
    )
    evidence = Table(("change", "site", "gain in log evidence (nats)"), tested[:SHOWN], (2,))
    sizes = Table(("change", "site", "parameter", "smallest"), smallest, (3,))
    reasons = Table(("change", "site", "why not"), untested)
    return (
        Section("evidence", "Evidence", [limit, evidence]),
        Section("power", "What such poses show", [shown, sizes]),
        Section("unseen", "What they don't show", [Items(unseen(check)), reasons]),
    )


def headline(check: HealthCheck) -> str:
    """The changes, a line for each."""
    known = _identified(check)
    if check.verdict == "none":
        what = (
            "Nothing has changed since the model was identified" if known else "Only the geometry differs from nominal"
        )
        return f"{what}, as far as these poses show."
    lines = cause_lines(check, "error beyond noise")
    if check.verdict == "unknown":
        what = "has changed" if known else "differs from nominal"
        lines.append(f"{'Also s' if lines else 'S'}omething {what} that no known effect explains.")
    begin = "Changed since the model was identified:" if known else "Differs from nominal, beside the geometry:"
    return "\n".join([begin, *lines] if check.causes else lines)


def _identified(check: HealthCheck) -> bool:
    """Whether the earlier model was fitted to data; a nominal robot was not, and has no covariance."""
    return check.baseline.covariance is not None


def _predicted(check: HealthCheck) -> str:
    """How the poses of a check are predicted whose error it states."""
    model = "the earlier model" if _identified(check) else "the nominal model"
    return f"each pose predicted by {model} and all others"


def _named(check: HealthCheck, one: Cause | Member | Considered | Smallest) -> tuple[str, str]:
    """Title of the effect, and its site."""
    return check.effect(one.effect).title, site_words(one.site)


def _error(check: HealthCheck) -> str:
    """Which error of a model a check states: that of positions, or that of other instruments' readings."""
    return "Error of readings" if check.gap.by_instrument else "Position error"


def advice(check: HealthCheck) -> list[str]:
    """What to do, and what limits the check."""
    size = gap_words(check.gap)
    after = f"with the changes: {size.after}; " if check.causes else ""
    found = [] if _identified(check) else [NEVER]
    found.append(
        f"{_error(check)} at {counted(check.poses, 'pose')}, {_predicted(check)}, RMS: {size.before}; "
        f"{after}{_floor(check)}: {size.floor}."
    )
    robot, left = check.model.robot, check.unexplained_before
    if not left.none:
        parts = [quantity(size, unit) for size, unit in ((left.position, "m"), (left.orientation, "rad")) if size]
        visible = "gtpin diagnose at many poses finds what the earlier model lacks."
        if not left.noise_known:
            known = "Its noise is neither declared nor shown by repeated visits"
            visible = f"{known}: declare it, or repeat visits, and calibrate again."
        found.append(
            f"The earlier model did not explain its own data: {joined(parts)} per axis were left between poses, and count as a "
            f"part of its uncertainty. Smaller changes can't be detected. {visible}"
        )
    for cause in check.causes:
        effect = check.effect(cause.effect)
        found.append(f"{named(effect, cause.site)}: {remedy(effect, robot)}")
    found += filter(None, [overlap(check)])
    if check.verdict == "unknown":
        found += [*doubt_words(check.doubts), "Calibrate again with enough poses, and diagnose these."]
    if check.set_aside:
        found.append(f"Set aside as gross errors: {joined(list(check.set_aside))}. Measure them again.")
    members = [m for c in check.causes for m in c.members]
    if any({*check.assumed} & {*check.effect(m.effect).covariates(robot, m.site)} for m in members):
        assumed = joined(list(check.assumed))
        found.append(f"{assumed} could have changed: record it at the model's poses and at the check's.")
    hidden = "The instrument stood anywhere: changes that look like another place of the instrument are hidden."
    return [*found, hidden] if check.free_frame else found


def _floor(check: HealthCheck) -> str:
    """What the noise floor of a check is called: it is noise only where that is known."""
    return "noise alone" if check.noise_known else "left of the earlier model's own fit"


def power_words(check: HealthCheck) -> str:
    """The smallest of the most common changes that such poses show with the check's power."""
    parts = []
    for effect in dict.fromkeys(s.effect for s in check.smallest if check.effect(s.effect).first_checked):
        rows = (s for s in check.smallest if s.effect == effect)
        worst = max(rows, key=lambda s: np.inf if s.value is None else s.value)
        size = "of no size" if worst.value is None else quantity(worst.value, worst.unit)
        parts.append(f"{check.effect(effect).title} {size}")
    if not parts:
        return "These poses show none of the changes that crashes and wear cause first."
    return f"Changes that such poses show in {percent(check.power)} of cases, from: {joined(parts)} at the worst site."


def unseen(check: HealthCheck) -> list[str]:
    """Changes that these poses can't show, by reason."""
    by_reason: dict[str, list[str]] = {}
    for c in check.candidates:
        if not c.testable:
            # Reasons name the column of each site: without its number, one sentence serves all sites of an effect.
            reason = reason_words(c.reason, "the site").rstrip("0123456789")
            by_reason.setdefault(reason, []).append(check.effect(c.effect).title)
    return [f"{joined(list(dict.fromkeys(effects)))}: {reason}." for reason, effects in by_reason.items()]
