"""The figures of docs/install.md: where the megabytes of an installation are.

    python -m venv fresh && fresh/bin/pip install . && fresh/bin/python examples/pages/installed.py none
    python -m venv other && other/bin/pip install ".[plots]" && other/bin/python examples/pages/installed.py plots

measures the environment that runs it, and records it under the name of the extra; ``none`` is the package without extras.
"""

from __future__ import annotations

import json
import re
import sys
from importlib import metadata
from pathlib import Path

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "installed.json"
LARGEST = 4
"""Number of distributions that the page names."""
MEGABYTE = 1e6
NOT_OURS = ("gtpin", "pip", "setuptools")


def name_of(distribution: str) -> str:
    """The name as registries compare it."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


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
    """Sizes in this environment."""
    found = sorted(sizes().items(), key=lambda item: -item[1])
    return {"python": sys.version.split()[0], "megabytes": {name: round(size, 1) for name, size in found}}


def table() -> str:
    """The base installation, and its largest distributions."""
    megabytes = json.loads(RECORD.read_text(encoding="utf-8"))["none"]["megabytes"]
    largest = sorted(megabytes.items(), key=lambda item: -item[1])[:LARGEST]
    named = ", ".join(f"`{name}` {size:.0f}" for name, size in largest)
    return f"In all {sum(megabytes.values()):.0f} MB, among them {named}."


def extras_table() -> str:
    """What each extra adds."""
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    base = sum(record["none"]["megabytes"].values())
    added = {extra: sum(one["megabytes"].values()) - base for extra, one in record.items() if extra != "none"}
    return f"Extras add: {', '.join(f'`{extra}` {size:.0f}' for extra, size in added.items())} MB."


def main(arguments: list[str]) -> None:
    if len(arguments) != 1:
        sys.exit("installed.py: give the name of the extra that is installed, or none")
    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    RECORD.write_text(json.dumps({**record, arguments[0]: measured()}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
