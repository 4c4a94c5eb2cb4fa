"""The site is built without a warning, says what the docstrings say, and needs no network and no server."""

import html
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from browsers import MISSING, SLOW, launched

import gtpin

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
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
    text = (built / "reference" / "diagnosis.html").read_text(encoding="utf-8")
    assert "Probability of naming a cause where there is none" in text


def test_every_public_name_is_on_a_page_of_the_reference(built: Path) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (built / "reference").glob("*.html"))
    documented = set(re.findall(r'id="gtpin\.([\w.]+)"', text))
    names = {name for name in gtpin.__all__ if not name.startswith("_")}
    homes = {gtpin._HOME[name].removeprefix("gtpin.") + f".{name}": name for name in names}
    assert names - documented - {homes[path] for path in documented & homes.keys()} == set()


def test_every_effect_s_docstring_is_in_its_section(built: Path) -> None:
    text = (built / "effects.html").read_text(encoding="utf-8")
    sections = re.split(r'<a id="(\w+)"></a>', text)
    shown = dict(zip(sections[1::2], sections[2::2], strict=True))
    assert [
        e.id for e in gtpin.catalogue() if "Typical size" not in shown[e.id] or "Parameters: " not in shown[e.id]
    ] == []


def plain(markup: str) -> str:
    """Text of HTML without spaces and with one kind of quotes."""
    return re.sub(r"\s", "", html.unescape(re.sub(r"<[^>]+>", "", markup))).replace("'", '"')


def test_each_parameter_has_the_type_that_its_signature_gives(built: Path) -> None:
    object_ = (
        r'class="doc-signature highlight"><pre><span></span><code>(.*?)</code></pre>(.*?)(?=class="doc-signature|\Z)'
    )
    row = r'<tr class="doc-section-item">\s*<td>(.*?)</td>\s*<td>(.*?)</td>'
    checked, wrong = 0, []
    for page in (built / "reference").glob("*.html"):
        for signature, body in re.findall(object_, page.read_text(encoding="utf-8"), re.DOTALL):
            for table in re.findall(r'title">Parameters:</span></p>\s*<table>(.*?)</table>', body, re.DOTALL):
                for name, kind in (map(plain, cells) for cells in re.findall(row, table, re.DOTALL)):
                    checked += 1
                    found = re.search(rf"[(,*]{name.lstrip('*')}:{re.escape(kind)}", plain(signature))
                    wrong += [] if found else [(page.name, name, kind)]
    assert checked > 100
    assert wrong == []


def test_no_role_of_restructuredtext_is_left_in_the_pages(built: Path) -> None:
    role = re.compile(r":(?:class|func|meth|attr|mod|data|exc|obj|ref|doc|term|py:\w+):")
    assert [page.name for page in built.rglob("*.html") if role.search(page.read_text(encoding="utf-8"))] == []


@pytest.mark.skipif(bool(MISSING), reason=MISSING)
def test_the_search_finds_in_files_without_a_server(built: Path) -> None:
    with launched() as browser:
        tab = browser.new_context(offline=True).new_page()
        asked: list[str] = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto((built / "reference" / "robot.html").as_uri())
        tab.fill("input.md-search__input", "backlash")
        tab.wait_for_selector(".md-search-result__item", timeout=SLOW)
        found = [link.get_attribute("href") for link in tab.query_selector_all(".md-search-result__link")]
    assert any(link.split("?")[0].endswith("/effects.html") for link in found)
    assert [url for url in asked if not url.startswith("file:")] == []


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
