"""Prints pip's constraints for the lowest versions that pyproject.toml allows, of its requirements and of the extras named.

Usage: python lowest.py [EXTRA]...
"""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
extras = project["optional-dependencies"]
for line in (*project["dependencies"], *(line for name in sys.argv[1:] for line in extras[name])):
    name, _, bounds = line.partition(">=")
    if re.fullmatch(r"[\w.-]+(\[\w+\])?", name) and bounds:
        print(f"{name.partition('[')[0]}=={bounds.partition(',')[0]}")
