"""Tables of sealed scores for the pages, from ``blind*.json``, ``machines.json`` and ``chains.json`` in docs/figures."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from typing import Any

from figures import RECORDS
from scipy.stats import binomtest

OUT = "outside the catalogue: "
TAKEN = "taken out of the catalogue: "
STRONG = ", where others leave more than 250"
UNKNOWN, SURE = f"unknown{STRONG}", f"a cause named with confidence{STRONG}"
SEALED = {
    "detected, E > 63": "detected, E > 63",
    "class holds the truth, E > 63": "class holds the truth, E > 63",
    "members of the class, E > 63": "members of this class, mean",
    "cause and site right, nothing else named, D > 63": "cause and site right, nothing else named, D > 63",
    "no false name with confidence, D <= 63": "no false cause named with confidence, D <= 63",
    "no effect: silent": "no effect: nothing detected",
    OUT + UNKNOWN: f"in no catalogue: `unknown`{STRONG}",
    OUT + SURE: "the same cases: a cause named with confidence",
    TAKEN + UNKNOWN: f"{TAKEN}`unknown`{STRONG}",
    TAKEN + SURE: "the same cases: a cause named with confidence",
    "two effects, E > 63 of each: F1 of the set": "two effects at once, E > 63 of each: F1 of the set",
    "Brier score of the named causes": "Brier score of the named causes",
    "log score of the named causes, nats": "log score of the named causes, nats",
    "risk of causes of 0.9 or more": "risk: causes of 0.9 or more that are false",
    "coverage of causes of 0.9 or more, one effect, E > 63": "coverage: one effect, E > 63, with a cause of 0.9 or more",
    "risk of causes of 0.5 or more": "the same of 0.5 or more: risk",
    "coverage of causes of 0.5 or more, one effect, E > 63": "the same of 0.5 or more: coverage",
    "rough data: class holds the truth, E > 63, covariate there": "rough data: class holds the truth, E > 63",
    "95 % interval of shrinkage covers": "95 % interval of the explained fraction covers the realised one",
    "shrinkage said less realised": "explained fraction: predicted less realised, mean",
    "95 % intervals of parameters cover": "95 % intervals of parameters cover the true values",
}
"""Figures of ``score.json``, and how docs/diagnosis.md calls them."""
MACHINE = {
    "class holds the truth, E > 63": "class right, E > 63",
    "cause and site right, nothing else named, D > 63": "cause right, D > 63",
    "no effect: silent": "no effect: nothing detected",
    "no false name with confidence, D <= 63": "no false cause, D <= 63",
    "two effects: F1 of the set": "F1 of two",
    TAKEN + UNKNOWN: "taken out: unknown",
    "95 % interval of shrinkage covers": "explained fraction covered",
}
"""The same for docs/blind.md."""
INSTRUMENT: dict[str, tuple[str, str, float | None, float | None]] = {
    "detected": ("detected, E > 63", "", None, None),
    "in_class": ("class right, E > 63", "0.95 or more", 0.95, None),
    "false_with_confidence": ("a false cause named with confidence, all cases", "0.03 or less", None, 0.03),
    "silent": ("no effect: nothing detected", "0.99 or more", 0.99, None),
    "95 % intervals of parameters cover": ("95 % intervals of parameters cover", "0.93 to 0.97", 0.93, 0.97),
    "95 % interval of shrinkage covers": ("95 % interval of the explained fraction covers", "", None, None),
}
"""Scores of a check of one instrument: how docs/blind.md calls each, its goal in words, and the goal's bounds."""


def _record(name: str) -> Any:
    return json.loads((RECORDS / name).read_text(encoding="utf-8"))


def value(row: dict[str, Any]) -> str:
    """A figure with its 95 % bounds."""
    if row["value"] is None:
        return "no case"
    bounds = "" if row["low"] is None else f" ({row['low']:.2f}..{row['high']:.2f})"
    return f"{row['value']:.2f}{bounds}"


def sealed_sentence() -> str:
    """Which run the scores are of."""
    check = _record("blind.json")["check"]
    command = f"gtpin blind -o DIR --cases {check['cases']} --seed {check['seed']}"
    return f"On {check['cases']:,} sealed cases (`{command}`), with 95 % bounds:"


def blind_runs() -> str:
    """The log of all full runs, which examples/blind/page.py keeps."""
    with (RECORDS / "blind_runs.csv").open(encoding="utf-8", newline="") as log:
        head, *rows = csv.reader(log)
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])


