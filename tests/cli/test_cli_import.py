"""``gtpin import``: a dataset folder as the format has it, or one line and nothing."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ran import Ran, refused

import gtpin
from gtpin.references import seen_from

sys.path.insert(0, str(Path(__file__).parents[1] / "importers"))
from printed import HEIGHTMAP, ORIGIN, POINTS, PROBE_LOG, places, printer_cfg

Run = Callable[..., Ran]


def touches(folder: Path) -> tuple[dict[str, object], pd.DataFrame]:
    """The one instrument of a dataset folder, and its table."""
    content = tomllib.loads((folder / "dataset.toml").read_text(encoding="utf-8"))
    assert content.pop("schema") == "gtpin-dataset/2"
    (instrument,) = content["instrument"]
    return content, pd.read_csv(folder / f"{instrument['name']}.csv", dtype={"pose": str})


def test_touches_of_a_delta_printer_are_a_plane_that_the_robot_touched(run: Run, tmp_path: Path) -> None:
    xyz = places()
    file, folder = tmp_path / "printer.cfg", tmp_path / "touches"
    file.write_text(printer_cfg(xyz, height=1.0), encoding="utf-8")
    ran = run("import", "klipper-delta", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder, "--json")
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


def test_height_is_positive_where_the_tip_is_on_the_side_of_the_normal(run: Run, tmp_path: Path) -> None:
    file, folder = tmp_path / "printer.cfg", tmp_path / "touches"
    flat = places() * [1.0, 1.0, 0.0] + [0.0, 0.0, 5.0]  # 5 mm over the bed, as a probe of that offset is
    file.write_text(printer_cfg(flat, height=5.0), encoding="utf-8")
    assert run("import", "klipper-delta", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder).code == 0
    content, _ = touches(folder)
    assert content["instrument"][0]["planes"]["A"]["point"][2] == pytest.approx(ORIGIN[2], abs=1e-8)


def test_what_is_given_of_the_instrument_is_in_the_dataset(run: Run, tmp_path: Path) -> None:
    file, folder = tmp_path / "heightmap.csv", tmp_path / "touches"
    file.write_text(HEIGHTMAP, encoding="utf-8")
    ran = run(
        *("import", "rrf-heightmap", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder),
        *("--probe-offset", "10", "-5", "2", "--sigma", "2e-5", "--name", "glass", "--tcp", "platform"),
    )
    assert ran.code == 0, ran.err
    content, table = touches(folder)
    (instrument,) = content["instrument"]
    assert content["tcp"] == "platform"
    assert (instrument["name"], instrument["sigma"]) == ("glass", 2e-5)
    np.testing.assert_allclose(instrument["target"], [0.010, -0.005, -0.002])
    assert (folder / "glass.csv").is_file()
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


def test_a_probe_on_the_nozzle_s_axis_may_have_any_trigger_height(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "heightmap.csv"
    file.write_text(HEIGHTMAP, encoding="utf-8")
    command = ("import", "rrf-heightmap", file, "--robot", "linear_delta", "--origin", *ORIGIN)
    for number, offset in enumerate((("0", "0", "-0.02"), ("0", "0", "5"), ("-0.5", "0", "0"))):
        assert run(*command, "--probe-offset", *offset, "-o", tmp_path / str(number)).code == 0


def test_a_bed_far_from_the_firmware_s_zero_is_warned_of(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "printer.cfg"
    file.write_text(printer_cfg(places() + np.array([0.0, 0.0, 20.0])), encoding="utf-8")
    ran = run("import", "klipper-delta", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", tmp_path / "far")
    assert ran.code == 0, ran.err
    assert "on average, where a firmware's zero is the bed" in " ".join(ran.err.split())


def test_a_normal_may_have_any_length(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "probe.txt"
    file.write_text(PROBE_LOG, encoding="utf-8")
    for number, size in enumerate(("1e-300", "1", "1e300")):
        folder = tmp_path / str(number)
        command = ("import", "linuxcnc-probe", file, "--unit", "mm", "--robot", "linear_delta", "--origin", *ORIGIN)
        assert run(*command, "--normal", f"-{size}", "0", size, "-o", folder).code == 0
        content, _ = touches(folder)
        np.testing.assert_allclose(content["instrument"][0]["planes"]["A"]["normal"], [-(0.5**0.5), 0.0, 0.5**0.5])


def test_another_import_takes_the_place_of_the_first_and_nothing_of_that_stays(run: Run, tmp_path: Path) -> None:
    file, folder = tmp_path / "heightmap.csv", tmp_path / "touches"
    file.write_text(HEIGHTMAP, encoding="utf-8")
    command = ("import", "rrf-heightmap", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder)
    assert run(*command, "--name", "first").code == 0
    assert run(*command, "--name", "second").code == 0
    assert not (folder / "first.csv").exists()
    touches(folder)


def test_files_of_others_are_never_replaced(run: Run, tmp_path: Path) -> None:
    file, folder = tmp_path / "heightmap.csv", tmp_path / "touches"
    file.write_text(HEIGHTMAP, encoding="utf-8")
    folder.mkdir()
    (folder / "bed.csv").write_text("mine\n", encoding="utf-8")
    command = ("import", "rrf-heightmap", file, "--robot", "linear_delta", "--origin", *ORIGIN, "-o", folder)
    assert "bed.csv" in refused(tmp_path, *command)
    assert run(*command, "--force").code == 0
    assert (folder / "bed.csv.old-1").read_text(encoding="utf-8") == "mine\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["rrf-heightmap", "heightmap.csv", "--robot", "gantry_tao"], "gantry_tao"),
        (["rrf-heightmap", "missing.csv", "--robot", "linear_delta"], "missing"),
        (["rrf-heightmap", "probe.txt", "--robot", "linear_delta"], "row 1"),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--origin", "9", "0", "0"], "row 4"),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--origin", "nan", "0", "0"], "origin"),
        (
            ["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--probe-offset", "nan", "0", "0"],
            "probe-offset",
        ),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--sigma", "0"], "sigma"),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--name", "../up"], "name"),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--name", "commands"], "name"),
        (["rrf-heightmap", "heightmap.csv"], "--robot"),
        (["linuxcnc-probe", "probe.txt", "--robot", "linear_delta"], "--unit"),
        (["linuxcnc-probe", "probe.txt", "--robot", "linear_delta", "--unit", "cm"], "cm"),
        (
            ["linuxcnc-probe", "probe.txt", "--robot", "linear_delta", "--unit", "mm", "--normal", "0", "0", "0"],
            "normal",
        ),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--probe-offset", "0.02", "0", "0"], "metres"),
        (["rrf-heightmap", "heightmap.csv", "--robot", "linear_delta", "--probe-offset", "0", "3000", "0"], "can't be"),
        (["rrf-heightmap", "far.csv", "--robot", "linear_delta"], "far.csv, row 5, column q1: 45 is far outside"),
        (
            ["linuxcnc-probe", "probe.txt", "--robot", "linear_delta", "--unit", "mm", "--target", "0", "0", "-50"],
            "50 m",
        ),
        (["marlin", "probe.txt"], "marlin"),
    ],
)
def test_what_can_t_be_imported_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("heightmap.csv").write_text(HEIGHTMAP, encoding="utf-8")
    Path("probe.txt").write_text(PROBE_LOG, encoding="utf-8")
    Path("far.csv").write_text(HEIGHTMAP.replace(" -0.045", "45000"), encoding="utf-8")
    own = () if "--origin" in arguments or arguments[0] == "marlin" else ("--origin", *ORIGIN)
    assert told in refused(tmp_path, "import", *arguments, *own, "-o", "touches")
