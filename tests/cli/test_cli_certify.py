"""``gtpin certify``: what it writes and prints, for rods and arms, and how it refuses."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.extras.certificate.terms import DEFINITIONS

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A dataset, a model, and positions alone of an arm in a frame of its own."""
    made = tmp_path_factory.mktemp("certificate")
    case = make_case(51, effects=[], poses=60, held_out=10, background=False)
    case.dataset.write(made / "data")
    gtpin.calibrate(case.dataset).save(made / "model")
    noise = SimulatedNoise(orientations=False, free=True, free_target=True)
    arm = make_case(52, effects=[], poses=80, held_out=10, background=False, robot="ur5", noise=noise)
    arm.dataset.write(made / "arm")
    gtpin.calibrate(arm.dataset).save(made / "arm_model")
    return made


@pytest.fixture(scope="module")
def certified(run, folder):
    """What ``gtpin certify`` writes for the dataset and the model; not to be changed."""
    done = run("certify", folder / "data", "--model", folder / "model", "-o", folder / "o")
    assert done.code == 0, done.err
    assert str(folder / "o" / "certificate.html") in done.out
    return folder / "o"


def test_the_page_and_the_json_have_each_number_with_its_definition_or_why_it_is_blank(certified):
    assert sorted(f.name for f in certified.glob("[!.]*")) == ["certificate.html", "certificate.json", "model"]
    told = json.loads((certified / "certificate.json").read_text())
    assert told["schema"] == "gtpin-certificate/1"
    for number in told["quantities"]:
        assert (number["value"] is None) == bool(number["reason"]), number
        assert number["formula"]
        assert (number["poses"] > 0) == (number["value"] is not None)
    for row in told["budget"]["contributions"]:
        assert (row["standard_uncertainty"] is None) == bool(row["reason"]), row
    assert told["basis"] == "fitted"
    page = (certified / "certificate.html").read_text()
    assert "@media print" in page
    assert "What is blank" in page
    assert not re.search(r"\bnan\b|\bNone\b|\{have\}", page)
    assert {number["symbol"] for number in told["quantities"]} == set(DEFINITIONS)


def test_the_model_that_corrects_the_machine_is_beside_the_page_which_has_its_digest(folder, certified):
    digest = hashlib.sha256((certified / "model" / "model.json").read_bytes()).hexdigest()
    assert json.loads((certified / "certificate.json").read_text())["model"]["sha256"] == digest
    assert digest in (certified / "certificate.html").read_text()
    q = gtpin.Dataset.read(folder / "data").q
    one, given = gtpin.read_model(certified).predict(q), gtpin.read_model(folder / "model").predict(q)
    assert np.array_equal(one.T, given.T)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(run, folder, tmp_path):
    for name in ("a", "b"):
        done = run("certify", folder / "data", "--model", folder / "model", "-o", tmp_path / name, "--seed", 3)
        assert done.code == 0, done.err
    for file in ("certificate.json", "certificate.html"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_positions_of_an_arm_with_a_target_anywhere_are_certified_as_far_as_they_go(folder):
    dataset = gtpin.Dataset.read(folder / "arm")
    found = gtpin.certify(dataset, gtpin.read_model(folder / "arm_model"))
    assert found["AP_p_nominal_rms"].missing == "free_target"
    assert found["RP_a_pooled"].missing == "no_orientation"
    assert found["B_mean[elbow_joint]"].missing == "too_many_drives"
    assert "rx" not in found.to_json()["budget"]["expanded"]
    rows = {row.source: row for row in found.budget.rows}
    assert 0.0 < rows["model"].position < 1e-4
    assert found.to_dataframe().shape[0] == len(found.quantities)
    assert "Certificate of ur5" in repr(found)


def test_a_certificate_of_a_target_anywhere_says_that_it_is_not_of_the_tool(run, folder, certified, tmp_path):
    done = run("certify", folder / "arm", "--model", folder / "arm_model", "-o", tmp_path / "o")
    assert done.code == 0, done.err
    told, page = (json.loads((tmp_path / "o" / "certificate.json").read_text()), " ".join(done.out.split()))
    assert (told["point"], told["stands"]) == ("target", "fitted")
    assert "positions the measured target within" in page
    assert "apart from where the machine stands" in page
    assert any("and not the tool, tool0" in line for line in told["statement"])
    assert any("where it stands is not certified" in line for line in told["statement"])
    assert "its TCP" not in page[: page.index("What to do now")]
    known = json.loads((certified / "certificate.json").read_text())  # in the base frame, at the TCP
    assert (known["point"], known["stands"]) == ("tcp", "measured")
    assert not any("not the tool" in line or "where it stands" in line for line in known["statement"])


def test_what_is_blank_says_whether_the_user_has_to_fill_it_in_or_to_measure_it(certified):
    told = json.loads((certified / "certificate.json").read_text())
    rows = {row["source"]: row for row in told["budget"]["contributions"]}
    assert set(rows) == {"model", "repeatability", "unexplained", "instrument"}  # measured in the base frame
    assert sum(row["share"] or 0.0 for row in rows.values()) == pytest.approx(1.0)
    assert all((row["share"] or 0.0) >= 0.0 for row in rows.values())
    assert rows["instrument"]["state"]
    assert not rows["model"]["state"]
    page = (certified / "certificate.html").read_text()
    blank = page[page.index('id="blank"') :]
    fill_in, measure = (blank.index(words) for words in ("For you to fill in", "To be measured"))
    assert fill_in < blank.index("--instrument-uncertainty") < measure < blank.index("30 times")
    assert "For you to fill in" in page[: page.index("<nav")]


def test_data_that_support_no_number_are_refused(run, folder, tmp_path):
    """One visit of each pose, to which the model was fitted, with a target anywhere: nothing was tested."""
    arm = gtpin.Dataset.read(folder / "arm")
    once = arm.take(np.sort(np.unique(arm.pose, return_index=True)[1]))
    once = replace(once, covariates={})
    once.write(tmp_path / "once")
    gtpin.calibrate(once).save(tmp_path / "model")
    said = run("certify", tmp_path / "once", "--model", tmp_path / "model", "-o", tmp_path / "o").failed()
    assert "support no number of a certificate" in said
    assert not (tmp_path / "o").exists()


def test_readings_without_positions_are_one_line(run, tmp_path):
    made = run("simulate", "-o", tmp_path / "wire", "--instrument", "range", "--poses", 40)
    assert made.code == 0, made.err
    said = run("certify", tmp_path / "wire", "-o", tmp_path / "o").failed()
    assert "positions of one tracker" in said
    assert not (tmp_path / "o" / "certificate.json").exists()


def test_a_model_that_is_nominal_or_not_there_is_one_line_that_says_what_writes_one(run, folder, tmp_path):
    for model, words in (("gantry_tau", "nominal"), (tmp_path / "not_there", "not_there: no such folder")):
        assert words in (said := run("certify", folder / "data", "--model", model, "-o", tmp_path / "o").failed())
    assert "a folder that calibrate, diagnose or certify wrote" in said
