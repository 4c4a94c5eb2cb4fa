"""Frozen answers: equal ones differ in nothing, and each change beyond its tolerance is one line that names it."""

from __future__ import annotations

import copy
import json
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import gtpin
from gtpin.bench.blind.truth import digest_of_files
from gtpin.cli import app

FOLDER = Path(__file__).parents[2] / "examples" / "frozen"
sys.path.insert(0, str(FOLDER))

import differences  # noqa: E402  (the scripts of examples are no package)

Json = dict[str, Any]


def cause(name: str) -> Json:
    effect, _, site = name.partition("@")
    members = [{"effect": effect, "site": site, "probability": 0.9}, {"effect": "z", "site": site, "probability": 0.1}]
    size = {"value": 2e-5, "sigma": 1e-6, "unit": "m"}
    return {"effect": effect, "site": site, "probability": 0.9, "class": members, "parameters": {"size": size}}


def made_up() -> Json:
    """An answer as it is frozen, from made-up files."""
    gap = {
        "position_rms_before": 3e-5,
        "position_rms_after": 2e-5,
        "noise_floor": 1e-5,
        "shrinkage": 0.01,
        "method": "words",
    }
    by_instrument = {"probe": {"rms_before": 3e-5, "rms_after": 2e-5, "noise_floor": 1e-5, "unit": "m"}}
    diagnosis = {
        "verdict": "explained",
        "causes": [cause("backlash@cart1"), cause("linearity@cart2")],
        "gap": gap | {"by_instrument": by_instrument},
    }
    parameters = [{"name": f"length[{i}]", "value": 2.0, "sigma": 1e-4, "unit": "m"} for i in range(3)]
    calibration = {"chi2_per_dof": 1.25, "parameters": parameters}
    return {"diagnosis": differences.told(diagnosis), "calibration": differences.fitted(calibration)}


def changed(path: str, change: Callable[[Any], Any]) -> list[str]:
    """What differs where one value is changed; keys of ``path`` are separated by slashes, and None removes the value."""
    now = copy.deepcopy(made_up())
    *keys, last = (int(key) if key in ("0", "1") else key for key in path.split("/"))
    place: Any = now
    for key in keys:
        place = place[key]
    value = change(place[last])
    if value is None:
        del place[last]
    else:
        place[last] = value
    return list(differences.differences(made_up(), now))


CAUSE = "diagnosis/causes/backlash@cart1"
LENGTH = "calibration/parameters/length[2]"


def test_equal_answers_give_no_line() -> None:
    assert list(differences.differences(made_up(), json.loads(json.dumps(made_up())))) == []


@pytest.mark.parametrize(
    ("path", "change", "named"),
    [
        ("diagnosis/verdict", lambda _: "unknown", "verdict"),
        ("diagnosis/causes/linearity@cart2", lambda _: None, "causes"),
        (f"{CAUSE}/class/z@cart1", lambda _: None, "class of backlash@cart1"),
        (f"{CAUSE}/class/z@cart1", lambda p: p + 0.03, "class of backlash@cart1"),
        (f"{CAUSE}/probability", lambda p: p - 0.03, "probability and class of backlash@cart1"),
        (f"{CAUSE}/parameters/size/0", lambda value: value + 2e-9, "size"),
        (f"{CAUSE}/parameters/size/1", lambda sigma: sigma * 1.002, "size"),
        (f"{CAUSE}/parameters/size/0", lambda _: float("nan"), "size"),
        (f"{CAUSE}/parameters/size", lambda _: None, "names of parameters of backlash@cart1"),
        (f"{LENGTH}/0", lambda value: value + 2e-7, "length[2]"),
        (f"{LENGTH}/0", lambda value: value - 2e-7, "length[2]"),
        ("calibration/chi2_per_dof", lambda chi2: chi2 * 1.0002, "chi2_per_dof"),
        ("diagnosis/gap/noise_floor", lambda floor: floor * 0.9998, "gap noise_floor"),
        ("diagnosis/gap/probe.rms_after", lambda after: after * 1.0002, "gap probe.rms_after"),
        ("diagnosis/gap/shrinkage", lambda share: share + 2e-4, "gap shrinkage"),
        ("diagnosis/gap/shrinkage", lambda _: None, "gap shrinkage"),
        ("diagnosis", lambda _: {"refused": "too few rows"}, "too few rows"),
    ],
)
def test_a_change_is_one_line_that_names_it(path: str, change: Callable[[Any], Any], named: str) -> None:
    (line,) = changed(path, change)
    assert named in line


@pytest.mark.parametrize(
    ("path", "change"),
    [
        (f"{CAUSE}/class/z@cart1", lambda p: p + 0.01),
        (f"{CAUSE}/probability", lambda p: p - 0.01),
        (f"{CAUSE}/parameters/size/0", lambda value: value + 5e-10),
        (f"{LENGTH}/0", lambda value: value - 5e-8),
        (f"{LENGTH}/1", lambda sigma: sigma * 1.0005),
        ("calibration/chi2_per_dof", lambda chi2: chi2 * 1.00005),
        ("diagnosis/gap/position_rms_after", lambda after: after * 1.00005),
        ("diagnosis/gap/shrinkage", lambda share: share + 5e-5),
    ],
)
def test_a_change_within_its_tolerance_gives_no_line(path: str, change: Callable[[Any], Any]) -> None:
    assert changed(path, change) == []


