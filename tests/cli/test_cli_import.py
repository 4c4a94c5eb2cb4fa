"""``gtpin import``: a dataset folder as the format has it, or one line and nothing."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from printed import HEIGHTMAP, ORIGIN, POINTS, PROBE_LOG, places, printer_cfg
from ran import Ran, called, refused

import gtpin
from gtpin.references import seen_from

Run = Callable[..., Ran]


def touches(folder: Path) -> tuple[dict[str, object], pd.DataFrame]:
    """The one instrument of a dataset folder, and its table."""
    content = tomllib.loads((folder / "dataset.toml").read_text(encoding="utf-8"))
    assert content.pop("schema") == "gtpin-dataset/2"
    (instrument,) = content["instrument"]
    return content, pd.read_csv(folder / f"{instrument['name']}.csv", dtype={"pose": str})


@pytest.fixture
def imported(run: Run, tmp_path: Path) -> Run:
    """Import a text in a format for the linear delta, into ``touches``."""

    def import_(kind: str, text: str, *options: object) -> Ran:
        file = tmp_path / "file"
        file.write_text(text, encoding="utf-8")
        command = ("import", kind, file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", tmp_path / "touches")
        ran = run(*command, *options)
        assert ran.code == 0, ran.err
        return ran

    return import_


def test_touches_of_a_delta_printer_are_a_plane_that_the_robot_touched(imported: Run, tmp_path: Path) -> None:
    xyz, folder = places(), tmp_path / "touches"
    ran = imported("klipper-delta", printer_cfg(xyz, height=1.0), "--json")
    assert json.loads(ran.out) == {"dataset": str(folder), "robot": "linear_delta", "rows": 9}
    content, table = touches(folder)
    (instrument,) = content["instrument"]
    assert (content["robot"], instrument["kind"]) == ("linear_delta", "plane")
    assert list(table) == ["pose", "q1", "q2", "q3", "height"]
    dataset = gtpin.Dataset.read(folder)
    assert not dataset.readings.tracked
    np.testing.assert_array_equal(dataset.readings.columns["height"], table["height"])
    assert table["pose"].is_unique
    there = gtpin.read_model("linear_delta").kinematics.forward(table[["q1", "q2", "q3"]].to_numpy())
    plane = instrument["planes"]["A"]
    # The bed is the firmware's z = 0 and level: by this the printer's heights are judged.
    assert (plane["point"], plane["normal"]) == (list(ORIGIN), [0.0, 0.0, 1.0])
    assert instrument["plane_sigma"] == instrument["normal_sigma"] == 0.0
    np.testing.assert_allclose(there.T[:, 2] - ORIGIN[2], 1e-3 * xyz[:, 2], atol=1e-7)


def test_height_is_positive_where_the_tip_is_on_the_side_of_the_normal(imported: Run, tmp_path: Path) -> None:
    flat = places() * [1.0, 1.0, 0.0] + [0.0, 0.0, 5.0]  # 5 mm over the bed, as a probe of that offset is
    imported("klipper-delta", printer_cfg(flat, height=5.0))
    content, _ = touches(tmp_path / "touches")
    assert content["instrument"][0]["planes"]["A"]["point"][2] == pytest.approx(ORIGIN[2], abs=1e-8)


def test_what_is_given_of_the_instrument_is_in_the_dataset(imported: Run, tmp_path: Path) -> None:
    given = ("--probe-offset", "10", "-5", "2", "--sigma", "2e-5", "--name", "glass", "--tcp", "platform")
    imported("rrf-heightmap", HEIGHTMAP, *given)
    content, table = touches(tmp_path / "touches")
    (instrument,) = content["instrument"]
    assert content["tcp"] == "platform"
    assert (instrument["name"], instrument["sigma"]) == ("glass", 2e-5)
    np.testing.assert_allclose(instrument["target"], [0.010, -0.005, -0.002])
    assert (tmp_path / "touches" / "glass.csv").is_file()
    assert len(table) == 5


def test_a_robot_s_path_starts_at_the_dataset(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robots").mkdir()
    urdf = Path("robots/delta.urdf")
    urdf.write_text(gtpin.load_robot("linear_delta").description.xml, encoding="utf-8")
    Path("heightmap.csv").write_text(HEIGHTMAP, encoding="utf-8")
    options = ("--robot", urdf, "--origin", *ORIGIN, "-o", "deep/touches")
    assert run("import", "rrf-heightmap", "heightmap.csv", *options).code == 0
    content, _ = touches(Path("deep/touches"))
    assert content["robot"] == "../../robots/delta.urdf"
    assert seen_from("gantry_tau", Path("deep/touches")) == "gantry_tau"


def test_points_are_a_dataset_that_every_command_reads(run: Run, tmp_path: Path) -> None:
    file, table, folder = tmp_path / "points.txt", tmp_path / "commands.csv", tmp_path / "measured"
    file.write_text(POINTS, encoding="utf-8")
    table.write_text("pose,q1,q2,q3,q4,q5,q6\np1,0,-1,1,0,1,0\np2,0.5,-1,1,0,1,0\n", encoding="utf-8")
    ran = run(
        *("import", "points", file, "--columns=-,-,pose,x,y,z", "--separator", "space", "--unit", "mm"),
        *("--commands", table, "--match", "pose", "--robot", "ur5", "--frame", "robot", "-o", folder),
    )
    assert ran.code == 0, ran.err
    dataset = gtpin.Dataset.read(folder)
    assert list(dataset.pose) == ["p1", "p2", "p1"]
    assert dataset.instrument.frame == "robot"


@pytest.mark.parametrize("offset", [("0", "0", "-0.02"), ("0", "0", "5"), ("-0.5", "0", "0")])
def test_a_probe_on_the_nozzle_s_axis_may_have_any_trigger_height(imported: Run, offset: tuple[str, ...]) -> None:
    imported("rrf-heightmap", HEIGHTMAP, "--probe-offset", *offset)


def test_a_bed_far_from_the_firmware_s_zero_is_warned_of(imported: Run) -> None:
    ran = imported("klipper-delta", printer_cfg(places() + np.array([0.0, 0.0, 20.0])))
    assert "on average, where a firmware's zero is the bed" in " ".join(ran.err.split())


@pytest.mark.parametrize("size", ["1e-300", "1", "1e300"])
def test_a_normal_may_have_any_length(imported: Run, tmp_path: Path, size: str) -> None:
    imported("linuxcnc-probe", PROBE_LOG, "--unit", "mm", "--normal", f"-{size}", "0", size)
    content, _ = touches(tmp_path / "touches")
    np.testing.assert_allclose(content["instrument"][0]["planes"]["A"]["normal"], [-(0.5**0.5), 0.0, 0.5**0.5])


def test_another_import_takes_the_place_of_the_first_and_nothing_of_that_stays(imported: Run, tmp_path: Path) -> None:
    for name in ("first", "second"):
        imported("rrf-heightmap", HEIGHTMAP, "--name", name)
    assert not (tmp_path / "touches" / "first.csv").exists()
    touches(tmp_path / "touches")


def test_files_of_others_are_never_replaced(imported: Run, tmp_path: Path) -> None:
    file, folder = tmp_path / "file", tmp_path / "touches"
    file.write_text(HEIGHTMAP, encoding="utf-8")
    folder.mkdir()
    (folder / "bed.csv").write_text("mine\n", encoding="utf-8")
    command = ("import", "rrf-heightmap", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder)
    assert "bed.csv" in refused(tmp_path, *command)
    imported("rrf-heightmap", HEIGHTMAP, "--force")
    assert (folder / "bed.csv.old-1").read_text(encoding="utf-8") == "mine\n"


DELTA = "--robot linear_delta"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("rrf-heightmap heightmap.csv --robot gantry_tao", "gantry_tao"),
        (f"rrf-heightmap missing.csv {DELTA}", "missing"),
        (f"rrf-heightmap probe.txt {DELTA}", "row 1"),
        (f"rrf-heightmap heightmap.csv {DELTA} --origin 9 0 0", "row 4"),
        (f"rrf-heightmap heightmap.csv {DELTA} --origin nan 0 0", "origin"),
        (f"rrf-heightmap heightmap.csv {DELTA} --probe-offset nan 0 0", "probe-offset"),
        (f"rrf-heightmap heightmap.csv {DELTA} --sigma 0", "sigma"),
        (f"rrf-heightmap heightmap.csv {DELTA} --name ../up", "name"),
        (f"rrf-heightmap heightmap.csv {DELTA} --name commands", "name"),
        ("rrf-heightmap heightmap.csv", "--robot"),
        (f"linuxcnc-probe probe.txt {DELTA}", "--unit"),
        (f"linuxcnc-probe probe.txt {DELTA} --unit cm", "cm"),
        (f"linuxcnc-probe probe.txt {DELTA} --unit mm --normal 0 0 0", "normal"),
        (f"rrf-heightmap heightmap.csv {DELTA} --probe-offset 0.02 0 0", "metres"),
        (f"rrf-heightmap heightmap.csv {DELTA} --probe-offset 0 3000 0", "can't be"),
        (f"rrf-heightmap far.csv {DELTA}", "far.csv, row 5, column q1: 45 is far outside"),
        (f"linuxcnc-probe probe.txt {DELTA} --unit mm --target 0 0 -50", "50 m"),
        ("marlin probe.txt", "marlin"),
    ],
)
def test_what_can_t_be_imported_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("heightmap.csv").write_text(HEIGHTMAP, encoding="utf-8")
    Path("probe.txt").write_text(PROBE_LOG, encoding="utf-8")
    Path("far.csv").write_text(HEIGHTMAP.replace(" -0.045", "45000"), encoding="utf-8")
    own = () if "--origin" in words or words.startswith("marlin") else ("--origin", *ORIGIN)
    assert told in refused(tmp_path, "import", *words.split(), *own, "-o", "touches")


def test_points_of_a_robot_with_rods_become_a_dataset_that_calibrate_reads(tmp_path: Path) -> None:
    model = gtpin.read_model("gantry_tau")
    q = np.random.default_rng(3).uniform(-0.3, 0.3, (60, 3))
    T = model.predict(q).T + 2e-5 * np.random.default_rng(4).standard_normal((60, 3))
    lines = [",".join(map(repr, [*map(float, row)])) for row in 1e3 * np.hstack([q, T])]
    (tmp_path / "points.csv").write_text("\n".join(f"p{i},{line}" for i, line in enumerate(lines)), encoding="utf-8")
    words = "--columns=pose,q1,q2,q3,x,y,z --separator comma --unit mm --robot gantry_tau"
    assert called("import", "points", tmp_path / "points.csv", *words.split(), "-o", tmp_path / "measured").code == 0
    assert called("calibrate", tmp_path / "measured", "-o", tmp_path / "calibrated").code == 0


def test_commands_in_radians_that_are_called_degrees_are_refused(tmp_path: Path) -> None:
    (tmp_path / "points.txt").write_text("p0,1,2,3\n", encoding="utf-8")
    (tmp_path / "joints.csv").write_text("pose,q1,q2,q3,q4,q5,q6\np0,0.1,-1.2,1.5,-2.4,0.3,3.1\n", encoding="utf-8")
    words = f"--columns=pose,x,y,z --separator comma --unit mm --angle deg --commands {tmp_path / 'joints.csv'} --match pose"
    arguments = [tmp_path / "points.txt", *words.split(), "--robot", "ur10", "-o", tmp_path / "measured"]
    assert "look like radians; leave out --angle deg" in refused(tmp_path, "import", "points", *arguments)


@pytest.mark.parametrize(("target", "told"), [("free", False), ("tcp", True)])
def test_the_target_is_said_to_be_at_the_tcp_only_where_it_is_taken_to_be(
    target: str, told: bool, tmp_path: Path
) -> None:
    (tmp_path / "points.csv").write_text(
        "p1,100,200,300,0.1,0,0,0,0,0\np2,100,210,300,0.2,0,0,0,0,0\n", encoding="utf-8"
    )
    words = f"import points {tmp_path / 'points.csv'} --separator comma --unit mm --angle rad --robot ur10 --target {target}"
    said = called(*words.split(), "--columns=pose,x,y,z,q1,q2,q3,q4,q5,q6", "-o", tmp_path / "m")
    assert said.code == 0, said.err
    assert ("taken to be at the robot's TCP" in said.out) == told


def test_sessions_are_ids_and_a_tracker_that_stood_elsewhere_in_each_is_written_so(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(
        "p1,100,200,300,0.1,0,0,0,0,0,day one\np2,100,210,300,0.2,0,0,0,0,0,2.0\n", encoding="utf-8"
    )
    columns = "pose,x,y,z,q1,q2,q3,q4,q5,q6,session"
    words = f"import points {tmp_path / 'points.csv'} --separator comma --unit mm --angle rad --robot ur10"
    said = called(
        *words.split(), f"--columns={columns}", "--sigma", "3e-5", "--stations", "session", "-o", tmp_path / "m"
    )
    assert said.code == 0, said.err
    assert "taken to be at the robot's TCP" not in said.out  # the target is free
    read = gtpin.Dataset.read(tmp_path / "m")
    assert list(read.covariates["session"]) == ["day one", "2"]
    (table,) = read.readings.tables
    assert (table.stations, table.position_sigma, table.target) == ("session", 3e-5, "free")
    said = called(
        *words.split(), f"--columns={columns.replace('session', '-')}", "--stations", "session", "-o", tmp_path / "n"
    )
    assert said.code == 2
    assert "name a column session in --columns" in said.err


@pytest.mark.parametrize(
    ("name", "cell", "told"),
    [
        ("tiem", "5", "'tiem' is not 'time': kept"),
        ("Time", "5", "'Time' is not 'time': kept"),
        ("sesion", "3", "'sesion' is not 'session': kept"),
        ("pos", "7", "'pos' is not 'pose': kept"),
        ("sesion", "day1", "did you mean the column session in --columns?"),
    ],
)
def test_a_typing_mistake_in_a_column_s_name_is_told(name: str, cell: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(f"100,200,300,0.1,0,0,0,0,0,{cell}\n", encoding="utf-8")
    words = f"import points {tmp_path / 'points.csv'} --separator comma --unit mm --angle rad --robot ur10 -o {tmp_path / 'm'}"
    said = called(*words.split(), f"--columns=x,y,z,q1,q2,q3,q4,q5,q6,{name}")
    assert told in said.err
    told_nothing = called(
        *words.split(), f"--columns=x,y,z,q1,q2,q3,q4,q5,q6,{'session' if cell == 'day1' else 'humidity'}", "--force"
    )
    assert told_nothing.code == 0
    assert "is not" not in told_nothing.err
