"""A writer of small files."""

from __future__ import annotations

from pathlib import Path

import pytest
from printed import Write


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a text to a file of that name."""

    def write_(name: str, text: str) -> Path:
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return file

    return write_
