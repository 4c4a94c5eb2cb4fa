"""Pages in a real browser, without a network: they load, draw, follow dark and print, and fit a phone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from browsers import DRAWN, MISSING, Opened, launched

from gtpin.report import page as page_module
from gtpin.report.calibration import CalibrationPresentation
from gtpin.report.diagnosis import DiagnosisPresentation

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(MISSING), reason=MISSING)]
KINDS = ("none", "explained", "unknown", "calibration")
INK = "getComputedStyle(document.body).color"
TICKS = "getComputedStyle(document.querySelector('.plot .xtick text')).fill"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as found:
        yield found


@pytest.fixture(scope="module")
def opened(browser, findings, pages, tmp_path_factory) -> Callable[[str], Opened]:
    """Each page, opened once."""
    folder, known = tmp_path_factory.mktemp("pages"), {}

    def open_(kind: str) -> Opened:
        if kind not in known:
            page = (
                CalibrationPresentation(findings["none"].baseline).page() if kind == "calibration" else pages(kind)[0]
            )
            known[kind] = Opened(browser, folder / f"{kind}.html", page)
        return known[kind]

    return open_


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_loads_without_an_error_or_a_request_and_its_plots_have_data(opened, kind):
    page = opened(kind)
    assert len(page.run(DRAWN)) > 8
    page.is_whole()


def test_nothing_is_wider_than_a_phone(opened):
    page = opened("explained")
    page.tab.set_viewport_size({"width": 375, "height": 700})
    assert page.becomes("document.documentElement.scrollWidth <= 375")
    page.tab.set_viewport_size({"width": 1200, "height": 900})


def test_plots_and_page_follow_a_change_to_dark_and_are_printed_light(opened):
    page = opened("explained")
    light = page.run(INK)
    assert page.run(TICKS) == light
    page.tab.emulate_media(color_scheme="dark")
    assert page.becomes(f"{INK} != '{light}' && {TICKS} == {INK}")
    page.tab.emulate_media(media="print")
    assert page.becomes(f"{TICKS} == '{light}' && {INK} == '{light}'")
    assert page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.run("getComputedStyle(document.querySelector('nav')).display") == "none"
    page.tab.emulate_media(media="screen", color_scheme="light")
    assert page.becomes(f"{TICKS} == '{light}'")
    assert page.said == []


def test_what_the_reader_chooses_changes_all_plots_that_ask_for_it(opened):
    page = opened("explained")
    shown = "document.getElementById('plot-against-q2')._fullData[0].y.slice(0, 5).join()"
    before = page.run(shown)
    page.tab.locator("select[data-choice=layer]").first.select_option("after")
    after = page.run(shown)
    assert after != before
    assert set(page.run("[...document.querySelectorAll('select[data-choice=layer]')].map(s => s.value)")) == {"after"}
    page.tab.locator("select[data-choice=component]").select_option("z")
    assert page.run(shown) not in (before, after)
    assert page.said == []


def test_legends_of_curves_show_points_and_the_effect_on_its_band(opened):
    page = opened("explained")
    legend = page.run(
        "[...document.querySelectorAll('#plot-cause-1-0 .legend .traces')].map((entry) => [entry.textContent,"
        " !!entry.querySelector('.legendpoints path'), !!entry.querySelector('.legendlines path.js-line'),"
        " !!entry.querySelector('.legendfill path.js-fill')])"
    )
    assert legend == [["effect, 95 % band", False, True, True], ["measured", True, False, False]]


def test_minus_signs_are_the_same_in_tables_and_plots(opened):
    page = opened("explained")
    told = page.run("[...document.querySelectorAll('td, li, .plot text')].map(cell => cell.textContent)")
    assert [text for text in told if re.search(r"(^|[\s(=])-\.?\d|\de[+-]\d", text)] == []
    assert any("−" in text for text in told)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_table_that_is_cut_off_has_a_shadow_at_the_edge_behind_which_there_is_more(opened, scheme):
    page = opened("explained")
    page.tab.emulate_media(color_scheme=scheme)
    page.tab.set_viewport_size({"width": 375, "height": 700})
    wide = page.tab.locator("main > .wide").first  # the causes
    assert wide.evaluate("(table) => table.scrollWidth > table.clientWidth")
    box = wide.bounding_box()
    darkest = {}
    for end, left in (("left", 0), ("right", 10000)):
        wide.evaluate("(table, left) => { table.scrollLeft = left }", left)
        wide.scroll_into_view_if_needed()
        box = wide.bounding_box()
        # The last pixels of the page's width there, below the last row: no text.
        clip = {"x": box["x"] + box["width"] - 2, "y": box["y"] + box["height"] - 3, "width": 2, "height": 2}
        darkest[end] = page.tab.screenshot(clip=clip)
    assert darkest["left"] != darkest["right"]
    page.tab.set_viewport_size({"width": 1200, "height": 900})
    page.tab.emulate_media(color_scheme="light")


def test_hostile_names_are_shown_as_they_are(opened):
    page = opened("explained")
    names = page.run("JSON.parse(document.getElementById('shared').textContent).parts.flat()")
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in names
    assert page.run("document.querySelectorAll('script:not([data-plot]):not(#shared)').length") == 2
    assert page.said == []


def test_a_page_without_plots_loads_without_an_error(browser, findings, tmp_path, monkeypatch):
    monkeypatch.setattr(page_module, "plotly_js", lambda kinds: None)
    page = Opened(browser, tmp_path / "plain.html", DiagnosisPresentation(findings["explained"]).page())
    page.tab.set_viewport_size({"width": 375, "height": 700})
    assert page.said == []
    assert page.run("document.documentElement.scrollWidth") <= 375
    assert page.run("document.querySelector('svg.drawing').getBoundingClientRect().width") > 200
