"""The draft of a paper has the form that JOSS asks for, cites what it lists, and quotes the records."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

import gtpin

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "paper_draft"
RECORDS = ROOT / "docs" / "figures"
PAPER = (FOLDER / "paper.md").read_text(encoding="utf-8")
_, HEAD, BODY = PAPER.split("---\n", 2)
PROSE = " ".join(re.sub(r"<!-- figures.*?end of figures -->", "", BODY, flags=re.DOTALL).split())
SECTIONS = (
    "Summary",
    "Statement of need",
    "State of the field",
    "Functionality",
    "Quality control",
    "Limits",
    "References",
)
WORDS = (750, 1750)
"""Length of a paper in JOSS."""


def entries() -> dict[str, str]:
    text = (FOLDER / "paper.bib").read_text(encoding="utf-8")
    return {found[1]: found[2] for found in re.finditer(r"^@\w+\{(\w+),\n(.*?)^\}", text, re.MULTILINE | re.DOTALL)}


def test_the_front_matter_has_what_joss_needs() -> None:
    head = yaml.safe_load(HEAD)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= head.keys()
    known = {one["index"] for one in head["affiliations"]}
    assert {one["affiliation"] for one in head["authors"]} <= known
    assert (FOLDER / head["bibliography"]).is_file()


def test_the_sections_are_there_and_the_length_is_a_paper_s() -> None:
    found = re.findall(r"^# (.*)$", BODY, re.MULTILINE)
    assert [name for name in SECTIONS if name not in found] == []
    assert WORDS[0] < len(PROSE.split()) < WORDS[1]


def test_everything_cited_is_listed_and_everything_listed_is_cited() -> None:
    assert set(re.findall(r"@(\w+)", BODY)) == set(entries())


def test_every_reference_has_an_author_a_title_and_a_place_where_it_is_found() -> None:
    for key, text in entries().items():
        fields = dict(re.findall(r"^  (\w+) = \{(.*)\},?$", text, re.MULTILINE))
        assert {"author", "title"} <= fields.keys(), key
        assert {"doi", "url", "booktitle"} & fields.keys() or "patent" in fields["howpublished"], key


def test_the_paper_s_figures_are_those_of_the_records() -> None:
    assert f"There are {len(gtpin.catalogue())} effects" in PROSE
    circle = pd.read_csv(RECORDS / "closed_circle.csv", keep_default_na=False)
    same = int((circle["found"] == circle["again"]).sum())
    assert f"on {same} of {len(circle)} virtual machines the same causes are named" in PROSE
    arms = json.loads((RECORDS / "real_arms.json").read_text(encoding="utf-8"))
    gains: dict[str, bool] = {}  # an arm with two series counts once, and gains where both do
    for name, one in arms.items():
        gained = one["left_out"]["diagnosis"]["rms"] < one["left_out"]["geometry"]["rms"]
        arm = name.split("_")[0]
        gains[arm] = gains.get(arm, True) and gained
    words = {1: "one", 2: "two", 3: "three"}
    assert f"on {words[sum(gains.values())]} of {words[len(gains)]} arms the named causes reduce the errors" in PROSE
    verdicts = {name: one["verdict"] for name, one in arms.items() if "verdict" in one}
    assert {name.split("_")[0] for name in verdicts} == set(gains)
    assert "explained" not in verdicts.values()
