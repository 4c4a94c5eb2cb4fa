"""The picture of README and docs is of the report that the demo writes today."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

report_picture = pytest.importorskip("report_picture", reason="pillow is not installed")


def test_readme_and_the_pages_show_the_picture() -> None:
    for page in ("README.md", "docs/index.md", "docs/report.md"):
        assert "report.png)" in (ROOT / page).read_text(encoding="utf-8"), page
    assert report_picture.PICTURE.stat().st_size < 150_000


@pytest.mark.slow
def test_the_picture_says_what_the_report_of_the_demo_says(tmp_path: Path) -> None:
    said = report_picture.words(report_picture.demo(tmp_path / "demo"))
    assert said == report_picture.shown(), "draw it anew: python examples/pages/report_picture.py"
