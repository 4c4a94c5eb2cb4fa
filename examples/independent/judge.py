"""Diagnoses the datasets of ``generate.py`` and judges the answers: ``python judge.py FOLDER [--first N]``.

Answers are added to FOLDER/answers.jsonl, one line a dataset; datasets that have a line are not diagnosed again. Then come the
tables. A cause is true if it matches an entry of the truth's list (``effect@site``, ``*`` for any site).
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
import warnings
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import gtpin
from gtpin.errors import GtpinError

Record = dict[str, Any]


def answer(folder: Path) -> Record:
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            d = gtpin.diagnose(gtpin.Dataset.read(folder))
        given = json.loads(json.dumps(d.to_json(), default=str))
        record = {
            "verdict": given["verdict"], "gap": given["gap"], "warnings": given["warnings"], "also": given.get("also"),
            "causes": given["causes"], "unexplained": given["unexplained"], "doubts": [str(x) for x in d.doubts],
            "noise_source": str(d.noise_source),
        }  # fmt: skip
    except GtpinError as error:
        record = {"refused": f"{type(error).__name__}: {error}"}
    except Exception:
        record = {"crash": traceback.format_exc()}
    return {**record, "cpu": time.process_time() - start}


def named(record: Record, least: float) -> list[tuple[str, float]]:
    return [
        (f"{c['effect']}@{c['site']}", c["probability"]) for c in record.get("causes", []) if c["probability"] >= least
    ]


def members(record: Record) -> list[str]:
    """Of the classes of all causes."""
    return [f"{m['effect']}@{m['site']}" for cause in record.get("causes", []) for m in cause["class"]]


def is_true(cause: str, truth: Record) -> bool:
    return any(fnmatch(cause, pattern) for pattern in truth["true"])


def told(name: str, t: Record, r: Record) -> str:
    marks = " ".join(f"{c}:{p:.2f}{'+' if is_true(c, t) else '-'}" for c, p in named(r, 0))
    size = f" size={t['size']:.1f}" if "size" in t else "" if t["declared"] else " not declared"
    failed = r.get("refused", "") + r.get("crash", "")[-300:]
    return f"{name} {t['kind']} {t['machine']} {t['region']} {t['poses']}{size} {r.get('verdict', '')} {marks}{failed}"


def tables(truths: Record, answers: Record) -> str:
    lines = []
    calm = [name for name in answers if name.startswith("innocent")]
    ill = [name for name in answers if name.startswith("physics")]
    for title, names in (("innocent", calm), ("physics", ill)):
        verdicts: dict[str, int] = {}
        for name in names:
            r = answers[name]
            verdict = r.get("verdict", "refused" if "refused" in r else "crash")
            verdicts[verdict] = verdicts.get(verdict, 0) + 1
        lines.append(f"{title}: {len(names)} datasets; " + ", ".join(f"{v} {n}" for v, n in sorted(verdicts.items())))
    silent = [name for name in calm if answers[name].get("verdict") == "none"]
    accused = sum(bool(named(answers[n], 0)) for n in calm)
    lines.append(f"innocent, silent (none): {len(silent)} of {len(calm)}; with a named cause: {accused}")
    for name in calm:
        if name not in silent:
            lines.append(f"  {told(name, truths[name], answers[name])}")
    floor = [
        n
        for n in [*calm, *ill]
        if "gap" in answers[n] and (answers[n]["gap"]["noise_floor"] or 0) > answers[n]["gap"]["position_rms_before"]
    ]
    lines.append(f"noise floor above the error on left-out poses: {len(floor)}")
    beside = [n for n in ill if answers[n].get("verdict") == "unknown"]
    false = {n: [c for c in named(answers[n], 0) if not is_true(c[0], truths[n])] for n in ill}
    for least in (0.9, 0.5):
        count = sum(any(p >= least for _, p in false[n]) for n in ill)
        unknown = sum(any(p >= least for _, p in false[n]) for n in beside)
        lines.append(
            f"physics, false cause of {least} or more: {count} of {len(ill)}; beside unknown: {unknown} of {len(beside)}"
        )
    for title, wanted in (("listed", True), ("not listed, or partly", False)):
        names = [n for n in ill if truths[n]["listed"] == wanted]
        right = sum(any(is_true(c, truths[n]) for c, _ in named(answers[n], 0.5)) for n in names)
        held = sum(any(is_true(member, truths[n]) for member in members(answers[n])) for n in names)
        lines.append(f"physics, {title}: {len(names)}; true cause named with 0.5 or more: {right}, in a class: {held}")
    lines += [f"  {told(n, truths[n], answers[n])}" for n in ill]
    lines.append(f"CPU: {sum(r['cpu'] for r in answers.values()):.0f} s")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, help="only the first N datasets of each part")
    arguments = parser.parse_args()
    truths = json.loads((arguments.folder / "truths.json").read_text())
    kept = arguments.folder / "answers.jsonl"
    answers = {r["name"]: r for r in map(json.loads, kept.read_text().splitlines())} if kept.exists() else {}
    for name in truths:
        if name not in answers and (arguments.first is None or int(name.split("/")[1]) < arguments.first):
            answers[name] = {"name": name, **answer(arguments.folder / name)}
            with kept.open("a") as file:
                file.write(json.dumps(answers[name]) + "\n")
    print(tables(truths, answers))


if __name__ == "__main__":
    main()
