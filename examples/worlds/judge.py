"""Tables of what gtpin said of the cases: ``python judge.py FOLDER OUT [OUT ...]``; OUT of `gtpin blind -o OUT --from`.

With ``--record FILE NAME`` the sums are added to a JSON file, of which docs/blind.md has its table.

An effect is demanded from an energy of 63 on (gtpin's own bound of what it promises to see); a weaker one may be named or not.
Confidence is a probability of 0.9 or more. A cause is false where its effect and site are no part of the truth: "near" where it
is the name that the mechanism has at distance 0, at its site, and "another" else. "Of own form" are listed effects of which
other effects of the catalogue leave 63 or more, and unlisted ones of which they leave 250 or more (left.py).
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mechanisms import MECHANISMS

DEMANDED, UNLIKE, SURE = 63.0, 250.0, 0.9
HEAD = ("listed", "class holds", "alone, sure", "unlisted", "unknown", "cases", "false, sure", "another name")
OWN = ("listed, of own form", "alone, sure, of own form", "unlisted, of own form", "unknown, of own form")
LISTED = {m.name: m.listed for m in MECHANISMS}
Row = dict[str, int]


def name(item: dict[str, Any]) -> str:
    return f"{item['effect']}@{item['site']}"


def judged(case: dict[str, Any], diagnosis: dict[str, Any]) -> tuple[Row, list[str]]:
    """Counts of one case, and its false causes as they were said."""
    effects = [e for e in case["effects"] if e["energy"] >= DEMANDED]
    listed = [e for e in effects if not e["effect"].startswith("unlisted_")]
    allowed = {name(e) for e in case["effects"]}
    causes = diagnosis["causes"]
    sure = [c for c in causes if c["probability"] >= SURE]
    classes = [{name(m) for m in c["class"]} for c in causes]
    alone = {name(c) for c in sure if len(c["class"]) == 1}
    near = {f"{LISTED[a['mechanism']]}@{a['site']}" for a in case["acts"]}
    false = [
        f"{name(c)} ({c['probability']:.3f}, {'near' if name(c) in near else 'another'})"
        for c in sure
        if name(c) not in allowed
    ]
    apart = [e for e in listed if e.get("left", 0.0) >= DEMANDED]
    strange = any(e.get("left", 0.0) >= UNLIKE for e in effects if e not in listed)
    row = {
        "listed": len(listed),
        "class holds": sum(any(name(e) in k for k in classes) for e in listed),
        "alone, sure": sum(name(e) in alone for e in listed),
        "unlisted": int(len(effects) > len(listed)),
        "unknown": int(len(effects) > len(listed) and diagnosis["verdict"] == "unknown"),
        "cases": 1,
        "false, sure": int(bool(false)),
        "another name": int(any("another" in text for text in false)),
        "listed, of own form": len(apart),
        "alone, sure, of own form": sum(name(e) in alone for e in apart),
        "unlisted, of own form": int(strange),
        "unknown, of own form": int(strange and diagnosis["verdict"] == "unknown"),
    }
    return row, false


def total(rows: Iterable[Row], keys: tuple[str, ...] = HEAD) -> Row:
    found = list(rows)
    return {key: sum(row[key] for row in found) for key in keys}


def table(title: str, groups: dict[str, list[Row]]) -> list[str]:
    lines = [f"| {title} | " + " | ".join(HEAD) + " |", "|---" * (len(HEAD) + 1) + "|"]
    for key in sorted(groups):
        lines.append(f"| {key} | " + " | ".join(str(v) for v in total(groups[key]).values()) + " |")
    return [*lines, ""]


def report(folder: Path, outs: list[Path]) -> str:
    """Markdown: tables by family, mechanism and distance, then each false cause and each case's answer."""
    worlds: dict[str, dict[str, Any]] = json.loads((folder / "worlds.json").read_text())
    groups: dict[str, dict[str, list[Row]]] = {k: defaultdict(list) for k in ("family", "mechanism", "distance")}
    false_lines, answers, warned = [], [], []
    for file in sorted((f for out in outs for f in (out / "diagnoses").glob("*.json")), key=lambda f: f.name):
        if file.stem not in worlds:
            continue  # a second diagnosis with the truth taken out of the catalogue
        case, diagnosis = worlds[file.stem], json.loads(file.read_text())["diagnosis"]
        row, false = judged(case, diagnosis)
        groups["family"][f"{file.stem[:4]}, {case['robot']}, {case['instrument']}"].append(row)
        groups["family"]["~ all"].append(row)
        acts = case["acts"] or [{"mechanism": "(none)", "distance": 0.0, "site": ""}]
        if len(acts) == 1:
            groups["mechanism"][acts[0]["mechanism"]].append(row)
            groups["distance"][f"{acts[0]['distance']:.1f}" if case["acts"] else "no effect"].append(row)
        else:
            groups["mechanism"]["~ two mechanisms"].append(row)
            groups["distance"]["~ two mechanisms"].append(row)
        truth = ", ".join(f"{name(e)} E={e['energy']:.0f}" for e in case["effects"]) or "nothing"
        told = ", ".join(f"{a['mechanism']} d={a['distance']}" for a in acts)
        said = ", ".join(
            f"{name(c)} {c['probability']:.2f}" + ("" if len(c["class"]) < 2 else f" of {len(c['class'])}")
            for c in diagnosis["causes"]
        )
        answers.append(f"| {file.stem} | {told} | {truth} | {diagnosis['verdict']} | {said} |")
        if false:
            line = f"| {file.stem} | {case['robot']} | {told} | {truth} | {diagnosis['verdict']} |"
            false_lines.append(f"{line} {', '.join(false)} |")
        for text in diagnosis.get("warnings", []):
            if "do not vary" not in text:
                warned.append(f"- {file.stem} ({told}): {text}")
    lines = ["## By family", "", *table("family", groups["family"]), "## By mechanism", ""]
    lines += [*table("mechanism", groups["mechanism"]), "## By distance", "", *table("distance", groups["distance"])]
    lines += [
        "## False with confidence",
        "",
        "| case | robot | mechanism | truth | verdict | said, false |",
        "|---" * 6 + "|",
    ]
    lines += [
        *false_lines,
        "",
        "## All answers",
        "",
        "| case | mechanism | truth | verdict | said |",
        "|---" * 5 + "|",
        *answers,
    ]
    return "\n".join([*lines, "", "## Warnings", "", *warned, ""])


