"""A complete check: cases are made and sealed, diagnosed, opened and judged."""

from __future__ import annotations

import contextlib
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from rich.progress import Progress

from gtpin.bench.blind.draw import ROBOT, Draft, drafts, made, truth_of
from gtpin.bench.blind.folder import CheckFolder, Settings, claimed, diagnosis_digest
from gtpin.bench.blind.judged import Judged, judge
from gtpin.bench.blind.truth import (
    SealError,
    Truth,
    digest_of,
    files_of,
    given,
    opened,
    read_manifest,
    seal,
    source_digest,
    take_in,
    write_manifest,
)
from gtpin.bench.blind.worker import Outcome, diagnose_alone
from gtpin.bench.simulator.instruments.build import checked
from gtpin.bench.simulator.recipe import digest as plant_digest
from gtpin.errors import GtpinError, warn
from gtpin.spread import check_cluster, spread, workers
from gtpin.threads import in_one_thread

SHOWN = 10
"""Number of changed files that a warning names; score.json has all."""
SUSPECTS = 16
"""If a process died, this many of the unfinished cases are diagnosed one by one, to find the case that ended it."""


@dataclass(frozen=True)
class Checked:
    """The judged cases of a check, its settings with the digest of its manifest, and the median time of a diagnosis, s."""

    cases: list[Judged]
    about: dict[str, Any]
    seconds: float | None


def check(
    output: Path,
    cases: int,
    seed: int,
    bars: Progress,
    address: str | None = None,
    robot: str = ROBOT,
    instruments: Sequence[str] = (),
    *,
    force: bool = False,
) -> Checked:
    """Make cases, diagnose them, open the seals, and judge; resumes the same check if it was stopped.

    ``bars`` show the progress, and print the digests of the plant and of the manifest. ``instruments`` measure the machines
    in place of a tracker: see :data:`~gtpin.bench.simulator.instruments.build.KINDS`.

    Raises `GtpinError` if an instrument is not known, cases of the robot can't be made by it, or the folder belongs to
    another check and ``force`` is not set.
    """
    kinds = checked(instruments)
    wanted = list(drafts(cases, seed, robot, kinds))
    check_cluster(address)
    folder = CheckFolder(output)
    settings = Settings(cases, seed, None, robot, plant_digest(), diagnosis_digest(), ",".join(kinds) or None)
    with claimed(folder, settings, force):
        if not folder.published:
            waiting = {draft.name: (output, draft) for draft in wanted if not folder.is_sealed(draft.name)}
            _each(bars, "making cases", "made", len(wanted), _make, list(waiting), waiting.__getitem__)
            write_manifest(folder.manifest, folder.digests(draft.name for draft in wanted), settings.plant)
        return _diagnosed_and_judged(folder, settings, bars, address)


def check_given(
    output: Path, source: Path, bars: Progress, address: str | None = None, *, force: bool = False
) -> Checked:
    """Diagnose cases that somebody else made, and judge; resumes the same check if it was stopped.

    Raises `GtpinError` if a truth is missing or malformed, or the folder belongs to another check and ``force`` is not set.
    """
    cases = given(source)
    check_cluster(address)
    folder = CheckFolder(output)
    settings = Settings(len(cases), None, source_digest(cases), None, None, diagnosis_digest())
    with claimed(folder, settings, force):
        if not folder.published:
            for place, truth in bars.track(cases.items(), description="sealing"):
                take_in(place, folder.case(place.name))
                seal(truth, folder.case(place.name), folder.sealed(place.name))
            write_manifest(folder.manifest, folder.digests(place.name for place in cases), None)
        return _diagnosed_and_judged(folder, settings, bars, address)


@in_one_thread
def _make(root: Path, draft: Draft) -> None:
    """Make a case: its dataset, the digest of its truth, and its truth, last."""
    folder = CheckFolder(root)
    place = folder.case(draft.name)
    shutil.rmtree(place, ignore_errors=True)  # remains of a run that was stopped
    case = made(draft)
    case.write_dataset(place)
    seal(truth_of(case, draft.kind), place, folder.sealed(draft.name))


