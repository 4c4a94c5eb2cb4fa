"""What gtpin has not written is never replaced, deleted or written through: one line before any work, or moved aside."""

import json
import os
import shutil
from pathlib import Path

import pytest
from ran import refused

import gtpin
from gtpin.bench.simulator.case import make_case
from gtpin.errors import GtpinError

SCENARIO = Path(__file__).parents[2] / "examples" / "scenarios" / "backlash.toml"
FOLDERS = {
    "calibrate": ("calibration.json", "report.html", "report.txt", "model"),
    "diagnose": ("diagnosis.json", "report.html", "baseline", "model", "next_experiment"),
    "demo": ("dataset", "dataset.truth.json", "dataset.truth.csv", "calibration", "diagnosis.json", "model"),
    "compare": ("compare.csv", "compare.json", "report.html", "position_errors.png"),
    "sensitivity": ("sensitivity.csv", "accuracy.json", "report.html", "sensitivity.png", "map_position.png"),
    "simulate": ("dataset.toml", "poses.csv", "carts.csv", "commands.csv", "truth.csv"),
    "scenario": ("dataset.toml", "poses.csv", "commands.csv"),
    "blind": ("cases", "sealed", "check.json", "score.json", "score.html"),
}
"""By command, names in its output folder that a user may have in use."""
FILES = {"predict": "p.csv", "export": "robot.xml", "corrected": "q.csv", "view": "v.png"}
WORK = (
    "gtpin.commands.calibrate.run_calibration",
    "gtpin.commands.diagnose.run_diagnosis",
    "gtpin.bench.commands.demo.simulate_scenario",
    "gtpin.commands.compare.run_comparison",
    "gtpin.commands.sensitivity.analyse",
    "gtpin.bench.commands.simulate.run_simulation",
    "gtpin.bench.commands.simulate.simulate_scenario",
    "gtpin.commands.predict.run_prediction",
    "gtpin.extras.controllers.program.attempted",
    "gtpin.extras.view.command.gap_with_instruments",
    "gtpin.extras.view.still.still",
    "gtpin.bench.blind.run.spread",
)
"""What takes time."""


def arguments(command: str, source: Path, output: Path) -> list[object]:
    given = {
        "calibrate": ["calibrate", source],
        "diagnose": ["diagnose", source],
        "demo": ["demo"],
        "compare": ["compare", source],
        "sensitivity": ["sensitivity", "gantry_tau"],
        "simulate": ["simulate", "--poses", "12"],
        "scenario": ["simulate", "--scenario", SCENARIO, "--poses", "20"],
        "blind": ["blind", "--cases", "2"],
        "predict": ["predict", "gantry_tau", source / "commands.csv"],
        "export": ["export", "gantry_tau"],
        "corrected": ["export", "gantry_tau", "--commands", source / "commands.csv"],
        "view": ["view", "gantry_tau", source],
    }[command]
    return [*given, "-o", output]


@pytest.fixture
def no_work(monkeypatch):
    """Whatever takes time is a fault."""

    def worked(*_, **__):
        raise AssertionError("there was work before the refusal")

    for name in WORK:
        monkeypatch.setattr(name, worked)


def put(place: Path, kind: str, elsewhere: Path) -> None:
    """Something of a user's: a file, a folder with a file in it, or a link to a folder or to nowhere."""
    if kind == "file":
        place.write_text("mine")
    elif kind == "folder":
        place.mkdir()
        (place / "part.step").write_text("mine")
    elif kind == "link":
        place.symlink_to(elsewhere)
    else:
        place.symlink_to(elsewhere / "nowhere")


@pytest.mark.slow
@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", FOLDERS)
def test_a_folder_with_something_of_a_user_s_is_refused_before_any_work(source, tmp_path, command):
    elsewhere = tmp_path / "elsewhere"
    put(elsewhere, "folder", elsewhere)
    for name in FOLDERS[command]:
        for kind in ("file", "folder", "link", "dangling"):
            output = tmp_path / "out"
            output.mkdir()
            put(output / name, kind, elsewhere)
            error = refused(tmp_path, *arguments(command, source, output))
            assert str(output) in error
            assert "--force" in error
            shutil.rmtree(output)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", FILES)
@pytest.mark.parametrize("kind", ["file", "link", "dangling"])
def test_a_file_of_a_user_s_is_refused_before_any_work(source, tmp_path, command, kind):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("mine")
    put(tmp_path / FILES[command], kind, elsewhere)
    error = refused(tmp_path, *arguments(command, source, tmp_path / FILES[command]))
    assert FILES[command] in error
    assert "--force" in error


