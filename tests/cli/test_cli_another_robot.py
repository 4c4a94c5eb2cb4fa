"""Every command that takes a model and measured data, or two models: those of one robot are accepted, of another refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import gtpin
from gtpin.bench.simulator.simulate import simulate

ROBOTS = ("ur5", "ur10")  # the joints have the same names and ranges


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For each robot a dataset, its commands, and a calibrated model."""
    folder = tmp_path_factory.mktemp("robots")
    for name in ROBOTS:
        found = simulate(gtpin.load_robot(name), name, poses=40, held_out=3)
        found.dataset.write(folder / name / "data")
        found.commands.write(folder / name / "commands.csv")
        gtpin.calibrate(found.dataset).save(folder / name / "model")
    return folder


COMMANDS = {
    "view": ("view", "{model}", "{data}", "-o", "{out}/gap.svg"),
    "certify": ("certify", "{data}", "--model", "{model}", "-o", "{out}"),
    "diagnose": ("diagnose", "{data}", "--against", "{model}", "-o", "{out}"),
    "calibrate": ("calibrate", "{data}", "--keep-effects", "{model}", "-o", "{out}"),
    "export": ("export", "{other}", "--commands", "{commands}", "--controller", "{model}", "-o", "{out}/q.csv"),
}


def words(command: str, made: Path, model: str, data: str, out: Path) -> list[str]:
    own = made / data
    places = {"model": made / model / "model", "data": own / "data", "other": own / "model"}
    return [word.format(**places, commands=own / "commands.csv", out=out) for word in COMMANDS[command]]


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_model_of_the_same_robot_is_accepted(run, made: Path, tmp_path: Path, command: str) -> None:
    done = run(*words(command, made, "ur5", "ur5", tmp_path))
    assert done.code == 0, done.err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_model_of_another_robot_is_refused_with_both_names(run, made: Path, tmp_path: Path, command: str) -> None:
    said = run(*words(command, made, "ur10", "ur5", tmp_path)).failed()
    assert "the model is of ur10" in said
    assert "of ur5" in said
    assert not list(tmp_path.iterdir())


def test_robots_of_one_name_with_other_drives_are_two(made: Path, tmp_path: Path, run) -> None:
    text = gtpin.robot.library.urdf_path("ur5").read_text(encoding="utf-8")
    (tmp_path / "ur5.urdf").write_text(text.replace("wrist_3_joint", "last_joint"), encoding="utf-8")
    said = run("view", tmp_path / "ur5.urdf", made / "ur5" / "data", "-o", tmp_path / "gap.svg").failed()
    assert "last_joint" in said
    assert "wrist_3_joint" in said