def _each(
    bars: Progress,
    what: str,
    ending: str,
    total: int,
    work: Callable[..., Any],
    names: Sequence[str],
    arguments: Callable[[str], tuple[Any, ...]],
) -> dict[str, Any]:
    """Results of work on cases in processes of their own, by name. Of ``total`` cases those without ``names`` are finished.

    Raises GtpinError if a process died while a case was ... ``ending``.
    """
    task, found = bars.add_task(what, total=total, completed=total - len(names)), dict[str, Any]()

    def done(name: str, result: Any) -> None:
        found[name] = result
        bars.advance(task)

    with workers():
        lost = spread(work, names, arguments, done)
    if lost:
        raise GtpinError(f"a process died while {lost[0]} was {ending}", hint="run the same command again")
    return found


def _diagnosed_and_judged(folder: CheckFolder, settings: Settings, bars: Progress, address: str | None) -> Checked:
    """Diagnose the remaining cases of a manifest, then open the seals and judge."""
    digests = read_manifest(folder.manifest)
    manifest = digest_of(folder.manifest.read_bytes())
    changed = folder.compared("truth", digests)
    changed += folder.compared("dataset", {name: folder.dataset_digest(name) for name in digests})
    for what, digest in (("plant", settings.plant), ("manifest", manifest)):
        if digest is not None:
            bars.console.print(f"{what} {digest}", soft_wrap=True, highlight=False)
    _diagnose(folder, dict.fromkeys(digests, ()), bars, address, "diagnosing")
    changed += folder.compared("diagnosis", {name: folder.outcome_digest(name) for name in digests})
    truths = {}
    for name, digest in digests.items():
        with contextlib.suppress(SealError):  # the judge reports it
            truths[name] = opened(folder.sealed(name), digest)
    taken_out = _taken_out(truths)
    _diagnose(folder, taken_out, bars, address, "with effects taken out")
    without = {name: folder.outcome_digest(name, without=True) for name in taken_out}
    changed += folder.compared("diagnosis without its effect", without)

    def arguments(name: str) -> tuple[Path, Path, str, Outcome | None, Outcome | None]:
        outcomes = folder.outcome(name), folder.outcome(name, without=True)
        return folder.case(name), folder.sealed(name), digests[name], *outcomes

    judged = _each(bars, "judging", "judged", len(digests), judge, list(digests), arguments)
    for name, truth in truths.items():
        folder.publish(name, truth)
    if diagnosis_digest() != settings.diagnosis:
        warn("the sources of the diagnosis have changed while the check ran: its score belongs to neither")
    about = asdict(settings) | {"manifest": manifest}
    if changed:
        about["changed"] = changed
        some = ", ".join(changed[:SHOWN]) + (f" and {len(changed) - SHOWN} more" if len(changed) > SHOWN else "")
        warn(f"changed since they were first sealed or diagnosed, so the score is not that of the sealed check: {some}")
    seconds = folder.seconds()
    return Checked([judged[name] for name in digests], about, median(seconds) if seconds else None)


def _diagnose(
    folder: CheckFolder, excluded: Mapping[str, tuple[str, ...]], bars: Progress, address: str | None, what: str
) -> None:
    """Diagnose the remaining cases; ``excluded`` are the effects that are removed from the catalogue, by case."""

    def done(name: str, result: tuple[Outcome, float]) -> None:
        folder.keep(name, *result, without=bool(excluded[name]))
        bars.advance(task)

    def arguments(name: str) -> tuple[dict[str, bytes], tuple[str, ...]]:
        return files_of(folder.case(name)), excluded[name]

    waiting = [name for name in excluded if folder.outcome(name, without=bool(excluded[name])) is None]
    task = bars.add_task(what, total=len(excluded), completed=len(excluded) - len(waiting))
    if not waiting:
        return
    with workers(address):
        while waiting := spread(diagnose_alone, waiting, arguments, done):
            suspects, waiting = waiting[:SUSPECTS], waiting[SUSPECTS:]
            for name in suspects:
                if spread(diagnose_alone, [name], arguments, done):
                    done(name, (Outcome(error="the process that diagnosed it died"), float("nan")))


def _taken_out(truths: Mapping[str, Truth]) -> dict[str, tuple[str, ...]]:
    """Cases that are diagnosed again, and the effect that is removed: every second case of each effect."""
    count: Counter[str] = Counter()
    found: dict[str, tuple[str, ...]] = {}
    for name, truth in truths.items():
        if truth.kind == "one":
            effect = truth.effects[0].effect
            if count[effect] % 2 == 0:
                found[name] = (effect,)
            count[effect] += 1
    return found