@pytest.mark.parametrize("changed", [False, True])
def test_the_truth_of_a_replaced_dataset_goes_with_it_unless_a_user_changed_it(run, source, tmp_path, tree, changed):
    output = tmp_path / "set"
    assert run(*arguments("scenario", source, output)).code == 0
    names = {"set.truth.json", "set.truth.csv"}
    assert names < set(tree(tmp_path))
    (tmp_path / "other.truth.json").write_text("mine")
    if changed:
        (tmp_path / "set.truth.json").write_text("mine")
    assert run("simulate", "-o", output, "--poses", "12").code == 0
    kept = {"set.truth.json"} if changed else set()
    assert names & set(tree(tmp_path)) == kept
    assert all((tmp_path / name).read_text() == "mine" for name in kept | {"other.truth.json"})


def test_the_truth_stays_where_the_new_dataset_fails(run, source, tmp_path):
    assert run(*arguments("scenario", source, tmp_path / "set")).code == 0
    refused(tmp_path, "simulate", "-o", tmp_path / "set", "--robot", "no_such_robot")


@pytest.mark.parametrize("command", ["predict", "corrected"])
def test_a_single_file_takes_no_place_of_a_dataset_s_but_by_force(run, source, tmp_path, tree, command):
    output = tmp_path / "set"
    assert run("simulate", "-o", output, "--poses", "12").code == 0
    before = tree(tmp_path)
    error = refused(tmp_path, *arguments(command, source, output / "poses.csv"))
    assert f"{output / 'poses.csv'}: this is a part of what another command wrote here" in error
    assert "--force" in error
    assert run(*arguments(command, source, output / "poses.csv"), "--force").code == 0
    after = tree(output)
    assert after["poses.csv.old-1"] == before["set/poses.csv"]
    assert after["poses.csv"] != before["set/poses.csv"]


def test_a_single_file_is_replaced_by_its_own_command_beside_a_dataset_too(run, source, tmp_path):
    output = tmp_path / "set"
    for _ in range(2):
        assert run("predict", "gantry_tau", source / "commands.csv", "-o", output / "p.csv").code == 0
    assert run("simulate", "-o", output, "--poses", "12").code == 0
    (tmp_path / "one.csv").write_text("pose,q1,q2,q3\na,0,0,0\n")
    for commands in (tmp_path / "one.csv", source / "commands.csv"):
        for name in ("p.csv", "q.csv"):
            assert run("predict", "gantry_tau", commands, "-o", output / name).code == 0
            assert len((output / name).read_text().splitlines()) == len(commands.read_text().splitlines())
    assert not list(output.glob("*.old-*"))


@pytest.mark.usefixtures("no_work")
def test_the_truth_beside_a_dataset_is_not_written_over_something_else(source, tmp_path):
    (tmp_path / "set.truth.json").write_text("mine")
    assert "set.truth.json" in refused(tmp_path, *arguments("scenario", source, tmp_path / "set"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["file", "folder", "link", "dangling"])
def test_force_moves_a_user_s_things_aside_and_keeps_them(run, source, tmp_path, tree, kind):
    output, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    put(elsewhere, "folder", elsewhere)
    output.mkdir()
    put(output / "model", kind, elsewhere)
    (output / "calibration.json").write_text("mine")
    (output / "calibration.json.old-1").write_text("older")
    (output / "notes.txt").write_text("mine")
    before = {name: content for name, content in tree(output).items() if name.startswith("model")}
    aimed = os.readlink(output / "model") if (output / "model").is_symlink() else None
    assert run("calibrate", source, "-o", output, "--force").code == 0
    after = tree(output)
    assert {name.replace("model.old-1", "model", 1) for name in after if name.startswith("model.old-1")} == set(before)
    for name, content in before.items():
        assert after[name.replace("model", "model.old-1", 1)] == content
    if aimed:
        assert os.readlink(output / "model.old-1") == aimed
    assert not (output / "model").is_symlink()
    assert gtpin.read_model(output).geometry.names
    assert [after[f"calibration.json{end}"] for end in (".old-1", ".old-2")] == [b"older", b"mine"]
    assert after["notes.txt"] == b"mine"
    assert tree(elsewhere) == {"part.step": b"mine"}
    assert run("calibrate", source, "-o", output).code == 0  # from now on it is gtpin's own


def test_force_moves_a_single_file_aside(run, source, tmp_path):
    (tmp_path / "p.csv").write_text("mine")
    assert run("predict", "gantry_tau", source / "commands.csv", "-o", tmp_path / "p.csv", "--force").code == 0
    assert (tmp_path / "p.csv.old-1").read_text() == "mine"
    assert (tmp_path / "p.csv").read_text().startswith("pose,x,y,z")


def test_what_a_user_changed_or_added_since_is_the_user_s(run, tmp_path):
    output = tmp_path / "set"
    assert run("simulate", "-o", output, "--poses", "10").code == 0
    with (output / "poses.csv").open("a") as table:
        table.write("\n")
    assert "poses.csv" in refused(tmp_path, "simulate", "-o", output, "--poses", "10")
    gtpin.write_model(gtpin.read_model("gantry_tau"), tmp_path / "whole" / "model")
    (tmp_path / "whole" / "model" / "notes.txt").write_text("mine")  # would go with its folder
    assert "notes.txt" in run("calibrate", output, "-o", tmp_path / "whole").failed()


def test_a_broken_marker_vouches_for_nothing(run, tmp_path):
    output = tmp_path / "set"
    assert run("simulate", "-o", output, "--poses", "10").code == 0
    for text in ("", "{}", "[]", '{"schema": "gtpin-output/1"}', '{"schema": "other", "entries": {}}', "{" * 100_000):
        (output / ".gtpin.json").write_text(text)
        refused(tmp_path, "simulate", "-o", output, "--poses", "10")


@pytest.mark.slow
def test_results_go_beside_a_user_s_measurements(run, dataset, tmp_path, tree):
    before = tree(dataset)
    assert run("calibrate", dataset, "-o", dataset).code == 0
    assert run("calibrate", dataset, "-o", dataset).code == 0
    after = tree(dataset)
    assert {name: after[name] for name in before if name != ".gtpin.json"} == {
        name: content for name, content in before.items() if name != ".gtpin.json"
    }
    assert "model/model.json" in after


def test_a_linked_output_folder_is_the_folder(run, tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "disk")
    for _ in range(2):
        assert run("simulate", "-o", tmp_path / "link", "--poses", "10").code == 0
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "disk" / "poses.csv").is_file()


