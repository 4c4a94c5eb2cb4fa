"""What is said of data with mistakes in them: a bench, and the table of docs/dataset.md.

Machines are drawn by the plant, with and without an effect, written as files, spoiled, and diagnosed. Each ends in one of

- named: refused or warned with words that name the mistake, and no wrong cause is sure;
- noticed: refused, warned or called unknown or ambiguous, without a wrong cause that is sure;
- harmless: what is said is what is said of good data: the effect in a class, or nothing where there is none;
- confidently wrong: a cause that the machine does not have, sure of it; `none`
  for a machine that has an effect, `none` or `explained` for data that the model misses by far more than the noise.

    python examples/mistakes/bench.py [--machines 5] [--only WORDS] [-o mistakes.csv]

``python examples/pages/refresh.py --measure mistakes`` measures the table of docs/dataset.md again.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from mistakes import MISTAKES, Mistake

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedConditions

ANSWERS = ("named", "noticed", "harmless", "confidently wrong")
FIRST = 7_300_000
"""From here on nothing else draws its machines."""
FEW = 9
"""Mistakes with the same counts that the table names."""
ENERGY = 1500.0
SURE = 0.95
FAR = 3.0
"""Times the noise of a perfect model that `none` and `explained` may leave."""
VISIBLE = 1e-4
"""Noise of positions, m, in which the effects drown."""
EFFECTS = (
    ("backlash", "cart1"),
    ("rack_periodic", "cart2"),
    ("thermal_links", "arm"),
    ("linearity", "cart3"),
    ("link_compliance", "arm"),
)
CONDITIONS = SimulatedConditions(rest=0.5, sessions=2, push=60.0, warming=1.8, direct=0.3)


def write_machine(mistake: Mistake, number: int, with_effect: bool, folder: Path) -> tuple[str, str] | None:
    """Write a good dataset of a machine into a folder; gives the effect that it has."""
    effect = (mistake.effect or EFFECTS[number % len(EFFECTS)]) if with_effect else None
    case = make_case(
        FIRST + 10 * number + with_effect,
        effects=[effect] if effect else [],
        noncentrality=ENERGY,
        poses=130 + 20 * (number % 5),
        held_out=1,
        conditions=CONDITIONS,
    )
    case.dataset.write(folder)
    return effect


def spoil(mistake: Mistake, folder: Path, seed: int) -> None:
    """Make a mistake in the files of a dataset."""
    table = pd.read_csv(folder / "poses.csv", float_precision="round_trip")
    toml = tomllib.loads((folder / "dataset.toml").read_text(encoding="utf-8"))
    changed = mistake.spoil(table, toml, np.random.default_rng(seed))
    (table if changed is None else changed).to_csv(folder / "poses.csv", index=False)
    lines = [f"{key} = {json.dumps(value)}" for key, value in toml.items() if not isinstance(value, dict)]
    for section, content in toml.items():
        if isinstance(content, dict):
            lines += [f"[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in content.items())]
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def jobs(machines: int, only: str = "") -> list[dict[str, object]]:
    """Which machines are spoiled how."""
    names = [m.name for m in MISTAKES if re.search(only, m.name)]
    return [{"mistake": m, "machine": n, "effect": e} for m in names for n in range(machines) for e in (False, True)]


def measured(mistake: str, machine: int, effect: bool) -> list[dict[str, str]]:
    """What is said of a machine's data with a mistake in them: one of ``ANSWERS``, and the words."""
    given, words = answer(next(m for m in MISTAKES if m.name == mistake), machine, effect)
    return [{"answer": given, "words": words}]


def answer(mistake: Mistake, number: int, with_effect: bool) -> tuple[str, str]:
    """One of ``ANSWERS``, and the words of the message or of the diagnosis."""
    with tempfile.TemporaryDirectory() as place, warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", gtpin.GtpinWarning)
        folder = Path(place) / "measured"
        effect = write_machine(mistake, number, with_effect, folder)
        spoil(mistake, folder, number)
        heard.clear()
        try:
            found = gtpin.diagnose(gtpin.Dataset.read(folder))
        except gtpin.GtpinError as error:
            text = str(error).replace(str(folder), "measured")
            return "named" if re.search(mistake.words, text, re.IGNORECASE) else "noticed", text
    text = "; ".join(str(w.message).replace(str(folder), "measured") for w in heard)
    causes = ", ".join(f"{c.effect}@{c.site} {c.probability:.2f}" for c in found.causes)
    gap = f"{1e6 * found.gap.before:.0f} -> {1e6 * found.gap.after:.0f} um, floor {1e6 * found.gap.floor:.0f}"
    told = f"{found.verdict}: {causes or '-'} ({gap}) {text}"
    named = bool(re.search(mistake.words, text, re.IGNORECASE))
    if _wrong(found, effect, mistake):
        return "confidently wrong", told
    if named:
        return "named", told
    members = {(m.effect, m.site) for c in found.causes for m in c.members}
    as_it_is = found.verdict == "none" if effect is None else effect in members and found.verdict != "unknown"
    return "harmless" if as_it_is else "noticed", told


def _wrong(found: gtpin.Diagnosis, effect: tuple[str, str] | None, mistake: Mistake) -> bool:
    right = {effect} if effect else set()
    for cause in found.causes:
        known = (cause.effect, cause.site) in right or cause.effect in mistake.right
        if cause.probability >= SURE and not known:
            return True
    if found.verdict not in ("none", "explained"):
        return False
    floor = float(np.sqrt(3.0)) * mistake.noise  # whatever was declared
    missed = effect is not None and found.verdict == "none" and mistake.noise < VISIBLE
    return missed or found.gap.after > FAR * floor


def table(records: pd.DataFrame) -> str:
    """Answers by mistake; mistakes with the same counts share a row, and of many only the number is given."""
    lines = ["|" + "".join(f" {a} |" for a in ANSWERS) + " mistakes |", "|" + "---|" * (len(ANSWERS) + 1)]
    shared: dict[tuple[int, ...], list[str]] = {}
    for name, rows in records.groupby("mistake", sort=False):
        counts = tuple(int((rows["answer"] == a).sum()) for a in ANSWERS)
        shared.setdefault(counts, []).append(str(name))
    for counts, names in shared.items():
        words = "; ".join(names) if len(names) <= FEW else f"{len(names)} others"
        lines.append("|" + "".join(f" {n} |" for n in counts) + f" {words} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=5)
    parser.add_argument("--only", default="", help="a regular expression of the names of mistakes")
    parser.add_argument("--output", "-o", type=Path, help="CSV file with every answer")
    chosen = parser.parse_args()
    work = jobs(chosen.machines, chosen.only)
    answers = Parallel(n_jobs=-1)(delayed(measured)(**job) for job in work)
    records = pd.DataFrame([{**job, **row} for job, rows in zip(work, answers, strict=True) for row in rows])
    if chosen.output:
        records.to_csv(chosen.output, index=False)
    print(table(records))


if __name__ == "__main__":
    main()