def test_a_parameter_without_a_sigma_may_not_change() -> None:
    frozen, now = made_up(), made_up()
    frozen["calibration"]["parameters"]["length[0]"] = [2.0, 0.0]
    now["calibration"]["parameters"]["length[0]"] = [2.0 + 1e-15, 0.0]
    assert len(list(differences.differences(frozen, now))) == 1


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[Any, list[str]]]:
    """Exit code of a command of compare.py, and the lines that it prints."""
    monkeypatch.syspath_prepend(FOLDER)

    def command(*arguments: object) -> tuple[Any, list[str]]:
        monkeypatch.setattr(sys, "argv", ["compare.py", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(FOLDER / "compare.py"), run_name="__main__")
        told = capsys.readouterr()
        return ended.value.code, (told.out + told.err).splitlines()

    return command


def blind_check(root: Path, message: str | None = None) -> None:
    """A folder as ``gtpin blind`` writes it, of a dataset that can't be read; ``message``: with which it was refused."""
    files = {
        "dataset.toml": b'schema = "gtpin-dataset/1"\nrobot = "gantry_tau"\n',
        "poses.csv": b"pose,x\n1,nonsense\n",
    }
    case = root / "cases" / "case00000"
    case.mkdir(parents=True)
    for name, content in files.items():
        (case / name).write_bytes(content)
    (case / "truth.sha256").write_text("a seal is no part of a dataset", encoding="utf-8")
    if message is None:
        with pytest.raises(gtpin.GtpinError) as refused:
            gtpin.Dataset.read(root / "cases" / "case00000")
        message = str(refused.value).replace(str(case), "/tmp/elsewhere/dataset")
    digests = {"dataset": {"case00000": digest_of_files(files)}}
    check = {"cases": 1, "seed": 5, "robot": "gantry_tau", "instruments": "plane,tilt", "digests": digests}
    (root / "check.json").write_text(json.dumps(check), encoding="utf-8")
    (root / "score.json").write_text("{}", encoding="utf-8")
    (root / "seconds.txt").write_text("case00000 0.25\n", encoding="utf-8")
    (root / "diagnoses").mkdir()
    (root / "diagnoses" / "case00000.json").write_text(
        json.dumps({"diagnosis": None, "error": message}), encoding="utf-8"
    )


def test_a_frozen_check_answered_again_by_the_same_code_differs_in_nothing(tmp_path, run) -> None:
    blind_check(tmp_path / "mine")
    assert run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen", "--jobs", 1)[0] == 0
    code, lines = run("compare", tmp_path / "frozen", "--jobs", 1)
    assert (code, lines[-1]) == (0, "0 of 1 cases differ")
    assert "when frozen 0.2" in lines[-2]


def test_a_frozen_check_answered_otherwise_ends_with_1_and_names_the_case(tmp_path, run) -> None:
    blind_check(tmp_path / "mine", "the code said something else")
    run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen", "--jobs", 1)
    code, lines = run("compare", tmp_path / "frozen", "--jobs", 1)
    assert (code, lines[-1]) == (1, "1 of 1 cases differ")
    assert lines[0].startswith("mine/case00000  diagnosis: the code said something else -> ")


def test_datasets_that_are_not_there_are_asked_for_by_the_command_that_makes_them(tmp_path, run) -> None:
    blind_check(tmp_path / "mine")
    run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen", "--jobs", 1)
    (tmp_path / "frozen" / "mine.zip").unlink()
    code, (line,) = run("compare", tmp_path / "frozen")
    assert code == 2
    assert "gtpin blind -o mine --cases 1 --seed 5 --robot gantry_tau --instrument plane --instrument tilt" in line


def test_a_dataset_that_was_changed_is_not_frozen_and_answers_are_frozen_once(tmp_path, run) -> None:
    blind_check(tmp_path / "mine")
    assert run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen", "--jobs", 1)[0] == 0
    code, (line,) = run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen")
    assert code == 2
    assert "already" in line
    (tmp_path / "mine" / "cases" / "case00000" / "poses.csv").write_text("pose,x\n1,2.0\n", encoding="utf-8")
    code, (line,) = run("freeze", tmp_path / "mine", "-o", tmp_path / "other")
    assert code == 2
    assert "changed" in line
    assert not (tmp_path / "other").exists()


@pytest.mark.slow
@pytest.mark.study
def test_what_a_blind_check_wrote_is_frozen_and_differs_in_nothing(tmp_path, run) -> None:
    assert (
        CliRunner().invoke(app, ["blind", "-o", str(tmp_path / "mine"), "--cases", "1", "--seed", "3"]).exit_code == 0
    )
    assert run("freeze", tmp_path / "mine", "-o", tmp_path / "frozen", "--jobs", 1)[0] == 0
    code, lines = run("compare", tmp_path / "frozen", "--jobs", 1)
    assert (code, lines[-1]) == (0, "0 of 1 cases differ")
