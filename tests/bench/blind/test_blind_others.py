"""Cases that somebody else made, and what is wrong with them."""

from pathlib import Path

import pytest

from gtpin.bench.blind.truth import given, take_in
from gtpin.bench.simulator.case import Case
from gtpin.data.description import describe, read_toml
from gtpin.errors import GtpinError
from gtpin.robot.library import load_robot


def test_cases_are_found_with_their_truths(cases: Path) -> None:
    found = given(cases)
    assert [place.name for place in found] == list("abcdefg")
    truths = list(found.values())
    assert [e.name for e in truths[5].effects] == ["linearity@cart1", "zero_shift@cart3"]
    assert truths[0].poses is not None
    assert len(truths[0].poses.pose) == 8
    assert truths[1].poses is None


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "no JSON"),
        ("{", "no JSON"),
        ("[" * 5000, "no JSON"),
        ("[]", "valid dictionary"),
        ("{}", "column effects: Field required"),
        ('{"effects": [{"site": "cart1"}]}', "effects.0.effect"),
        ('{"effects": [{"effect": "backlash", "site": 3}]}', "effects.0.site"),
        (
            '{"effects": [{"effect": "backlash", "site": "cart9"}]}',
            "backlash can't be at 'cart9'; use cart1, cart2, cart3",
        ),
        ('{"effects": [{"effect": "backlash"}]}', "backlash can't be at ''"),
        ('{"effects": [{"effect": "backlash", "site": "cart1", "energy": NaN}]}', "energy"),
        ('{"effects": [{"effect": "hose", "site": "x"}, {"effect": "hose", "site": "x"}]}', "there twice"),
    ],
)
def test_a_malformed_truth_is_named(cases: Path, content: str, says: str) -> None:
    (cases / "c.truth.json").write_text(content)
    with pytest.raises(GtpinError) as error:
        given(cases)
    assert "c.truth.json" in str(error.value)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_bytes_that_are_no_text_are_named(cases: Path) -> None:
    (cases / "c.truth.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(GtpinError, match=r"c\.truth\.json"):
        given(cases)


def test_datasets_and_truths_come_in_pairs(cases: Path, tmp_path: Path) -> None:
    (cases / "c.truth.json").rename(cases / "z.truth.json")
    with pytest.raises(GtpinError, match=r"c\.truth\.json: is missing"):
        given(cases)
    (cases / "c").rename(cases / "y")
    (cases / "y.truth.json").write_text('{"effects": []}')
    with pytest.raises(GtpinError, match=r"/z: is missing"):
        given(cases)
    (tmp_path / "empty").mkdir()
    with pytest.raises(GtpinError, match="no cases"):
        given(tmp_path / "empty")
    with pytest.raises(GtpinError, match="can't be read"):
        given(tmp_path / "nowhere")


def test_true_poses_are_those_of_the_commands(cases: Path) -> None:
    file = cases / "a.truth.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(GtpinError, match=r"a\.truth\.csv.*not in both"):
        given(cases)
    file.write_text("\n".join([*lines, lines[-1]]) + "\n")
    with pytest.raises(GtpinError, match="there twice"):
        given(cases)
    file.write_text("\n".join(lines).replace(",x,", ",u,"))
    with pytest.raises(GtpinError, match=r"a\.truth\.csv.*column x"):
        given(cases)
    file.write_text("\n".join(lines))
    (cases / "a" / "commands.csv").unlink()
    with pytest.raises(GtpinError, match=r"commands\.csv: the file is missing"):
        given(cases)


def test_a_dataset_takes_its_own_robot_along(tmp_path: Path, small: Case) -> None:
    source = tmp_path / "given"
    small.dataset.write(source / "a")
    (source / "a.truth.json").write_text('{"effects": []}')
    (source / "mine.urdf").write_text(load_robot("gantry_tau").description.xml)
    toml = source / "a" / "dataset.toml"
    toml.write_text(toml.read_text().replace('"gantry_tau"', '"../mine.urdf"'))
    (case,) = given(source)
    take_in(case, tmp_path / "place" / "a")
    (source / "mine.urdf").unlink()
    taken = describe(read_toml(tmp_path / "place" / "a" / "dataset.toml"))
    assert taken.robot == "robot.urdf"
    assert taken.instrument == small.dataset.instrument
    assert load_robot(tmp_path / "place" / "a" / taken.robot).sites == load_robot("gantry_tau").sites


def test_a_dataset_that_can_not_be_read_is_left_to_its_diagnosis(cases: Path, tmp_path: Path) -> None:
    (cases / "c" / "dataset.toml").write_text("nonsense")
    take_in(cases / "c", tmp_path / "c")
    assert (tmp_path / "c" / "dataset.toml").read_text() == "nonsense"
