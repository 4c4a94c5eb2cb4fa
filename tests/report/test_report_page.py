"""Pages as text: whole, escaped, honest about what they lack, the same each time."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from report_findings import text

import gtpin
from gtpin.data import Dataset
from gtpin.diagnosis.result import Experiment
from gtpin.report import page, sections
from gtpin.report.calibration import CalibrationPresentation
from gtpin.report.diagnosis import DiagnosisPresentation
from gtpin.report.figure import DATA, LIGHT, Drawing, Plot, PlotChoice, Shared
from gtpin.report.phrases import reason_words

KINDS = ["none", "explained", "ambiguous", "unknown"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_page_names_everything_that_a_diagnosis_says(findings, pages, kind):
    found, told = findings[kind], text(pages(kind)[0])
    for cause in found.causes:
        assert cause.effect in told  # the id, for --exclude
        for member in cause.members:
            assert found.effect(member.effect).title in told
        for name in cause.parameters:
            assert name.replace("_", " ") in told
    for candidate in found.candidates:
        assert found.effect(candidate.effect).title in told
        assert reason_words(candidate.reason, candidate.site) in told
    for pose in found.baseline.rejected:
        assert pose in told
    for name in found.baseline.names:
        assert name in told


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_below_two_megabytes_and_fetches_nothing(pages, kind):
    whole, _ = pages(kind)
    assert len(whole.encode()) < 2e6
    tags = re.sub(r"<script\b.*?</script>", "", whole, flags=re.S)
    assert not re.search(r"""(src|href)=["'](?!#|data:)""", tags)
    assert "@import" not in tags
    assert "url(" not in tags


@pytest.mark.slow
def test_text_of_others_is_escaped_everywhere(pages):
    whole, _ = pages("explained")
    assert "<script>alert(1)" not in whole
    assert "<b>#@$" not in whole
    blocks = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', whole, flags=re.S)
    assert len(blocks) > 5
    for block in blocks:
        json.loads(block)


@pytest.mark.slow
def test_the_same_diagnosis_makes_the_same_page(findings, pages):
    assert pages("explained")[0] == DiagnosisPresentation(findings["explained"]).page()


@pytest.mark.slow
def test_without_the_extra_a_page_has_its_words_tables_and_sketch_and_says_how_to_get_plots(findings, monkeypatch):
    monkeypatch.setattr(page, "plotly_js", lambda kinds: None)
    whole = DiagnosisPresentation(findings["explained"]).page()
    assert len(whole) < 2e5
    assert "pip install 'gtpin[plots]'" in text(whole)
    assert '<svg class="drawing"' in whole
    assert "--exclude: rack_periodic@cart2" in text(whole)
    assert "<script" not in whole


@pytest.mark.slow
def test_a_robots_name_is_text(findings, monkeypatch):
    found = findings["none"]
    monkeypatch.setattr(found.baseline.model.robot, "name", "<img src=x onerror=alert(1)>")
    assert "<img" not in DiagnosisPresentation(found).page()


@pytest.mark.slow
def test_digests_are_those_of_the_files_that_were_read(single, tmp_path):
    single.dataset.write(tmp_path / "data")
    told = text(DiagnosisPresentation(replace(single, dataset=Dataset.read(tmp_path / "data"), seed=42)).page())
    for name in ("dataset.toml", "poses.csv"):
        assert f"{name} sha256 {hashlib.sha256((tmp_path / 'data' / name).read_bytes()).hexdigest()}" in told
    assert "seed 42" in told
    assert str(tmp_path) not in told


@pytest.mark.slow
def test_a_next_experiment_is_told_with_its_commands(findings):
    found = findings["ambiguous"]
    step = Experiment(
        "discriminate",
        found.model.robot,
        (("rack_periodic", "cart2"), ("linearity", "cart2")),
        np.array([[0.1, 0.2, 0.3]]),
        {"payload": np.array([20.0]), "session": np.array(["next"], dtype=object)},
        expected_gain=4.25,
        random_gain=0.5,
        settles=0.62,
        rounds=2,
    )
    seen = text(DiagnosisPresentation(replace(found, next_experiment=(step,))).page())
    # On the first screen, and with its commands.
    assert seen.count("Measure these 1 poses to distinguish periodic drive error at cart2") == 2
    assert "q1 q2 q3 payload (kg) session 0.1000 0.2000 0.3000 20 next" in seen
    assert "4.2, compared with 0.5 for as many random poses." in seen
    assert "settles the question with a probability of 62 %. About 2 such measurements are needed" in seen


def test_a_proposal_is_made_only_where_it_is_worth_doing():
    places = (("linearity", "cart2"), ("rack_periodic", "cart2"))
    robot = gtpin.load_robot("gantry_tau")
    likely = Experiment("discriminate", robot, places, np.zeros((20, 3)), {}, settles=0.5, rounds=4)
    assert "settles the question with a probability of 50\u00a0%" in likely.measure
    assert "About 4 such measurements are needed" in likely.measure
    assert "such measurements" not in replace(likely, rounds=1).measure
    unlikely = replace(likely, settles=0.49).measure
    assert "%" not in unlikely
    assert unlikely.endswith("About 4 such measurements are needed.")
    hopeless = replace(likely, settles=0.0, rounds=None, watch=("cart2",)).measure
    assert hopeless.startswith(
        "Poses do not distinguish smooth drive error at cart2 from periodic drive error at cart2."
    )
    assert "a scale along the axis" in hopeless
    assert "%" not in hopeless
    joint = replace(
        likely, robot=gtpin.load_robot("ur5"), settles=0.0, rounds=None, watch=("elbow_joint", "forearm_link")
    )
    assert "an encoder at the joint" in joint.measure
    assert "forearm_link by targets at both ends" in joint.measure


