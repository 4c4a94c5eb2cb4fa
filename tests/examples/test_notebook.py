"""The notebook of the examples runs, and each of its cells shows a table or a figure."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "examples" / "calibrate_and_diagnose.ipynb"
nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
SHOWN = ("text/html", "application/vnd.plotly.v1+json")
LARGEST = 2_000
"""Letters of the text that a notebook has beside a table or figure."""


def test_each_cell_of_the_notebook_shows_a_table_or_a_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    monkeypatch.setenv("PYTHONPATH", path)
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(cells) > 5
    kinds = []
    for cell in cells:
        shown = [output for output in cell.outputs if output.output_type in ("execute_result", "display_data")]
        assert shown, cell.source
        data = shown[-1].data
        kinds.append(next((kind for kind in reversed(SHOWN) if kind in data), None))
        assert kinds[-1], cell.source
        assert len(data.get("text/plain", "")) < LARGEST, cell.source
        if kinds[-1] == "text/html":
            assert "<table" in data["text/html"], cell.source
    assert set(kinds) == set(SHOWN)
    assert (tmp_path / "diagnosis" / "report.html").is_file()
