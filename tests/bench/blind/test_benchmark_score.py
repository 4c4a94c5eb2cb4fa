"""Answers are scored as by hand, and wrong answers refused with their place."""

import json
from pathlib import Path

import pytest

from gtpin.bench.benchmark.answer import Answer, figures, score_answers, to_json
from gtpin.bench.benchmark.public_set import SCHEMA, Block, PublicSet, Published
from gtpin.bench.blind.truth import TrueEffect, TruePoses, Truth
from gtpin.errors import GtpinError

SIGMA = 1.5e-5
POSES = TruePoses(pose=("a", "b"), position=((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))


def truth(kind: str, *effects: tuple[str, str, float]) -> Truth:
    made = tuple(TrueEffect(effect=name, site=site, energy=energy) for name, site, energy in effects)
    return Truth.model_validate(
        {"kind": kind, "effects": made, "poses": POSES, "sigma": (SIGMA,) * 3 + (5e-5,) * 3},
    )


CASES = {
    "clear": (truth("one", ("backlash", "cart1", 500.0)), 400.0),
    "twin": (truth("one", ("linearity", "cart2", 100.0)), 20.0),
    "weak": (truth("power", ("backlash", "cart2", 5.0)), 4.0),
    "silent": (truth("none"), None),
    "foreign": (truth("unlisted", ("hose_drag", "platform", 900.0)), 300.0),
    "two": (truth("two", ("backlash", "cart1", 500.0), ("zero_shift", "cart3", 3.0)), None),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "truths").mkdir()
    (tmp_path / "answers").mkdir()
    for name, (one, _) in CASES.items():
        (tmp_path / "truths" / f"{name}.json").write_text(one.model_dump_json())
    return tmp_path


@pytest.fixture
def public() -> PublicSet:
    block = Block(name="x", robot="gantry_tau", cases=1, seed=0)
    cases = {name: Published(dataset="", truth="", leaves=leaves) for name, (_, leaves) in CASES.items()}
    return PublicSet(schema=SCHEMA, plant="", blocks=(block,), cases=cases)


def write(folder: Path, name: str, **keys: object) -> None:
    (folder / "answers" / f"{name}.json").write_text(json.dumps({"schema": "gtpin-answer/1", **keys}))


def cause(name: str, probability: float = 1.0, *others: str) -> dict[str, object]:
    effect, site = name.split("@")
    members = [dict(zip(("effect", "site"), other.split("@"), strict=True)) for other in others]
    return {"effect": effect, "site": site, "probability": probability, "class": members}


def scored(public: PublicSet, folder: Path) -> dict[str, float | None]:
    return {
        name: rate.value for name, rate in figures(score_answers(public, folder, folder / "answers").values()).items()
    }


def test_right_answers_reach_every_figure(public: PublicSet, folder: Path) -> None:
    off = [[SIGMA, SIGMA, SIGMA], [1.0 + SIGMA, 1.0 - SIGMA, 1.0 + SIGMA]]
    write(folder, "clear", causes=[cause("backlash@cart1")], positions=off)
    write(folder, "twin", causes=[cause("straightness@cart2", 0.6, "linearity@cart2")])
    write(folder, "weak")
    write(folder, "silent")
    write(folder, "foreign", unknown=True)
    write(folder, "two", causes=[cause("backlash@cart1")])
    found = scored(public, folder)
    assert found["one effect, E > 63: detected"] == 1.0
    assert found["one effect, E > 63: class holds the truth"] == 1.0
    assert found["one effect, E > 63: members of the classes"] == 1.5
    assert found["one effect, D > 63: strict"] == 1.0
    assert found["several effects: F1 of those with E > 63"] == 1.0
    assert found["no effect: silent"] == found["unlisted effect: unknown"] == 1.0
    assert found["all cases: a false cause with confidence"] == 0.0
    assert found["all cases: a false cause named"] == pytest.approx(1 / 6)
    assert found["error of prediction, units of the noise"] == pytest.approx(1.0)
    assert found["cases without an answer"] == 0.0


def test_wrong_answers_reach_none(public: PublicSet, folder: Path) -> None:
    for name in CASES:
        write(folder, name, causes=[cause("tracker_drift@frame", 0.97)])
    found = scored(public, folder)
    assert found["one effect, E > 63: detected"] == 1.0
    assert found["one effect, E > 63: class holds the truth"] == found["one effect, D > 63: strict"] == 0.0
    assert found["several effects: F1 of those with E > 63"] == found["no effect: silent"] == 0.0
    assert found["unlisted effect: a false cause with confidence"] == 1.0
    assert found["all cases: a false cause with confidence"] == found["all cases: a false cause named"] == 1.0


def test_a_missing_answer_is_wrong_wherever_it_is_counted(public: PublicSet, folder: Path) -> None:
    write(folder, "weak")
    found = scored(public, folder)
    assert found["one effect, E > 63: detected"] == found["no effect: silent"] == 0.0
    assert found["unlisted effect: unknown"] == 0.0
    assert found["cases without an answer"] == pytest.approx(5 / 6)
    assert to_json(score_answers(public, folder, folder / "answers"))["by_case"]["clear"]["verdict"] is None


def test_the_error_of_prediction_is_a_geometric_mean(public: PublicSet, folder: Path) -> None:
    for name, size in (("clear", 1.0), ("twin", 4.0)):
        d = size * SIGMA
        write(folder, name, positions=[[d, d, d], [1.0 + d, 1.0 + d, 1.0 + d]])
    assert scored(public, folder)["error of prediction, units of the noise"] == pytest.approx(2.0)


REPEATED = cause("backlash@cart1", 1.0, *["zero_shift@cart1"] * 100_000)
MANY = cause("backlash@cart1", 1.0, *(f"zero_shift@{i}" for i in range(100_000)))
NO_SITE = cause("backlash@cart1", 1.0, "zero_shift@cart1", "zero@cart2")


@pytest.mark.parametrize(
    ("keys", "place", "told"),
    [
        ({"positions": [[0.0, 0.0, 0.0]]}, "", "1 rows of 3 numbers in place of 2 of 3"),
        ({"causes": [cause("backlash@cart1"), cause("backlash@cart1")]}, "", "named twice"),
        ({"causes": [cause("backlash@cart1", 1.2)]}, "", "less than or equal to 1"),
        ({"verdict": "none"}, "", "Extra inputs"),
        ({"positions": [[0.0, 0.0, float("inf")]]}, "", "finite"),
        ({"causes": [cause("backlsh@cart1")]}, "causes.0.effect", "called 'backlsh'; did you mean backlash?"),
        ({"causes": [cause("backlash@cart4")]}, "causes.0.site", "can't be at 'cart4'; use cart1, cart2, cart3"),
        ({"causes": [NO_SITE]}, "causes.0.class.1.effect", "'zero'"),
        ({"causes": [REPEATED]}, "causes.0.class.1", "is named twice"),
        ({"causes": [MANY]}, "causes.0.class.0.site", "'0'"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_an_answer_that_is_none_is_refused_with_its_place(
    folder: Path, keys: dict[str, object], place: str, told: str
) -> None:
    block = Block(name="x", robot="gantry_tau", cases=1, seed=0)
    public = PublicSet(schema=SCHEMA, plant="", blocks=(block,), cases={"x-00": Published(dataset="", truth="")})
    (folder / "truths" / "x-00.json").write_text(CASES["silent"][0].model_dump_json())
    write(folder, "x-00", **keys)
    with pytest.raises(GtpinError) as refused:
        score_answers(public, folder, folder / "answers")
    assert "x-00.json" in str(refused.value)
    assert told in str(refused.value)
    assert not place or refused.value.column == place


def test_a_folder_without_answers_is_refused(public: PublicSet, folder: Path) -> None:
    with pytest.raises(GtpinError, match="no answers here"):
        score_answers(public, folder, folder / "answers")


def test_an_answer_reads_back_as_it_was_written(tmp_path: Path) -> None:
    answer = Answer.model_validate(
        {"causes": [cause("backlash@cart1", 0.9, "servo_lag@cart1")], "readings": {"wire": [[1.25]]}, "unknown": True}
    )
    answer.write(tmp_path / "a.json")
    assert Answer.read(tmp_path / "a.json") == answer