def sealed_score() -> str:
    """The scores of the latest full run, as docs/diagnosis.md has them."""
    rows = {row["figure"]: row for row in _record("blind.json")["figures"]}
    lines = ["| | | of |", "|---|---|---|"]
    lines += [f"| {words} | {value(rows[name])} | {rows[name]['of']} |" for name, words in SEALED.items()]
    return "\n".join(lines)


def machine_scores() -> str:
    """The scores of the other machines with rods together, as docs/blind.md has them: each has few cases."""
    scores = _record("machines.json")
    lines = ["| | cases | share |", "|---|---|---|"]
    for name, words in MACHINE.items():
        rows = [row for score in scores.values() for row in score["figures"] if row["figure"] == name and row["of"]]
        of, total = sum(row["of"] for row in rows), sum(row["of"] * row["value"] for row in rows)
        lines.append(f"| {words} | {f'{of} | {total / of:.2f}, mean' if 'F1' in words else share(round(total), of)} |")
    return "\n".join([*lines, "", f"{', '.join(f'`{name}`' for name in scores)}. {_failed(scores)}"])


def chain_scores() -> str:
    """The scores of arms and loops, as docs/blind.md has them."""
    return _scores("chains.json")


def _scores(record: str) -> str:
    lines = ["| machine | " + " | ".join(MACHINE.values()) + " |", "|---" * (len(MACHINE) + 1) + "|"]
    scores = _record(record)
    for machine, score in scores.items():
        rows = {row["figure"]: row for row in score["figures"]}
        cells = [value(rows[name]) + (f" of {rows[name]['of']}" if rows[name]["of"] else "") for name in MACHINE]
        lines.append(f"| `{machine}` | {' | '.join(cells)} |")
    return "\n".join([*lines, "", _failed(scores)])


def _failed(scores: dict[str, Any]) -> str:
    """How many cases of checks failed."""
    return f"Failed: {sum(len(s['failures']) for s in scores.values())} of {sum(s['cases'] for s in scores.values())} cases."


def instrument_scores() -> str:
    """The scores of instruments other than a tracker, as docs/blind.md has them, each beside its goal."""
    found = _record("blind_instruments.json")
    heads = [f"{words} (goal: {goal})" if goal else words for words, goal, _, _ in INSTRUMENT.values()]
    lines = ["| instrument | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    for kinds, score in found.items():
        (by_instrument,) = score["by_instrument"].values()
        rows = by_instrument | {row["figure"]: row for row in score["figures"]}
        cells = [_beside_its_goal(rows[name], least, most) for name, (_, _, least, most) in INSTRUMENT.items()]
        check = score["check"]
        machine = "" if check["robot"] == "gantry_tau" else f" --robot {check['robot']}"
        drawn = f"{check['cases']} cases, seed {check['seed']}"
        lines.append(f"| `{kinds}{machine}`, {drawn} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", _failed(found)])


def _beside_its_goal(row: dict[str, Any], least: float | None, most: float | None) -> str:
    """A figure with its bounds and number of cases, and whether its goal is missed."""
    if row["value"] is None:
        return "no case"
    missed = (least is not None and row["value"] < least) or (most is not None and row["value"] > most)
    return f"{value(row)} of {row['of']}{', missed' if missed else ''}"


WORLDS = (
    ("effect unlisted, others leave > 250 of it: verdict `unknown`", "unknown, of own form", "unlisted, of own form"),
    ("effect unlisted, E > 63: verdict `unknown`", "unknown", "unlisted"),
    ("cases with a false cause of 0.9 or more", "false, sure", "cases"),
    ("of these, not the mechanism's textbook name at its site", "another name", "cases"),
    ("listed effect, E > 63: in a class", "class holds", "listed"),
    ("others leave > 63 of it: right alone, 0.9 or more", "alone, sure, of own form", "listed, of own form"),
    ("right alone, 0.9 or more", "alone, sure", "listed"),
    ("no effect: `none`", "no effect, none", "no effect"),
)
"""What is counted on machines of another simulation, and the keys of its number and of the cases: the worst first."""


def worlds() -> str:
    """What is found on the machines of another simulation, as docs/blind.md has it: the last set, with today's rules."""
    last = list(_record("worlds.json").values())[-1]
    lines = ["| | cases | share |", "|---|---|---|"]
    lines += [f"| {words} | {share(last[key], last[of])} |" for words, key, of in WORLDS]
    return "\n".join(lines)


