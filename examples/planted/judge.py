"""What gtpin said of planted causes: ``python judge.py OUT DIAGNOSES [--half training] [--record FILE]``.

A cause of the case is *new* where the bare diagnosis has it in no class and its own class does not hold the planted one. The
amplitude of a named cause is that of its displacement along the planted one, after what geometry absorbs is projected out.
"""

from __future__ import annotations

import argparse
import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from answers import SURE, Name, classes, name
from background import Array, Background, Projection

import gtpin
from gtpin.data import Dataset

LIKELY, SIGMAS = 0.5, 2.0
Pair = tuple[int, int]


class Judge:
    """Judges the cases of the backgrounds in OUT/bare."""

    def __init__(self, out: Path) -> None:
        self.out, self.known = out, dict[str, tuple[Background, Array, Projection]]()

    def background(self, which: str) -> tuple[Background, Array, Projection]:
        if which not in self.known:
            place = self.out / "bare" / which
            b = Background.of(which, Dataset.read(place.with_suffix(".dataset")), place)
            sigma = b.sigma(b.model)
            self.known[which] = b, sigma, Projection(b.absorbed(sigma))
        return self.known[which]

    def amplitude(
        self, case: Path, answer: Path, truth: dict[str, Any], planted: Name
    ) -> tuple[float, float, float] | None:
        """Found over planted, its standard deviation, and what the bare residuals have; None where it leads no class."""
        model, data = gtpin.read_model(answer), Dataset.read(case)
        b, sigma, project = self.background(truth["background"])
        mine = [e for e in model.effects if e.name == "@".join(planted)]
        if not mine:
            return None
        others = model.without([mine[0].name])
        start = others.predict(data.q, data.covariates)
        r = np.load(case.with_suffix(".npz"))["whitened"]
        Mr = project(r)

        def along(c: Array) -> float:
            acting = replace(others, effects=(*others.effects, replace(mine[0], coefficients=c)))
            moved = b.shift(start, acting.predict(data.q, data.covariates), model)
            return float(Mr @ (moved / sigma).ravel()) / float(Mr @ r)

        c = mine[0].coefficients
        steps = np.sqrt(mine[0].covariance.diagonal())
        found = along(c)
        slope = np.array(
            [(along(c + h * e) - found) / h if h else 0.0 for h, e in zip(steps, np.eye(len(c)), strict=True)]
        )
        residual = (b.residual(b.model) / sigma).ravel()
        return found, float(np.sqrt(slope @ mine[0].covariance @ slope)), float(Mr @ residual) / float(Mr @ r)

    def case(self, case: Path, answer: Path) -> dict[str, Any]:
        """What was said of a case, and its counts: whether each holds, and whether it is asked."""
        truth = json.loads(case.with_suffix(".truth.json").read_text())
        said = json.loads(answer.with_name(f"{answer.name}.json").read_text())
        bare = self.background(truth["background"])[0].said
        planted, listed = name(truth["effects"][0]), truth["listed"]
        before = classes(bare)
        new = {
            name(c): c["probability"]
            for c in said["causes"]
            if name(c) not in before and planted not in {name(m) for m in c["class"]}
        }
        named, halved = planted in classes(said), answer.with_name(f"{answer.name}.half.json")
        size = self.amplitude(case, answer, truth, planted) if named else None
        sure_before = [name(c) for c in bare["causes"] if c["probability"] >= SURE]
        counts: dict[str, tuple[bool, bool]] = {  # whether it holds, and whether it is asked
            "named": (named, listed),
            "sure": (any(name(c) == planted and c["probability"] >= SURE for c in said["causes"]), listed),
            "right size": (size is not None and abs(size[0] - 1.0) <= SIGMAS * size[1], size is not None),
            "right sum": (size is not None and abs(size[0] - 1.0 - size[2]) <= SIGMAS * size[1], size is not None),
            "unknown": (not listed and said["verdict"] == "unknown", not listed),
            "quiet": (not any(p > LIKELY for p in new.values()), True),
            "silent": (not any(p >= SURE for p in new.values()), True),
            "elsewhere": (not any(p >= SURE and site != planted[1] for (_, site), p in new.items()), True),
        }
        if halved.exists():
            counts["again"] = planted in classes(json.loads(halved.read_text())), True
        return {
            "case": case.name,
            "groups": ("all", truth["background"], f"E {truth['asked']:.0f}"),
            "planted": "@".join(planted),
            "verdict": said["verdict"],
            "size": size,
            "described": planted in map(name, said["unexplained"]["descriptions"]),
            "new": {"@".join(n): round(p, 3) for n, p in new.items()},
            "counts": {**counts, "kept": (sum(one in classes(said) for one in sure_before), len(sure_before))},
        }


def record(rows: list[dict[str, Any]]) -> dict[str, dict[str, Pair]]:
    """By group (all, background, energy, and the last two together): of each count, how many hold of how many asked."""
    found: dict[str, dict[str, Pair]] = {}
    for row in rows:
        for group in (*row["groups"], ", ".join(row["groups"][1:])):
            sums = found.setdefault(group, {})
            for key, (good, of) in row["counts"].items():
                before = sums.get(key, (0, 0))
                sums[key] = int(before[0] + good), int(before[1] + of)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Tables of what gtpin said of planted causes.")
    parser.add_argument("out", type=Path)
    parser.add_argument("diagnoses", type=Path)
    parser.add_argument("--half", choices=("training", "sealed"), default="training")
    parser.add_argument("--record", type=Path, help="write the sums to this JSON file")
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    judge, rows = Judge(given.out), []
    for file in sorted((given.out / given.half).glob("*.truth.json")):
        case = file.with_name(file.name.removesuffix(".truth.json"))
        answer = given.diagnoses / case.name
        if answer.with_name(f"{answer.name}.json").exists():
            rows.append(judge.case(case, answer))
    for row in rows:
        size = "" if row["size"] is None else " amplitude {:.2f} ± {:.2f} (there: {:.2f})".format(*row["size"])
        told = "named" if row["counts"]["named"][0] else "described" if row["described"] else "-"
        print(f"{row['case']}, {row['groups'][2]}: {row['planted']}: {row['verdict']}, {told}{size}, new: {row['new']}")
    for group, sums in record(rows).items():
        print(f"{group}: " + ", ".join(f"{key} {good} of {of}" for key, (good, of) in sums.items()))
    if given.record:
        known = json.loads(given.record.read_text()) if given.record.exists() else {}
        key = "cases" if given.half == "training" else given.half
        given.record.write_text(json.dumps(known | {key: record(rows)}) + "\n")


if __name__ == "__main__":
    main()