@pytest.mark.parametrize("command", [*FOLDERS, *FILES])
def test_a_link_to_nowhere_is_no_folder_to_write_to(source, tmp_path, command):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    name = FILES.get(command, "")
    refused(tmp_path, *arguments(command, source, tmp_path / "link" / name))


@pytest.mark.parametrize("kind", ["null", "stdout"])
def test_a_device_is_never_replaced(run, source, kind):
    before = os.lstat(f"/dev/{kind}")
    error = run("predict", "gantry_tau", source / "commands.csv", "-o", f"/dev/{kind}").failed()
    assert "this is a device" in error
    assert os.path.samestat(os.lstat(f"/dev/{kind}"), before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_what_is_no_file_is_not_even_moved_aside(run, source, tmp_path):
    os.mkfifo(tmp_path / "p.csv")
    error = run("predict", "gantry_tau", source / "commands.csv", "-o", tmp_path / "p.csv", "--force").failed()
    assert "no file" in error
    assert (tmp_path / "p.csv").is_fifo()


@pytest.mark.parametrize("command", ["predict", "corrected"])
def test_what_is_read_is_not_written(run, tmp_path, command):
    assert run("simulate", "-o", tmp_path / "set", "--poses", "10").code == 0
    called = arguments(command, tmp_path / "set", tmp_path / "set" / "commands.csv")
    assert "this is read" in refused(tmp_path, *called)


def test_an_output_without_a_name_is_refused(run, source, tmp_path, tree, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in ("simulate", "calibrate", "predict", "export", "view", "demo", "blind"):
        assert "it is empty" in run(*arguments(command, source, "")).failed()
    assert tree(tmp_path) == {}


@pytest.mark.parametrize("output", [".", "..", "new/..", "~"])
def test_an_output_may_be_given_by_dots(run, tmp_path, monkeypatch, output):
    (tmp_path / "here" / "new").mkdir(parents=True)
    (tmp_path / "here" / "thesis.tex").write_text("mine")
    monkeypatch.chdir(tmp_path / "here")
    for _ in range(2):
        assert run("simulate", "-o", output, "--poses", "10").code == 0
    assert (Path(output) / "poses.csv").is_file()
    assert (tmp_path / "here" / "thesis.tex").read_text() == "mine"


def test_python_refuses_as_the_commands_do(tmp_path, tree):
    case = make_case(1, effects=[], poses=12, held_out=4, background=False)
    model = gtpin.read_model("gantry_tau")
    (tmp_path / "measured").mkdir()
    for name in ("measured/poses.csv", "commands.csv", "model.json"):
        (tmp_path / name).write_text("mine")
    before = tree(tmp_path)
    writers = {
        "measured": lambda **force: case.write(tmp_path, "measured", **force),
        "dataset": lambda **force: case.dataset.write(tmp_path / "measured", **force),
        "commands": lambda **force: case.commands.write(tmp_path / "commands.csv", **force),
        "model": lambda **force: gtpin.write_model(model, tmp_path, **force),
    }
    for write in writers.values():
        with pytest.raises(GtpinError, match="gtpin has not written this"):
            write()
    assert tree(tmp_path) == before
    for write in writers.values():
        write(force=True)
        write()
    for name in ("measured/poses.csv", "commands.csv", "model.json"):
        assert (tmp_path / f"{name}.old-1").read_text() == "mine"
        assert not (tmp_path / f"{name}.old-2").exists()


def test_every_folder_that_is_made_says_what_gtpin_wrote(calibrated):
    for folder in (calibrated, calibrated / "model"):
        told = json.loads((folder / ".gtpin.json").read_text())
        assert told["schema"] == "gtpin-output/1"
        assert set(told["entries"]) | {".gtpin.json"} == {path.name for path in folder.iterdir()}