def share(good: int, of: int) -> str:
    """A count, and the share with Wilson's 95 % bounds: two cells of a table."""
    low, high = binomtest(good, of).proportion_ci(method="wilson")
    return f"{good} of {of} | {good / of:.2f} ({low:.2f}..{high:.2f})"


PLANTED = {
    "named": "planted and listed: in a class",
    "sure": "planted and listed: leads its class with 0.9 or more",
    "again": "named: again with half of the poses",
    "unknown": "planted and unlisted: verdict `unknown`",
    "silent": "no other new cause of 0.9 or more",
    "elsewhere": "no other new cause of 0.9 or more at another site",
    "kept": "certain (0.9) before the planting: still in a class",
}
"""What is counted of causes that were planted in measured data."""
BACKGROUNDS = {"stewart": "Stewart", "ur10": "UR10", "ur5": "UR5", "wam": "WAM", "panda_3": "Panda"}
"""Machines whose measurements are the backgrounds."""


def planted() -> str:
    """What is said of causes that were planted in measured data, for docs/blind.md, by machine: the worst figure first."""
    found = _record("planted.json")["sealed"]
    lines = ["| | all | share | " + " | ".join(BACKGROUNDS.values()) + " |", "|---" * (len(BACKGROUNDS) + 3) + "|"]
    counted = [key for key in PLANTED if found["all"][key][1]]
    for key in sorted(counted, key=lambda key: found["all"][key][0] / found["all"][key][1]):
        cells = (_counted(found[machine], key) for machine in BACKGROUNDS)
        lines.append(f"| {PLANTED[key]} | {share(*found['all'][key])} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _counted(group: Mapping[str, tuple[int, int]], key: str) -> str:
    good, of = group.get(key, (0, 0))
    return f"{good} of {of}" if of else ""


def planted_halves() -> str:
    """Causes that only one half of a real series shows, as docs/blind.md has it."""
    lines = ["| series | by pose | by time | by region |", "|---|---|---|---|"]
    for name, splits in _record("planted.json")["halves"].items():
        cells = [f"{len(s['false'])} of {s['sure']}" if s["sure"] else "none named" for s in splits.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def jugglebot() -> str:
    """What is found on Jugglebot's measurements, as docs/real_arms.md has it."""
    found = _record("jugglebot.json")
    lines = ["| RMS, mm | calibrated geometry | with the named cause |", "|---|---|---|"]
    for key, words in (
        ("legs_sample", "leg residual, in the sample"),
        ("legs_left_out", f"leg residual, poses that were not fitted ({found['folds']} folds)"),
    ):
        lines.append(f"| {words} | " + " | ".join(f"{x:.3f}" for x in found[key]) + " |")
    before, after, floor = found["gap"]
    lines.append(f"| position on left-out poses (noise floor {floor:.2f}) | {before:.2f} | {after:.2f} |")
    for cause in found["causes"]:
        sizes = ", ".join(f"{name} {v:.2g} ± {s:.1g} {unit}" for name, (v, s, unit) in cause["parameters"].items())
        lines += [
            "",
            f"Named: `{cause['effect']}` at `{cause['site']}`, probability {min(cause['probability'], 0.99):.2f}",
        ]
        lines[-1] += f" or more; {sizes}; the same in {found['same_cause']} of {found['folds']} folds."
    untestable, candidates = found["untestable"]
    return "\n".join([*lines, "", f"{untestable} of {candidates} candidates can't be tested."])


STEPS = {"nominal": "nominal, frames fitted", "geometry": "calibrated geometry", "diagnosis": "with the named causes"}
"""What each step of examples/real/ladder.py is called."""


def real_ladder() -> str:
    """The errors on left-out poses of real arms, as docs/real_arms.md has them."""
    lines = [
        "| dataset | robot | poses | left out in turn | " + " | ".join(STEPS.values()) + " |",
        "|---" * (len(STEPS) + 4) + "|",
    ]
    for name, found in _record("real_arms.json").items():
        cells = [f"{found['left_out'][step]['rms']:.3f} / {found['left_out'][step]['mean']:.3f}" for step in STEPS]
        lines.append(f"| {name} | `{found['robot']}` | {found['poses']:,} | {_left_out(found)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def real_plain() -> str:
    """gtpin's calibration beside plain least squares, as docs/real_arms.md has it."""
    kinds = {"poses_measured": "positions and orientations", "positions": "positions"}
    lines = ["| dataset | poses | " + " | ".join(f"{words}: plain, gtpin, mm" for words in kinds.values()) + " |"]
    lines.append("|---" * (len(kinds) + 2) + "|")
    for name, found in _record("real_plain.json").items():
        cells = [f"{found[k]['plain']:.3f}, {found[k]['gtpin']:.3f}" if k in found else "" for k in kinds]
        lines.append(f"| {name} | {found['poses']:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _left_out(found: Mapping[str, Any]) -> str:
    """What a ladder leaves out in turn."""
    what = "regions" if found.get("left_out_by", "region") == "region" else "parts drawn at random"
    return f"{found['folds']} {what}"


def real_causes() -> str:
    """What is named on real arms, as docs/real_arms.md has it."""
    lines = ["| dataset | verdict | noise floor, mm | named, probability | sizes |", "|---" * 5 + "|"]
    diagnosed = {name: found for name, found in _record("real_arms.json").items() if "verdict" in found}
    for name, found in diagnosed.items():
        begun = f"| {name} | {found['verdict']} | {found['gap'][2]:.3f} |"
        for cause in found["causes"]:
            sizes = _sizes(cause["parameters"])
            sure = min(cause["probability"], 0.99)
            lines.append(f"{begun} `{cause['effect']}` at `{cause['site']}`, {sure:.2f} | {sizes} |")
            begun = "| | | |"
        if not found["causes"]:
            lines.append(f"{begun} none | |")
    return "\n".join(lines)


def _sizes(parameters: Mapping[str, tuple[float, float, str]]) -> str:
    """Parameters with sigmas; of lines of a turning joint their number and the largest."""
    lines = [name for name in parameters if name.startswith("period")]
    if not lines or parameters[lines[0]][2] != "rad":
        return "; ".join(f"{key} {v:.2g} ± {s:.1g} {unit}" for key, (v, s, unit) in parameters.items())
    found = []
    for name in lines:
        (period, spread, _), (amplitude, sigma, _) = (
            parameters[key] for key in (name, name.replace("period", "amplitude"))
        )
        turns = 2.0 * math.pi / period
        found.append(
            (amplitude, f"{turns:.2f} ± {turns * spread / period:.2f}: {1e3 * amplitude:.3f} ± {1e3 * sigma:.3f}")
        )
    return f"{len(found)} lines; {max(found)[1]}"


def real_curves() -> str:
    """How the curves of joints agree that two series of one arm show, each diagnosed alone."""
    lines = [
        "| joint | both have poses, deg | grid, mrad | random, mrad | difference, mrad | correlation |",
        "|---" * 6 + "|",
    ]
    for joint, found in _record("real_curves.json")["joints"].items():
        if found is None:
            lines.append(f"| `{joint}` | too few | | | | |")
            continue
        sizes = " | ".join(f"{found[key]:.3f}" for key in ("first", "second", "difference"))
        lines.append(f"| `{joint}` | {found['degrees']:.0f} | {sizes} | {found['correlation']:.2f} |")
    return "\n".join(lines)


def real_kept() -> str:
    """What is left of one series with the causes of the other, geometry fitted."""
    found = _record("real_curves.json")
    lines = ["| series | geometry alone, mm | geometry, and the causes of the other series, mm |", "|---" * 3 + "|"]
    for name, alone, kept in zip(found["series"], found["geometry"], found["kept"], strict=True):
        lines.append(f"| {name} | {alone:.3f} | {kept:.3f} |")
    return "\n".join(lines)


def real_panda() -> str:
    """The Panda with a ball in sockets: what is left at places that were not fitted."""
    record = json.loads((RECORDS / "real_panda.json").read_text(encoding="utf-8"))
    lines = [
        "| geometry | scatter, all places | worst place | sockets' distance off, worst place |",
        "|---|---|---|---|",
    ]
    for words, end in (("nominal", "_nominal"), ("calibrated", "")):
        worst = [1e3 * max(abs(row[key + end]) for row in record["places"]) for key in ("scatter", "distance_error")]
        lines.append(f"| {words} | {1e3 * record['scatter' + end]:.3g} mm | {worst[0]:.3g} mm | {worst[1]:.2f} mm |")
    return "\n".join(lines)
