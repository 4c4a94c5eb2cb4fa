"""The page of the statistics names constants that exist, and has all of them."""

import re
from dataclasses import fields
from pathlib import Path

import gtpin
from gtpin.diagnosis import priors

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "statistics.md"
TEXT = PAGE.read_text(encoding="utf-8")
DERIVATION = TEXT.split("## Numbers that influence a verdict")[0]
NO_CONSTANTS = {"site", "none", "explained", "ambiguous", "unknown", "station"}
NO_CONSTANTS |= {"best_scales", "errors_beyond_noise", "ends", "FittedLines"}
"""Words in code style that are values, columns or functions."""


def test_every_constant_that_the_page_names_is_in_priors() -> None:
    known = {field.name for field in fields(priors.Priors)} | {"SURE", "CLASS_SHARE"}
    prose = re.sub(r"^```.*?^```$", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    in_text = set(re.findall(r"`([A-Za-z_]+)`", prose)) - NO_CONSTANTS
    in_equations = {name.replace("\\_", "_") for name in re.findall(r"\\texttt\{([^}]+)\}", prose)}
    assert len(in_equations) > 8
    known |= {effect.id for effect in gtpin.catalogue()}
    assert in_text | in_equations <= known, (in_text | in_equations) - known


def test_every_prior_of_the_evidence_and_of_the_probabilities_is_on_the_page() -> None:
    names = [field.name for field in fields(priors.Priors)]
    first, last = names.index("scale_spread"), names.index("not_varied")
    missing = [n for n in names[first : last + 1] if n not in DERIVATION and n.replace("_", "\\_") not in DERIVATION]
    assert not missing
