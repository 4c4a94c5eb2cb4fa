"""Every wrong input of the contract's table: exit code 2, one line, no traceback, nothing left behind."""

import json
import os
import shutil
import sys

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ran import refused

import gtpin
from gtpin.errors import ConvergenceError

FAR_APART = (1.9, -1.9, 0.0)
"""Within a width of the range, but no posture closes the loops there."""


def spoil(dataset, column, row, value):
    frame = pd.read_csv(dataset / "poses.csv", dtype=str)
    frame.loc[row, column] = value
    frame.to_csv(dataset / "poses.csv", index=False)


def numbers(dataset, change):
    frame = pd.read_csv(dataset / "poses.csv", dtype={"pose": str})
    change(frame)
    frame.to_csv(dataset / "poses.csv", index=False)


def scaled(columns, factor):
    def change(frame):
        frame[columns] *= factor

    return lambda d: numbers(d, change)


def moved(*order):
    """Columns of the quaternion in another order."""

    def change(frame):
        frame[["qw", "qx", "qy", "qz"]] = frame[list(order)].to_numpy()

    return lambda d: numbers(d, change)


def text(name, change):
    return lambda d: (d / name).write_text(change((d / name).read_text()))


def toml(old, new):
    return text("dataset.toml", lambda t: t.replace(old, new) if old else t + new)


def csv(change):
    return text("poses.csv", change)


