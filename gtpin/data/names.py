"""Names of a dataset's columns, and the kind of cells of each name."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import Literal

from gtpin.errors import DatasetError

Kind = Literal["id", "number", "any"]

POSITION = ("x", "y", "z")
ORIENTATION = ("qw", "qx", "qy", "qz")
SIGMAS = ("sx", "sy", "sz", "srx", "sry", "srz")
"""Columns of a tracker's own sigmas, per row."""
IDS = ("pose", "session")

_PLAIN = ("time", "session", "temp_frame", "temp_link", "payload")
_COVARIATE = re.compile(rf"{'|'.join(_PLAIN)}|f[xyz]|(?:approach|speed)[1-9][0-9]*")
# Names of the columns of poses.csv and carts.csv that are no covariates.
TAKEN_IN_POSES = re.compile(r"pose|q[0-9]+|[xyz]|q[wxyz]")
TAKEN_IN_CARTS = re.compile(r"pose|cart|q|[xyz]|q[wxyz]")

ZERO_COUNTS = re.compile(r"payload|f[xyz]|speed[1-9][0-9]*")
"""Covariates of which 0 in every row is information: that the machine stood still, or carried nothing."""
LIKE = 0.8
"""Share of letters that two names must have in common, in the same order, to look alike (``difflib``'s ratio). Assumed."""
LONGEST = 200
"""Most letters that the name of a column can have."""
_NUMBER = re.compile(r"q[0-9]*|[xyz]|q[wxyz]|cart|time|temp_frame|temp_link|payload|f[xyz]|(?:approach|speed)[0-9]+")


def kind_of(name: str) -> Kind:
    """What the cells of a column must be: ids, numbers, or anything; a column of the last kind is kept if it has numbers."""
    if name in IDS:
        return "id"
    return "number" if _NUMBER.fullmatch(name) else "any"


def is_command(name: str) -> bool:
    """Say whether a column is one of q1 .. qn."""
    return re.fullmatch(r"q[0-9]+", name) is not None


def command_names(n_actuators: int) -> list[str]:
    """List q1 .. qn."""
    return [f"q{i}" for i in range(1, n_actuators + 1)]


def is_own(name: str) -> bool:
    """Say whether a covariate is none that effects look at, but a column of the user's own."""
    return _COVARIATE.fullmatch(name) is None


def known_lookalike(name: str) -> str | None:
    """The known covariate that a name nearly equals: they differ in case, spaces, dashes or a few letters.

    None where there is no such covariate, or where the name is itself a known one.
    """
    plain = re.sub(r"[\s_-]+", "_", name[:LONGEST].strip().lower())
    if len(name) > LONGEST or (plain == name and _COVARIATE.fullmatch(name)):
        return None
    if _COVARIATE.fullmatch(plain):
        return plain
    number = re.search(r"[1-9][0-9]*$", plain)
    known = [*_PLAIN, *(f"{kind}{number[0] if number else 1}" for kind in ("approach", "speed"))]
    return next(iter(get_close_matches(plain, known, 1, LIKE)), None)


def lookalikes(names: Collection[str]) -> dict[str, str]:
    """The names that nearly equal a known covariate, each with that covariate; without those whose covariate is there too."""
    found = {name: known_lookalike(name) for name in names}
    return {name: known for name, known in found.items() if known is not None and known not in names}


def lookalike_words(alike: Mapping[str, str]) -> str:
    """What happens to columns whose names nearly equal known ones, as text."""
    pairs = ", ".join(f"{name!r} is not {known!r}" for name, known in alike.items())
    return (
        f"{pairs}: kept as covariates of their own, which no effect of gtpin's looks at; rename them if the known ones are "
        "meant"
    )


def is_approach(name: str) -> bool:
    """Say whether a column is one of approach1 .. approachn."""
    return re.fullmatch(r"approach[0-9]+", name) is not None


def check_covariate_name(name: str, n_actuators: int, taken: re.Pattern[str]) -> None:
    """Raise `DatasetError` for a name that no covariate of a robot with ``n_actuators`` actuators can have."""
    if len(name) > LONGEST:
        what = f"the name of a column has {len(name):,} letters"
        raise DatasetError(what, column=name[:40], hint="give a shorter name")
    if not name.strip() or not name.isprintable():
        raise DatasetError("a covariate needs a printable name", column=repr(name))
    if taken.fullmatch(name):
        raise DatasetError("the name is taken by a column that is no covariate", column=name, hint="rename it")
    numbered = re.fullmatch(r"(approach|speed)([0-9]+)", name)
    if numbered and numbered[2] not in {str(i) for i in range(1, n_actuators + 1)}:
        hint = f"{numbered[1]} columns are numbered 1 to {n_actuators}, like q1 .. q{n_actuators}"
        raise DatasetError(f"there is no actuator {numbered[2]}", column=name, hint=hint)


def site_called(name: str, sites: Collection[str]) -> str:
    """A site by any of its names: ``all_links`` is ``arm`` and ``instrument`` is ``frame``, where no site is called so."""
    return name if name in sites else {"all_links": "arm", "instrument": "frame"}.get(name, name)
