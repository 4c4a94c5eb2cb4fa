"""`gtpin diagnose`."""

from __future__ import annotations

from pathlib import Path

from problem import predictions

import gtpin
from gtpin.bench.benchmark.answer import Answer, AnsweredCause
from gtpin.data import Dataset


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    found = gtpin.diagnose(Dataset.read(folder))
    causes = []
    for said in found.to_json()["causes"]:
        members = [{"effect": member["effect"], "site": member["site"]} for member in said["class"]]
        keys = {"effect": said["effect"], "site": said["site"], "probability": said["probability"], "class": members}
        causes.append(AnsweredCause.model_validate(keys))
    told = {
        "causes": tuple(causes),
        "unknown": found.verdict == "unknown",
        "explained_fraction": found.gap.explained_fraction,
    }
    return predictions(found.model, folder).model_copy(update=told)