WRONG = {
    "no folder": (shutil.rmtree, "set: the folder does not exist"),
    "no poses": (lambda d: (d / "poses.csv").unlink(), "poses.csv"),
    "toml that is none": (text("dataset.toml", lambda _: "schema = \n"), "dataset.toml, row 1"),
    "unknown robot": (toml('robot = "gantry_tau"', 'robot = "gantry_mu"'), "gantry_mu"),
    "a urdf that is not there": (toml('robot = "gantry_tau"', 'robot = "../machine.urdf"'), "machine.urdf"),
    "unknown tolerance": (toml("", "\n[tolerance]\nbelt = 1e-3\n"), "belt"),
    "text": (lambda d: spoil(d, "x", 3, "about 1"), "row 5, column x"),
    "too few rows": (csv(lambda t: "\n".join(t.split("\n")[:3]) + "\n"), "degrees of freedom"),
    "command far outside": (lambda d: spoil(d, "q2", 5, "4.5"), "row 7, column q2"),
    "commands in millimetres": (scaled(["q1", "q2", "q3"], 1000.0), "millimetres"),
    "positions in millimetres": (scaled(["x", "y", "z"], 1000.0), "millimetres"),
    "xyzw": (moved("qx", "qy", "qz", "qw"), "xyzw"),
    "semicolons, decimal commas": (csv(lambda t: t.replace(",", ";").replace(".", ",")), "separated by ';'"),
    "quaternion norm": (lambda d: spoil(d, "qw", 4, "0.9"), "row 6"),
}
"""One of each kind; tests/data has all mistakes in the files of a dataset."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", WRONG)
def test_wrong_datasets_are_refused_in_one_line_that_names_the_place(dataset, tmp_path, kind):
    change, named = WRONG[kind]
    change(dataset)
    error = refused(tmp_path, "calibrate", dataset, "-o", tmp_path / "deep" / "down" / "out")
    assert named in error
    assert str(tmp_path) in error  # the file or folder


def test_a_dataset_given_as_its_file_is_refused(run, dataset, tmp_path):
    assert "this is a file" in run("calibrate", dataset / "poses.csv", "-o", tmp_path / "out").failed()


COMMANDS = {
    "missing file": (None, "c.csv"),
    "too many commands": ("pose,q1,q2,q3,q4\na,0,0,0,0\n", "q4"),
    "text": ("pose,q1,q2,q3\na,0,zero,0\n", "row 2, column q2"),
    "millimetres": ("pose,q1,q2,q3\na,100,200,300\nb,-100,30,20\n", "millimetres"),
    "far outside": ("pose,q1,q2,q3\na,0,0,0\nb,0,0,2.5\n", "row 3, column q3"),
}


@pytest.mark.parametrize("kind", COMMANDS)
def test_wrong_commands_are_refused_in_one_line_that_names_the_place(tmp_path, kind):
    content, named = COMMANDS[kind]
    if content is not None:
        (tmp_path / "c.csv").write_text(content)
    error = refused(tmp_path, "predict", "gantry_tau", tmp_path / "c.csv", "-o", tmp_path / "deep" / "p.csv")
    assert named in error


@pytest.mark.parametrize("model", ["gantry_mu", "nowhere.urdf", "no/folder", "", "empty", "broken", "text.urdf"])
def test_a_model_that_is_none_is_refused(run, source, tmp_path, model, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "model.json").write_text('{"schema": "gtpin-model/1"')
    (tmp_path / "text.urdf").write_text("no robot")
    error = run("predict", model, source / "commands.csv", "-o", "p.csv").failed()
    assert model in error
    assert not (tmp_path / "p.csv").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["calibrate"],
        ["export"],
        ["calibrate", "set"],
        ["calibrate", "set", "-o"],
        ["predict", "gantry_tau", "-o", "p.csv"],
        ["simulate", "-o", "s", "--poses", "0"],
        ["simulate", "-o", "s", "--poses", "many"],
        ["simulate", "-o", "s", "--seed", "-1"],
        ["simulate", "-o", "s", "--robot", "gantry_mu"],
        ["simulate", "-o", "s", "--robot", "no/such.urdf"],
        ["polish"],
        ["--gloss"],
    ],
    ids=" ".join,
)
def test_a_wrong_command_line_is_refused_in_one_line(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    refused(tmp_path, *arguments)


@pytest.mark.parametrize("command", ["diagnose", "export", "benchmark score"])
def test_a_wrong_command_line_is_told_of_the_help_of_its_own_command(run, command):
    assert f" {command} --help)" in run(*command.split()).failed()


# ------------------------------------------------------------------------------------------------------- warnings


def warned(ran):
    assert ran.code == 0, ran.err
    lines = ran.err.splitlines()
    assert lines
    assert all(line.startswith("gtpin: warning: ") for line in lines)
    return ran.err


def test_a_command_a_little_outside_the_range_is_warned_of(run, dataset, tmp_path):
    (tmp_path / "c.csv").write_text("pose,q1,q2,q3\nfine,0,0,0\nout,0.72,0.6,0.6\n")
    told = warned(run("predict", "gantry_tau", tmp_path / "c.csv", "-o", tmp_path / "p.csv"))
    assert "out" in told
    assert len(pd.read_csv(tmp_path / "p.csv")) == 2


@pytest.mark.slow
def test_a_pose_that_can_t_be_reached_is_set_aside_by_name(run, dataset, tmp_path):
    assert not gtpin.read_model("gantry_tau").predict([FAR_APART]).reached.any(), "choose another pose"
    frame = pd.read_csv(dataset / "poses.csv", dtype={"pose": str})
    lost = frame.iloc[[0]].copy()
    lost["pose"] = "lost"
    lost[["q1", "q2", "q3"]] = FAR_APART
    pd.concat([frame, lost]).to_csv(dataset / "poses.csv", index=False)
    assert "lost" in warned(run("calibrate", dataset, "-o", tmp_path / "out"))
    told = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert told["rejected"] == ["lost"]
    assert told["poses"] == len(frame)
    assert "lost" in (tmp_path / "out" / "report.txt").read_text()


def test_predict_names_the_row_of_a_pose_that_can_t_be_reached(tmp_path):
    row = ",".join(map(str, FAR_APART))
    (tmp_path / "c.csv").write_text(f"pose,q1,q2,q3\na,0,0,0\nlost,{row}\nb,0,0,0.1\n")
    error = refused(tmp_path, "predict", "gantry_tau", tmp_path / "c.csv", "-o", tmp_path / "deep" / "p.csv")
    assert "c.csv, row 3" in error
    assert "lost" in error


def test_gross_errors_are_named_in_a_warning_and_in_the_result(run, dataset, tmp_path):
    frame = pd.read_csv(dataset / "poses.csv", dtype={"pose": str})
    spoil(dataset, "x", 10, repr(float(frame.loc[10, "x"]) + 0.005))
    name = frame.loc[10, "pose"]
    assert name in warned(run("calibrate", dataset, "-o", tmp_path / "out")).replace(",", " ").split()
    assert name in json.loads((tmp_path / "out" / "calibration.json").read_text())["rejected"]


def test_warnings_do_not_disturb_json(run, dataset, tmp_path):
    numbers(dataset, lambda f: f.insert(1, "payload", 5.0))
    ran = run("calibrate", dataset, "-o", tmp_path / "out", "--json")
    assert "payload" in warned(ran)
    assert json.loads(ran.out)["schema"] == "gtpin-calibration/1"


# ------------------------------------------------------------------------------------------------------ other ends


def test_a_fit_that_does_not_converge_exits_with_1_and_leaves_nothing(run, dataset, tmp_path, tree, monkeypatch):
    monkeypatch.setattr("gtpin.calibration.gauss_newton.MAX_ITERATIONS", 1)
    before = tree(tmp_path)
    error = run("calibrate", dataset, "-o", tmp_path / "deep" / "out").failed(1)
    assert "not converged" in error
    assert tree(tmp_path) == before


@pytest.mark.parametrize(
    ("place", "error", "code", "said"),
    [
        ("gtpin.bench.commands.demo.diagnose", ConvergenceError("the fit has not converged"), 1, "converged"),
        ("gtpin.commands.calibrate.run_calibration", ZeroDivisionError("a bug"), 3, "ZeroDivisionError"),
        ("gtpin.commands.calibrate.run_calibration", KeyboardInterrupt(), 130, "interrupted"),
    ],
    ids=["no convergence", "a fault of gtpin's own", "an interruption"],
)
def test_whatever_ends_a_command_is_one_line_and_leaves_nothing(
    run, source, tmp_path, tree, monkeypatch, place, error, code, said
):
    def fail(*_, **__):
        raise error

    monkeypatch.delenv("GTPIN_TRACEBACK", raising=False)
    monkeypatch.setattr(place, fail)
    called = ["demo"] if ".demo." in place else ["calibrate", source]
    assert said in run(*called, "-o", tmp_path / "out").failed(code)
    assert tree(tmp_path) == {}


GIVEN = {"calibrate": ["SET"], "simulate": [], "demo": [], "predict": ["gantry_tau", "SET/commands.csv"]}


def words_of(command, source):
    return [command, *(word.replace("SET", str(source)) for word in GIVEN[command])]


@pytest.mark.parametrize("command", GIVEN)
def test_an_output_that_is_of_the_wrong_kind_or_below_a_file_is_refused(run, source, tmp_path, tree, command):
    taken, file = tmp_path / "taken", tmp_path / "file"
    file.write_text("mine")
    taken.mkdir() if command == "predict" else taken.write_text("mine")
    before = tree(tmp_path)
    assert "taken" in run(*words_of(command, source), "-o", taken).failed()
    run(*words_of(command, source), "-o", file / "out" / "p.csv").failed()
    assert tree(tmp_path) == before


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write anywhere")
def test_an_output_that_may_not_be_written_is_refused(run, source, tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o500)
    assert "locked" in run("calibrate", source, "-o", locked / "out").failed()


@pytest.mark.parametrize("command", GIVEN)
@pytest.mark.parametrize(
    "places", [["gtpin.output.work_folder.os.replace"], ["pathlib.Path.write_text", "pandas.DataFrame.to_csv"]]
)
def test_a_full_disk_is_one_line_and_leaves_nothing(run, source, tmp_path, tree, command, places, monkeypatch):
    """At the end, when results are moved, and while they are written."""

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    for place in places:
        monkeypatch.setattr(place, full)
    assert "No space" in run(*words_of(command, source), "-o", tmp_path / "deep" / "out").failed()
    assert tree(tmp_path) == {}


@pytest.mark.slow
def test_an_output_folder_is_updated_and_what_else_is_in_it_stays(run, dataset, tmp_path, tree):
    target = tmp_path / "out"
    assert run("calibrate", dataset, "-o", target).code == 0
    (target / "notes.txt").write_text("mine")
    (dataset / "poses.csv").write_text("".join((dataset / "poses.csv").read_text().splitlines(keepends=True)[:-1]))
    older = tree(target)
    assert run("calibrate", dataset, "-o", target).code == 0
    assert tree(target)["calibration.json"] != older["calibration.json"]
    assert tree(target)["model/model.json"] != older["model/model.json"]
    assert (target / "notes.txt").read_text() == "mine"
    assert json.loads((target / "calibration.json").read_text())["poses"] > 0
    assert (target / "model" / "model.json").is_file()
    assert [path.name for path in [*target.iterdir(), *tmp_path.iterdir()] if path.name.startswith(".")] == [
        ".gtpin.json"
    ]
    # A failure after that leaves the old results as they are.
    before = tree(target)
    spoil(dataset, "x", 3, "nan")
    run("calibrate", dataset, "-o", target).failed()
    assert tree(target) == before


# -------------------------------------------------------------------------------------------- anything at all

CELL = st.one_of(
    st.floats().map(repr),
    st.sampled_from(["", "NaN", "0", "1e400", "-0.0", "1,5", '"', "0.1 m", "\x00", "é"]),
    st.text(max_size=4),
)


@pytest.mark.slow
@given(data=st.data())
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_datasets_with_any_cell_are_calibrated_or_refused(run, source, tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("any") / "set"
    shutil.copytree(source, folder)
    lines = [line.split(",") for line in (folder / "poses.csv").read_text().splitlines()]
    for _ in range(data.draw(st.integers(1, 2))):
        row, column = data.draw(st.integers(0, len(lines) - 1)), data.draw(st.integers(0, len(lines[0]) - 1))
        lines[row][column] = data.draw(CELL)
    (folder / "poses.csv").write_bytes("\n".join(",".join(line) for line in lines).encode("utf-8", "surrogatepass"))
    ran = run("calibrate", folder, "-o", folder.parent / "out")
    assert ran.code in (0, 2)
    if ran.code == 0:
        told = json.loads((folder.parent / "out" / "calibration.json").read_text())
        assert 0.5 < told["chi2_per_dof"] < 2.0  # a wrong cell is a gross error of one pose at most
    else:
        ran.failed()
        assert [path.name for path in folder.parent.iterdir()] == ["set"]


def test_what_was_noticed_before_an_error_does_not_add_lines_to_it(run, dataset, tmp_path):
    poses = dataset / "poses.csv"
    lines = poses.read_text().splitlines()
    still = [f"{line},{'still' if number == 0 else '1.0'}" for number, line in enumerate(lines)]
    poses.write_text("\n".join(still[:3]) + "\n")  # a covariate that does not vary, and too few rows
    run("calibrate", dataset, "-o", tmp_path / "out").failed(2)
