"""Makes the modules of examples/dressler2010 importable."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "dressler2010"

if not EXAMPLE.is_dir():
    collect_ignore_glob = ["test_*.py"]
else:
    pytest.importorskip("matplotlib")
    sys.path.append(str(EXAMPLE))
