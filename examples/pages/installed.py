"""The figures of docs/install.md: where the megabytes of an installation are.

    python -m venv fresh && fresh/bin/pip install . && fresh/bin/python examples/pages/installed.py none
    python -m venv other && other/bin/pip install ".[plots]" && other/bin/python examples/pages/installed.py plots

measures the environment that runs it, and records it under the name of the extra; ``none`` is the package without extras.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "installed.json"
LISTED = 40.0
"""Megabytes from which a distribution has a row of its own."""
MEGABYTE = 1e6
NOT_OURS = ("gtpin", "pip", "setuptools")


def name_of(distribution: str) -> str:
    """The name as registries compare it."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


def needed_by(name: str, extras: Iterable[str] = ()) -> set[str]:
    """A distribution and what it needs, directly or not, of what is installed."""
    found: set[str] = set()
    waiting = [(name_of(name), frozenset(extras))]
    seen = set(waiting)
    while waiting:
        one, chosen = waiting.pop()
        try:
            requirements = metadata.requires(one) or []
        except metadata.PackageNotFoundError:
            continue
        found.add(one)
        for requirement in requirements:
            extra = re.search(r"extra == ['\"]([^'\"]+)", requirement)
            match = re.match(r"([\w.-]+)(?:\[([\w, -]+)\])?", requirement)
            if match and (extra is None or extra[1] in chosen):
                wanted = (name_of(match[1]), frozenset(re.findall(r"[\w-]+", match[2] or "")))
                waiting += [wanted] if wanted not in seen else []
                seen.add(wanted)
    return found


def sizes() -> dict[str, float]:
    """Megabytes of the files of each installed distribution, compiled modules as far as they are listed."""
    found = {}
    for distribution in metadata.distributions():
        name = name_of(distribution.metadata["Name"])
        files = [Path(str(distribution.locate_file(file))) for file in distribution.files or ()]
        if name not in NOT_OURS:
            found[name] = sum(file.stat().st_size for file in files if file.is_file()) / MEGABYTE
    return found


def measured() -> dict[str, object]:
    """Sizes in this environment, and by which of gtpin's dependencies each distribution comes."""
    found = sizes()
    direct = [re.match(r"[\w.-]+", text)[0] for text in metadata.requires("gtpin") or [] if "extra ==" not in text]
    comes = {name_of(one): needed_by(one) for one in direct}
    return {
        "python": sys.version.split()[0],
        "megabytes": {name: round(size, 1) for name, size in sorted(found.items(), key=lambda item: -item[1])},
        "by": {name: [one for one in comes if name in comes[one]] for name in found if found[name] >= LISTED},
    }


def table() -> str:
    """The base installation by distribution."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))["none"]
    megabytes, by = record["megabytes"], record["by"]
    listed = {name: size for name, size in megabytes.items() if size >= LISTED}
    lines = ["| distribution | MB | comes with |", "|---|---|---|"]
    for name, size in listed.items():
        others = [f"`{one}`" for one in by[name] if one != name]
        lines.append(f"| `{name}` | {size:.0f} | {'itself' if name in by[name] else ', '.join(others)} |")
    rest = {name: size for name, size in megabytes.items() if name not in listed}
    lines += [f"| {len(rest)} others | {sum(rest.values()):.0f} | |", f"| all | {sum(megabytes.values()):.0f} | |"]
    return "\n".join(lines)


def extras_table() -> str:
    """What each extra adds."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    base = sum(record["none"]["megabytes"].values())
    lines = ["| extra | adds, MB |", "|---|---|"]
    for extra, one in record.items():
        if extra != "none":
            lines.append(f"| `{extra}` | {sum(one['megabytes'].values()) - base:.0f} |")
    return "\n".join(lines)


def main(arguments: list[str]) -> None:
    if len(arguments) != 1:
        sys.exit("installed.py: give the name of the extra that is installed, or none")
    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    RECORD.write_text(json.dumps({**record, arguments[0]: measured()}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
