"""Tables of what gtpin said of the cases: ``python judge.py FOLDER OUT [OUT ...]``; OUT of `gtpin blind -o OUT --from`.

With ``--record FILE NAME`` the sums are added to a JSON file, of which docs/blind.md has its table.

An effect is demanded from an energy of 63 on (gtpin's own bound of what it promises to see); a weaker one may be named or not.
Confidence is a probability of 0.9 or more. A cause is false where its effect and site are no part of the truth: "near" where it
is the name that the mechanism has at distance 0, at its site, and "another" else. "Of own form" are listed effects of which
other effects of the catalogue leave 63 or more, and unlisted ones of which they leave 250 or more (left.py).

Of telescopes an energy counts relative to the noise with rough joints, and "near" is what of the list comes nearest. Their
own table is of cases in which every effect is listed (each demanded one in a class; shares of the gap within 0.15, of the sites
that have one or are said, where a class counts at the site of the true effect that it holds), of verdicts `unknown` (the
strongest listed effect that is demanded is named, or one of the first two of `could_be`), and of innocents.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mechanisms import MECHANISMS
from telescopes import PARTS

DEMANDED, UNLIKE, SURE = 63.0, 250.0, 0.9
WITHIN = 0.15  # of a site's true share
HEAD = ("listed", "class holds", "alone, sure", "unlisted", "unknown", "cases", "false, sure", "another name")
OWN = ("listed, of own form", "alone, sure, of own form", "unlisted, of own form", "unknown, of own form")
TELESCOPES = (
    "all listed",
    "in classes",
    "sites",
    "share within 0.15",
    "unknown beside a listed one",
    "named or first two",
    "innocent",
    "none",
)
LISTED = {m.name: m.listed for m in MECHANISMS}
Row = dict[str, int]


def name(item: dict[str, Any]) -> str:
    return f"{item['effect']}@{item['site']}"


def judged(case: dict[str, Any], diagnosis: dict[str, Any]) -> tuple[Row, list[str]]:
    """Counts of one case, and its false causes as they were said."""
    effects = [e for e in case["effects"] if e["energy"] / case.get("noise", 1.0) >= DEMANDED]
    listed = [e for e in effects if not e["effect"].startswith("unlisted_")]
    allowed = {name(e) for e in case["effects"]}
    causes = diagnosis["causes"]
    sure = [c for c in causes if c["probability"] >= SURE]
    classes = [{name(m) for m in c["class"]} for c in causes]
    alone = {name(c) for c in sure if len(c["class"]) == 1}
    near = [f"{LISTED[a['mechanism']]}@{a['site']}" for a in case["acts"]]
    near += [PARTS[part].near for part in case.get("parts", ()) if PARTS[part].near]
    false = [
        f"{name(c)} ({c['probability']:.3f}, {'near' if name(c).startswith(tuple(near)) else 'another'})"
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


def carried(case: dict[str, Any], diagnosis: dict[str, Any]) -> Row:
    """Counts of one case of a telescope that only such cases have."""
    effects = [e for e in case["effects"] if e["energy"] / case["noise"] >= DEMANDED]
    listed = [e for e in effects if not e["effect"].startswith("unlisted_")]
    strange = any(e["effect"].startswith("unlisted_") for e in case["effects"])
    causes, firm = diagnosis["causes"], bool(effects) and not strange
    classes = [{name(m) for m in c["class"]} for c in causes]
    true = [(e["site"], e["share"]) for e in case["effects"]]
    explained = diagnosis["gap"]["shrinkage"] or 0.0
    said = []
    for cause, known in zip(causes, classes, strict=True) if firm else ():
        where = next((e["site"] for e in case["effects"] if name(e) in known), cause["site"])
        said.append((where, explained * cause["share"]))
    sites = {site for site, _ in true + said} if firm else set()
    missed = [sum(v for at, v in true if at == site) - sum(v for at, v in said if at == site) for site in sites]
    beside = diagnosis["verdict"] == "unknown" and bool(listed)
    first = {name(item) for item in diagnosis["unexplained"]["could_be"][:2]}.union(*classes)
    return {
        "all listed": int(firm),
        "in classes": int(firm and all(any(name(e) in k for k in classes) for e in listed)),
        "sites": len(sites),
        "share within 0.15": sum(abs(v) <= WITHIN for v in missed),
        "unknown beside a listed one": int(beside),
        "named or first two": int(beside and name(max(listed, key=lambda e: e["energy"])) in first),
        "innocent": int(not case["effects"]),
        "none": int(not case["effects"] and diagnosis["verdict"] == "none"),
    }


def total(rows: Iterable[Row], keys: tuple[str, ...] = HEAD) -> Row:
    found = list(rows)
    return {key: sum(row[key] for row in found) for key in keys}


def table(title: str, groups: dict[str, list[Row]], head: tuple[str, ...] = HEAD) -> list[str]:
    lines = [f"| {title} | " + " | ".join(head) + " |", "|---" * (len(head) + 1) + "|"]
    for key in sorted(groups):
        lines.append(f"| {key} | " + " | ".join(str(v) for v in total(groups[key], head).values()) + " |")
    return [*lines, ""]


def report(folder: Path, outs: list[Path]) -> str:
    """Markdown: tables by family, mechanism and distance, then each false cause and each case's answer."""
    worlds: dict[str, dict[str, Any]] = json.loads((folder / "worlds.json").read_text())
    groups: dict[str, dict[str, list[Row]]] = {
        k: defaultdict(list) for k in ("family", "mechanism", "distance", "telescope")
    }
    false_lines, answers, warned = [], [], []
    for file in sorted((f for out in outs for f in (out / "diagnoses").glob("*.json")), key=lambda f: f.name):
        if file.stem not in worlds:
            continue  # a second diagnosis with the truth taken out of the catalogue
        case, diagnosis = worlds[file.stem], json.loads(file.read_text())["diagnosis"]
        row, false = judged(case, diagnosis)
        groups["family"][f"{file.stem[:4]}, {case['robot']}, {case['instrument']}"].append(row)
        groups["family"]["~ all"].append(row)
        if "parts" in case:
            groups["telescope"][" + ".join(case["parts"]) or "(none)"].append(carried(case, diagnosis))
            groups["telescope"]["~ all"].append(carried(case, diagnosis))
        acts = case["acts"] or [{"mechanism": "(none)", "distance": 0.0, "site": ""}]
        if "parts" not in case and len(acts) == 1:
            groups["mechanism"][acts[0]["mechanism"]].append(row)
            groups["distance"][f"{acts[0]['distance']:.1f}" if case["acts"] else "no effect"].append(row)
        elif "parts" not in case:
            groups["mechanism"]["~ two mechanisms"].append(row)
            groups["distance"]["~ two mechanisms"].append(row)
        truth = ", ".join(f"{name(e)} E={e['energy']:.0f}" for e in case["effects"]) or "nothing"
        told = " + ".join(case.get("parts", ())) or ", ".join(f"{a['mechanism']} d={a['distance']}" for a in acts)
        said = ", ".join(
            f"{name(c)} {c['probability']:.2f}" + ("" if len(c["class"]) < 2 else f" of {len(c['class'])}")
            for c in diagnosis["causes"]
        )
        if could := diagnosis["unexplained"].get("could_be"):
            said += f"; could be {', '.join(name(item) for item in could[:2])}"
        answers.append(f"| {file.stem} | {told} | {truth} | {diagnosis['verdict']} | {said} |")
        if false:
            line = f"| {file.stem} | {case['robot']} | {told} | {truth} | {diagnosis['verdict']} |"
            false_lines.append(f"{line} {', '.join(false)} |")
        for text in diagnosis.get("warnings", []):
            if "do not vary" not in text:
                warned.append(f"- {file.stem} ({told}): {text}")
    lines = ["## By family", "", *table("family", groups["family"])]
    if groups["telescope"]:
        lines += ["## Telescopes", "", *table("parts", groups["telescope"], TELESCOPES)]
    lines += ["## By mechanism", ""]
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