def record(folder: Path, outs: list[Path]) -> Row:
    """Sums over all cases; also of listed effects that are told as descriptions, and of machines without a mechanism."""
    worlds: dict[str, dict[str, Any]] = json.loads((folder / "worlds.json").read_text())
    rows, more = [], {"described": 0, "no effect": 0, "no effect, none": 0}
    for file in (f for out in outs for f in (out / "diagnoses").glob("*.json") if f.stem in worlds):
        case, diagnosis = worlds[file.stem], json.loads(file.read_text())["diagnosis"]
        rows.append(judged(case, diagnosis)[0])
        told = {name(d) for d in diagnosis["unexplained"].get("descriptions", [])}
        more["described"] += sum(name(e) in told for e in case["effects"] if e["energy"] >= DEMANDED)
        more["no effect"] += not case["acts"]
        more["no effect, none"] += not case["acts"] and diagnosis["verdict"] == "none"
    return total(rows, HEAD + OWN) | more


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Tables of what gtpin said of the cases.")
    parser.add_argument("folder", type=Path, help="the cases, with worlds.json")
    parser.add_argument("outs", type=Path, nargs="+", help="folders that gtpin blind wrote")
    parser.add_argument("--record", nargs=2, metavar=("FILE", "NAME"), help="add the sums to a JSON file")
    given = parser.parse_args()
    if given.record:
        file = Path(given.record[0])
        known = json.loads(file.read_text()) if file.exists() else {}
        file.write_text(json.dumps(known | {given.record[1]: record(given.folder, given.outs)}, indent=1) + "\n")
    else:
        print(report(given.folder, given.outs))
