"""Draws docs/report.png: the first screen of the report of ``gtpin demo --robot ur5``, in a browser (playwright, Chromium).

    python examples/pages/report_picture.py

The file also has the words of that screen, by which a test sees that the picture is of today's report.
"""

from __future__ import annotations

import html
import io
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, PngImagePlugin

PICTURE = Path(__file__).parents[2] / "docs" / "report.png"
WIDTH = 1100
"""Pixels."""
KEY = "words"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def demo(folder: Path) -> Path:
    """The report of the demo of an arm."""
    command = [sys.executable, "-m", "gtpin", "demo", "--robot", "ur5", "-o", str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "report.html"


def words(report: Path) -> str:
    """What the first screen says: from the page's title to its contents, a mark for each number."""
    text = report.read_text(encoding="utf-8")
    screen = text[text.index("<main") : text.index("<nav")]
    screen = re.sub(r"<(svg|script|style).*?</\1>", " ", screen, flags=re.DOTALL)
    plain = html.unescape(re.sub(r"<[^>]+>", " ", screen))
    return re.sub(r"\d+(?:\.\d+)?", "#", " ".join(plain.split()))


def shown() -> str:
    """The words that the picture was drawn with."""
    with Image.open(PICTURE) as image:
        return str(image.info[KEY])


def draw(report: Path) -> None:
    """Write the picture, in 200 colours."""
    from playwright.sync_api import sync_playwright

    browser = next(found for name in BROWSERS if (found := shutil.which(name)))
    with sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = launched.new_context(viewport={"width": WIDTH, "height": 900}, color_scheme="light").new_page()
        tab.goto(report.as_uri(), timeout=120_000.0)
        end = tab.locator("main nav").first.bounding_box()
        assert end is not None
        size = {"x": 0.0, "y": 0.0, "width": float(WIDTH), "height": end["y"] - 8.0}
        taken = tab.screenshot(clip=size, full_page=True)  # type: ignore[arg-type]
        launched.close()
    known = PngImagePlugin.PngInfo()
    known.add_text(KEY, words(report))
    Image.open(io.BytesIO(taken)).convert("P", palette=Image.Palette.ADAPTIVE, colors=200).save(
        PICTURE, pnginfo=known, optimize=True
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        draw(demo(Path(made) / "demo"))
