"""The page of the statistics names constants and files that exist, and its equations are right and set without a network."""

import html
import json
import re
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import gtpin
from gtpin.diagnosis import priors

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "statistics.md"
TEXT = PAGE.read_text(encoding="utf-8")
DERIVATION = TEXT.split("## Numbers that influence a verdict")[0]
NODE = shutil.which("node")
RENDERED = """
const folder = process.argv[1], shipped = require(folder + "/katex.min.js"), shown = [];
const options = (given) => ({...given, throwOnError: true, strict: "error"});
global.katex = {render: (source, element, given) => {
  shipped.renderToString(source, options(given));
  shown.push(given.displayMode);
}};
global.document = {querySelectorAll: () => JSON.parse(require("fs").readFileSync(0, "utf8"))};
require(folder + "/render.js");
console.log(JSON.stringify(shown));
"""
"""The page's own script, with elements in the place of a browser's: which equations are blocks. A wrong one is an error."""
NO_CONSTANTS = {"site", "none", "explained", "ambiguous", "unknown", "station"}
NO_CONSTANTS |= {"best_scales", "errors_beyond_noise", "least_sigma", "within_residuals"}
"""Words in code style that are values, columns or functions."""


def test_every_constant_that_the_page_names_is_in_priors() -> None:
    known = {field.name for field in fields(priors.Priors)} | {"SURE", "CLASS_SHARE"}
    prose = re.sub(r"^```.*?^```$", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    in_text = set(re.findall(r"`([A-Za-z_]+)`", prose)) - NO_CONSTANTS
    in_equations = {name.replace("\\_", "_") for name in re.findall(r"\\texttt\{([^}]+)\}", prose)}
    assert len(in_equations) > 8
    known |= {effect.id for effect in gtpin.catalogue()}
    assert in_text | in_equations <= known, (in_text | in_equations) - known


def test_every_prior_of_the_evidence_and_of_the_probabilities_is_on_the_page() -> None:
    names = [field.name for field in fields(priors.Priors)]
    first, last = names.index("scale_spread"), names.index("not_varied")
    missing = [n for n in names[first : last + 1] if n not in DERIVATION and n.replace("_", "\\_") not in DERIVATION]
    assert not missing


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built without a warning."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", ROOT / "docs/site/mkdocs.yml", "-d", folder]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return folder


def test_the_pages_build_without_a_warning_and_are_all_in_the_navigation(built: Path) -> None:
    told = (built / "python.html").read_text(encoding="utf-8")
    assert "Probability of naming a cause where there is none" in told


def test_the_site_sets_its_equations_with_files_of_its_own(built: Path) -> None:
    text = (built / "statistics.html").read_text(encoding="utf-8")
    loaded = re.findall(r'<(?:script|link)[^>]* (?:src|href)="([^"]+)"', text)
    assert {"katex/katex.min.css", "katex/katex.min.js", "katex/render.js"} <= set(loaded)
    assert [url for url in loaded if "://" in url and "canonical" not in url] == []
    assert [name for name in loaded if not (built / name).exists()] == []
    style = (built / "katex" / "katex.min.css").read_text(encoding="utf-8")
    fonts = set(re.findall(r"url\((fonts/[^)]+\.woff2)\)", style))
    assert fonts
    assert all((built / "katex" / font).exists() for font in fonts)
    assert "http" not in style


@pytest.mark.skipif(NODE is None, reason="there is no node")
def test_katex_sets_every_equation_of_the_built_page(built: Path) -> None:
    text = (built / "statistics.html").read_text(encoding="utf-8")
    marked = re.findall(r'<(span|div) class="arithmatex">(.*?)</\1>', text, re.DOTALL)
    assert len(marked) > 60
    elements = [{"tagName": tag.upper(), "textContent": html.unescape(source)} for tag, source in marked]
    ran = subprocess.run(
        [str(NODE), "-e", RENDERED, str(built / "katex")],
        input=json.dumps(elements),
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr[-600:]
    assert json.loads(ran.stdout) == [tag == "div" for tag, _ in marked]
