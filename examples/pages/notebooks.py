"""Runs the notebooks and stores what they show, figures as PNG, drawn in a browser (playwright, Chromium).

python examples/pages/notebooks.py       # all
python examples/pages/notebooks.py arm   # one
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import nbclient
import nbformat

ROOT = Path(__file__).parents[2]
NOTEBOOKS = {path.stem: path for path in sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))}
PLOTLY, PNG = "application/vnd.plotly.v1+json", "image/png"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = {"width": 760, "height": 430}
"""Pixels of a figure."""


def executed(path: Path, claims: str = "") -> Any:
    """The notebook after it ran in an empty folder; ``claims``: code that runs in its kernel at the end."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = list(notebook.cells)
    notebook.cells.append(nbformat.v4.new_code_cell(claims))
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "notebooks"
        folder.mkdir()
        (Path(made) / "real").symlink_to(ROOT / "examples" / "real")
        client = nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}})
        client.execute(env={**os.environ, "PYTHONPATH": paths})
    notebook.cells = cells
    return notebook


def code_cells(notebook: Any) -> list[Any]:
    """The cells with code."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def store(path: Path, png: Callable[[Any], str]) -> None:
    """Run a notebook and write it with its outputs: text and tables as they are, figures as ``png`` draws them."""
    notebook = executed(path)
    for number, cell in enumerate(code_cells(notebook), start=1):
        cell.execution_count, cell.metadata = number, {}
        for output in cell.outputs:
            if "execution_count" in output:
                output.execution_count = number
            output.metadata = {}
            figure = output.data.pop(PLOTLY, None)
            if figure is not None:
                output.data = nbformat.from_dict({PNG: png(figure)})
    nbformat.write(notebook, path)


@contextlib.contextmanager
def drawing() -> Iterator[Callable[[Any], str]]:
    """What draws a plotly figure in a browser: a PNG of few colours, in base64."""
    from PIL import Image
    from playwright.sync_api import sync_playwright
    from plotly.offline import get_plotlyjs

    browser = next(found for name in BROWSERS if (found := shutil.which(name)))
    with sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        tab = launched.new_context(viewport=SIZE, color_scheme="light").new_page()  # type: ignore[arg-type]
        tab.set_content("<body style='margin:0'><div id='figure'></div></body>")
        tab.add_script_tag(content=get_plotlyjs())

        def png(figure: Any) -> str:
            layout = {**figure["layout"], **SIZE}
            text = json.dumps([figure["data"], layout])
            tab.evaluate(f"async () => {{ await Plotly.newPlot('figure', ...{text}, {{staticPlot: true}}); }}")
            image, small = Image.open(io.BytesIO(tab.screenshot())), io.BytesIO()
            image.convert("P", palette=Image.Palette.ADAPTIVE, colors=64).save(small, "PNG", optimize=True)
            return base64.b64encode(small.getvalue()).decode()

        yield png
        launched.close()


if __name__ == "__main__":
    with drawing() as draw:
        for chosen in sys.argv[1:] or NOTEBOOKS:
            store(NOTEBOOKS[chosen], draw)
            print(f"{chosen:30s} {NOTEBOOKS[chosen].stat().st_size / 1024.0:.0f} kB", flush=True)
