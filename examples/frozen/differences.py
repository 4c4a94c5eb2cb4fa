"""What is kept of an answer, and in what two answers to the same data differ."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

Json = dict[str, Any]

PROBABILITY = 0.02
"""Largest change of a probability."""
SIGMAS = 1e-3
"""Largest change of a parameter, and of its sigma, in units of the frozen sigma."""
RELATIVE = 1e-4
"""Largest relative change of an error or a chi-square; of a shrinkage, which is a share of 1, the largest change."""
ERRORS = ("before", "after", "floor", "shrinkage")
"""Ends of the names of what is kept of a gap."""


def told(diagnosis: Json) -> Json:
    """What is kept of ``diagnosis.json``."""
    gap = diagnosis["gap"]
    parts = {"": gap} | {f"{name}.": part for name, part in gap.get("by_instrument", {}).items()}
    return {
        "verdict": diagnosis["verdict"],
        "causes": {
            _name(cause): {
                "probability": cause["probability"],
                "class": {_name(member): member["probability"] for member in cause["class"]},
                "parameters": {name: [p["value"], p["sigma"]] for name, p in cause["parameters"].items()},
            }
            for cause in diagnosis["causes"]
        },
        "gap": {f"{of}{name}": x for of, part in parts.items() for name, x in part.items() if name.endswith(ERRORS)},
    }


def fitted(calibration: Json) -> Json:
    """What is kept of ``calibration.json``."""
    parameters = {p["name"]: [p["value"], p["sigma"]] for p in calibration["parameters"]}
    return {"parameters": parameters, "chi2_per_dof": calibration["chi2_per_dof"]}


def _name(record: Json) -> str:
    return f"{record['effect']}@{record['site']}"


def differences(frozen: Json, now: Json) -> Iterator[str]:
    """A line for each field that differs."""
    for part, compared in (("calibration", _of_calibrations), ("diagnosis", _of_diagnoses)):
        a, b = frozen[part], now[part]
        if "refused" not in a and "refused" not in b:
            yield from compared(a, b)
        elif a.get("refused") != b.get("refused"):
            yield _line(part, *(x.get("refused") or x.get("verdict") or "not refused" for x in (a, b)))


def _of_calibrations(a: Json, b: Json) -> Iterator[str]:
    yield from _of_parameters("geometry", a["parameters"], b["parameters"])
    yield from _of_numbers({"chi2_per_dof": a["chi2_per_dof"]}, {"chi2_per_dof": b["chi2_per_dof"]})


def _of_diagnoses(a: Json, b: Json) -> Iterator[str]:
    if a["verdict"] != b["verdict"]:
        yield _line("verdict", a["verdict"], b["verdict"])
    yield from _of_names("causes", a["causes"], b["causes"])
    for cause in (name for name in a["causes"] if name in b["causes"]):
        of, other = a["causes"][cause], b["causes"][cause]
        p, q = ({"": c["probability"]} | c["class"] for c in (of, other))
        if p.keys() != q.keys() or not all(_near(p[name], q[name], PROBABILITY) for name in p):
            words = (", ".join(f"{name} {x:.3f}".strip() for name, x in sorted(one.items())) for one in (p, q))
            yield _line(f"probability and class of {cause}", *words)
        yield from _of_parameters(cause, of["parameters"], other["parameters"])
    yield from _of_numbers(
        {f"gap {name}": x for name, x in a["gap"].items()}, {f"gap {k}": x for k, x in b["gap"].items()}
    )


def _of_names(field: str, a: Iterable[str], b: Iterable[str]) -> Iterator[str]:
    if set(a) != set(b):
        yield _line(field, *(", ".join(sorted(names)) or "-" for names in (a, b)))


def _of_numbers(a: Mapping[str, float | None], b: Mapping[str, float | None]) -> Iterator[str]:
    for name in sorted({*a, *b}):
        before, after = a.get(name), b.get(name)
        size = 1.0 if name.endswith("shrinkage") else abs(before or 0.0)
        if not _near(before, after, RELATIVE * size):
            yield _line(name, before, after)


def _of_parameters(of: str, a: Mapping[str, list[float]], b: Mapping[str, list[float]]) -> Iterator[str]:
    """One line for all parameters of a geometry or a cause: how many moved, and which one most."""
    yield from _of_names(f"names of parameters of {of}", a, b)
    moved = {name: _moved(a[name], b[name]) for name in a if name in b}
    if over := [name for name in moved if not moved[name] <= SIGMAS]:
        most = max(over, key=lambda name: moved[name])
        words = (f"{value} ± {sigma}" for value, sigma in (a[most], b[most]))
        yield _line(f"{len(over)} of {len(moved)} parameters of {of}, most {most} by {moved[most]:.2g} sigma", *words)


def _moved(a: list[float], b: list[float]) -> float:
    """Change of a parameter or of its sigma, the larger, in units of the frozen sigma."""
    if a == b:
        return 0.0
    if None in (*a, *b) or not a[1] > 0.0:
        return float("inf")
    return max(abs(after - before) / a[1] for before, after in zip(a, b, strict=True))


def _near(a: float | None, b: float | None, tolerance: float) -> bool:
    return a == b if a is None or b is None else abs(a - b) <= tolerance


def _line(field: str, a: object, b: object) -> str:
    return f"{field}: {a} -> {b}"