@pytest.mark.slow
def test_poses_that_were_set_aside_are_listed_by_how_far_they_are_off(single):
    dataset = single.dataset.take(np.arange(90))
    position = dataset.position.copy()
    position[10, 2] += 3e-3
    bad = replace(dataset, position=position)
    with pytest.warns(gtpin.GtpinWarning, match="gross errors"):
        calibration = gtpin.calibrate(bad)
    told = text(CalibrationPresentation(calibration).page())
    assert re.search(rf"{re.escape(str(dataset.pose[10]))} {dataset.row[10]} (2\.9|3\.0)\d? mm", told)


@pytest.mark.slow
def test_many_poses_are_thinned_so_that_the_page_stays_small(single):
    many = single.dataset.take(np.tile(np.arange(len(single.dataset)), 12))
    size = len(DiagnosisPresentation(replace(single, dataset=many)).page().encode())
    assert size < 2e6


def resolved(value, shared: Shared):
    """A figure as the page's script reads it: with the shared parts in the place of references."""
    if isinstance(value, dict) and "bdata" in value:
        return np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"]).tolist()
    if isinstance(value, dict) and "ref" in value:
        return resolved(shared.parts[value["ref"]], shared)
    if isinstance(value, dict):
        return {name: resolved(one, shared) for name, one in value.items()}
    return [resolved(one, shared) for one in value] if isinstance(value, list) else value


def test_numbers_that_are_none_are_gaps_and_no_text_ends_a_script():
    made = Drawing([{"y": np.array([1.0, np.nan, np.inf])}], {"title": {"text": "</script><!--"}})
    shared = Shared()
    embedded = shared.embed(Plot("a", "a", lambda: made))
    written = str(embedded) + str(shared.json)
    assert "</script" not in written
    (drawn,) = json.loads(str(embedded))["figures"]
    assert resolved(drawn, shared)["data"][0]["y"] == [1.0, None, None]


def test_a_page_has_a_figure_for_each_combination_of_choices_and_every_array_once():
    layer, side = PlotChoice("layer", "", (("a", "A"), ("b", "B"))), PlotChoice("side", "", (("x", "X"), ("y", "Y")))
    common = np.arange(20.0)

    def draw(layer: str, side: str):
        own = {"a": 1.0, "b": 2.0}[layer] * common ** {"x": 1, "y": 2}[side]
        return Drawing([{"x": common, "y": own, "name": "line", "line": {"color": DATA}}])

    shared = Shared()
    embedded = shared.embed(Plot("p", "p", draw, (layer, side)))
    told = json.loads(str(embedded))
    assert told["follows"] == [["layer", 2], ["side", 2]]
    drawn = [resolved(one, shared)["data"][0]["y"][3] for one in told["figures"]]
    assert drawn == [3.0, 9.0, 6.0, 18.0]
    assert sum("bdata" in part for part in shared.parts) == 4  # y; x is as one of them


def test_a_page_finds_every_colour_of_its_figures_by_its_value():
    assert len(set(LIGHT.values())) == len(LIGHT)


@pytest.mark.slow
def test_a_function_of_the_list_is_a_section_at_its_place_of_every_page(single, monkeypatch):
    some = [*sections.SECTIONS]
    some.insert(6, lambda reported: page.Section("own", "My own", [f"{len(reported.dataset)} measurements"]))
    monkeypatch.setattr(sections, "SECTIONS", some)
    for reported in (CalibrationPresentation(single.baseline), DiagnosisPresentation(single)):
        found = [one.id for one in sections.sections(reported)]
        assert found[found.index("own") - 1 :][:3] == ["maps", "own", "covariates"]
        assert len(set(found)) == len(found)


def test_a_template_that_is_given_too_little_is_an_error_and_not_a_hole():
    with pytest.raises(Exception, match="undefined"):
        page._environment().get_template("report.html").render(title="nothing")


@pytest.mark.slow
def test_a_table_of_corrections_is_offered_for_a_sure_cause_alone(pages):
    assert "Tables that correct periodic drive error at cart2" in text(pages("explained")[0])
    assert "Tables that correct" not in text(pages("ambiguous")[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_first_screen_says_what_to_do_and_has_all_warnings(findings, kind):
    warned = replace(findings[kind], warnings=("the first", "the second"))
    screen = text(DiagnosisPresentation(warned).page().partition("<nav")[0])
    assert "What to do now" in screen
    assert "gtpin export DIR -o corrected.urdf" in screen
    assert "Warnings (2) the first the second" in screen


@pytest.mark.slow
def test_a_gap_larger_than_the_nominal_error_is_said_to_be_of_too_few_poses(findings):
    found = findings["none"]
    screen = text(DiagnosisPresentation(replace(found, gap=replace(found.gap, before=1.0))).page().partition("<nav")[0])
    assert "too few" in screen
    assert "gtpin export" not in screen
    assert "gtpin plan DIR --for calibration" in screen


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_drawing_of_a_page_is_a_figure_that_plotly_accepts(pages, kind):
    _, drawings = pages(kind)
    assert len(drawings) > 20
    for drawing in drawings:
        assert len(drawing.figure().data) == len(drawing.traces)  # plotly raises ValueError for what it does not know
