"""Draws the pictures of the gallery in docs/python.md: each example and notebook is run, and what it found is drawn.

    python examples/pages/gallery.py              # all, into docs/gallery
    python examples/pages/gallery.py own_effect   # one

A picture is a function of ``gallery_pictures``, of the name of the example, or of the notebook with ``_notebook`` after it. Its
docstring is the caption.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import runpy
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "gallery"
NOTEBOOK = "_notebook"


def sources() -> dict[str, Path]:
    """Scripts and notebooks by the names of their pictures."""
    scripts = sorted((ROOT / "examples").glob("*.py"))
    notebooks = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
    return {path.stem: path for path in scripts} | {f"{path.stem}{NOTEBOOK}": path for path in notebooks}


def pictures() -> dict[str, Callable[[dict[str, Any]], Any]]:
    """What draws each picture, from the variables of its example and from what it ``printed``."""
    import gallery_pictures  # matplotlib is not needed for the page

    return {
        name: function
        for name, function in vars(gallery_pictures).items()
        if getattr(function, "__module__", None) == gallery_pictures.__name__ and not name.startswith("_")
    }


def ran(path: Path) -> dict[str, Any]:
    """The variables of an example after it ran in an empty folder, and what it printed."""
    before, arguments, places, said = Path.cwd(), sys.argv, list(sys.path), io.StringIO()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), contextlib.redirect_stdout(said):
        warnings.simplefilter("ignore")
        try:
            os.chdir(folder)
            sys.argv, sys.path[:0] = [str(path)], [str(path.parent)]
            if path.suffix == ".py":
                found = runpy.run_path(str(path), run_name="__main__")
            else:
                cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
                code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
                found = {"__name__": "__main__"}
                exec(compile(code, str(path), "exec"), found)
        finally:
            os.chdir(before)
            sys.argv, sys.path[:] = arguments, places
    return {**found, "printed": said.getvalue()}


def draw(name: str, folder: Path = FOLDER) -> Path:
    """Draw a picture into a folder."""
    import matplotlib as mpl

    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gtpin", "font.size": 9.0}):
        figure = pictures()[name](ran(sources()[name]))
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})
    return folder / f"{name}.svg"


def page() -> str:
    """The gallery as the page has it: place and picture of each example."""
    captions = _captions()
    entries = []
    for name, path in sources().items():
        place = path.relative_to(ROOT).as_posix()
        entries.append(f"`{place}`\n\n![{captions[name]}](gallery/{name}.svg)\n")
    return "\n".join(entries).rstrip()


def _captions() -> dict[str, str]:
    """Captions of the pictures, read without matplotlib."""
    tree = ast.parse((Path(__file__).parent / "gallery_pictures.py").read_text(encoding="utf-8"))
    found = {node.name: ast.get_docstring(node) or "" for node in tree.body if isinstance(node, ast.FunctionDef)}
    return {name: " ".join(text.split()) for name, text in found.items() if not name.startswith("_")}


if __name__ == "__main__":
    for chosen in sys.argv[1:] or list(sources()):
        file = draw(chosen)
        print(f"{file.name:40s} {file.stat().st_size / 1024.0:.0f} kB", flush=True)
