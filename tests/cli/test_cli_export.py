"""gtpin export: what it writes, what it says, what it refuses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
from ran import refused
from with_effects import active

import gtpin
from gtpin.data import Commands
from gtpin.report.steps import beside

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def erring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model folder whose second drive errs by its scale, and whose plate's target is off."""
    model = gtpin.read_model("gantry_tau")
    given = (("encoder_scale", "cart2", 3e-4), ("target_offset", "platform", 1e-3))
    effects = (active(model, model.robot.home_q[None], name, site, first=value) for name, site, value in given)
    folder = tmp_path_factory.mktemp("models") / "erring"
    gtpin.write_model(replace(model, effects=tuple(effects)), folder)
    return folder


@pytest.mark.parametrize(
    ("file", "written"),
    [
        ("robot.urdf", ["robot.urdf"]),
        ("robot.yaml", ["robot.urdf", "robot.yaml"]),
        ("robot.sdf", ["robot.sdf"]),
        ("robot.xml", ["robot.xml"]),
    ],
)
def test_each_suffix_is_a_format(run: Run, file: str, written: list[str], tmp_path: Path) -> None:
    ran = run("export", "linear_delta", "-o", tmp_path / "new" / file)
    assert (ran.code, ran.err) == (0, "")
    assert sorted(f.name for f in (tmp_path / "new").iterdir()) == [".gtpin.json", *written]
    assert all(name in ran.out for name in written)


def test_a_format_can_have_another_suffix(run: Run, tmp_path: Path) -> None:
    assert run("export", "tau", "-o", tmp_path / "model.world", "--format", "sdf").code == 0
    assert "<sdf" in (tmp_path / "model.world").read_text(encoding="utf-8")


def test_json_tells_what_was_written_and_what_is_not_held(run: Run, erring: Path, tmp_path: Path) -> None:
    ran = run("export", erring, "-o", tmp_path / "robot.urdf", "--json")
    told = json.loads(ran.out)
    assert told["written"] == [str(tmp_path / "robot.urdf")]
    assert re.search(r"does not hold target_offset@platform \(\S+ um\)", told["warnings"][0])
    assert re.search(r"holds encoder_scale@cart2 \(\S+ um\) as <transmission> only", told["warnings"][1])
    assert "gtpin: warning: robot.urdf does not hold" in ran.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gantry_tau", "-o", "robot.step"], "no format has the suffix '.step'; use .urdf, .yaml"),
        (["gantry_tau", "-o", "robot"], "no format has the suffix ''"),
        (["gantry_tau", "-o", "."], "this is a folder"),
        (["gantry_tau", "-o", "drives.csv"], "nothing that a controller's tables can correct"),
        (["gantry_tau", "-o", "drives.comp", "--session", "2"], "knows no session '2'"),
        (["no_robot", "-o", "robot.xml"], "no_robot"),
        (["gantry_tau", "-o", "q.csv", "--controller", "tau"], "--controller without --commands"),
        (["linear_delta", "-o", "printer.cfg"], "tables of a printer's firmware need --box"),
        (["stewart", "-o", "printer.g", "--box", 0, 1, 0, 1, 0, 1], "stewart has 6 actuators"),
        (["linear_delta", "-o", "x.g", "--box", 0, 1, 1, 0, 0, 1], "this is no box"),
        (["gantry_tau", "-o", "drives.comp", "--temperature", 20], "linuxcnc takes no box, temperatures"),
        (["gantry_tau", "-o", "q.urdf", "--commands", "commands.csv"], "corrected commands are a table"),
        (["gantry_tau", "-o", "q.csv", "--commands", "missing.csv"], "missing"),
    ],
)
def test_what_can_not_be_is_one_line_and_leaves_nothing(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in refused(tmp_path, "export", *arguments)


def test_commands_are_written_again_so_that_the_tcp_goes_where_it_was_meant(
    run: Run, erring: Path, tmp_path: Path
) -> None:
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (12, 3))
    ids = np.array([f"p{k}" for k in range(12)], dtype=object)
    Commands(ids, q, {"payload": np.arange(12.0)}).write(tmp_path / "commands.csv")
    ran = run("export", erring, "-o", tmp_path / "new.csv", "--commands", tmp_path / "commands.csv")
    assert ran.code == 0
    assert "target_offset@platform" in ran.err  # the instrument's, not the machine's
    new = pd.read_csv(tmp_path / "new.csv")
    assert list(new.columns) == ["pose", "q1", "q2", "q3", "payload"]
    assert list(new.pose) == list(ids)
    # The drive goes by 3e-4 too far: it must be told as much less, and nothing of the others changes.
    np.testing.assert_allclose(new.q2 * (1.0 + 3e-4), q[:, 1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(new[["q1", "q3"]], q[:, [0, 2]], rtol=0, atol=1e-8)


def test_commands_out_of_reach_are_named_and_stay_and_the_others_are_corrected(
    run: Run, erring: Path, tmp_path: Path
) -> None:
    robot, q = gtpin.load_robot("gantry_tau"), np.random.default_rng(0).uniform(-0.3, 0.3, (12, 3))
    lost = np.array([3, 7])
    q[lost] = (1.9, -1.9, 1.9), (-1.9, -1.9, 1.9)  # carts too far apart for the rods
    with pytest.raises(gtpin.GtpinError, match="can't be reached"):
        robot.forward(q[lost[0]])
    Commands(np.array([f"p{k}" for k in range(12)], dtype=object), q).write(tmp_path / "commands.csv")
    ran = run("export", erring, "-o", tmp_path / "new.csv", "--commands", tmp_path / "commands.csv", "--json")
    assert ran.code == 0
    words = "leaves 2 of 12 commands as they were, because their poses can't be reached: p3 (row 5), p7 (row 9)"
    assert next(text.partition(" ")[2] for text in json.loads(ran.out)["warnings"] if "leaves" in text) == words
    new, kept = pd.read_csv(tmp_path / "new.csv"), np.delete(np.arange(12), lost)
    np.testing.assert_array_equal(new[["q1", "q2", "q3"]].to_numpy()[lost], q[lost])
    np.testing.assert_allclose(new.q2[kept] * (1.0 + 3e-4), q[kept, 1], rtol=0, atol=1e-8)
    Commands(["a", "b"], q[lost]).write(tmp_path / "far.csv")
    ran = run("export", erring, "-o", tmp_path / "none.csv", "--commands", tmp_path / "far.csv")
    assert (ran.code, (tmp_path / "none.csv").exists()) == (2, False)
    assert "none of the poses can be reached" in ran.err


def test_where_the_pose_is_out_of_reach_the_position_is_corrected_and_the_rest_is_told(
    run: Run, tmp_path: Path
) -> None:
    """A UR5 with a short forearm, stretched, and with the axes of its wrist in line; its own URDF, by Pinocchio."""
    nominal = gtpin.read_model("ur5")
    geometry, wrong = nominal.geometry, {"placement[wrist_1_joint].x": 2e-3, "placement[wrist_3_joint].ry": 1e-3}
    off = np.array([wrong.get(name, 0.0) for name in geometry.names])
    gtpin.write_model(gtpin.Model(geometry.with_values(geometry.values + off)), tmp_path / "short")
    q = np.array([[0.3, -1.2, 1.4, 0.2, 1.5, 0.1], [0.3, -1.2, 0.0, 0.2, 1.5, 0.1], [0.1, -1.0, 0.9, 0.4, 1e-3, 0.2]])
    Commands(np.array(["bent", "far", "in line"], dtype=object), q).write(tmp_path / "commands.csv")
    ran = run("export", tmp_path / "short", "-o", tmp_path / "new.csv", "--commands", tmp_path / "commands.csv")
    assert ran.code == 0, ran.err
    found = re.search(
        r"brings 2 of 3 to the position alone, .*: far \(row 3\) off by (\S+) mrad, in line \(row 4\) off by (\S+) mrad",
        ran.err,
    )
    assert found is not None, ran.err
    new = pd.read_csv(tmp_path / "new.csv")[[f"q{k}" for k in range(1, 7)]].to_numpy()
    assert np.abs(new - q).max() < 0.1  # no axis turns far for an error of a milliradian
    model = pin.buildModelFromUrdf(str(tmp_path / "short" / "robot.urdf"))
    data, tool = model.createData(), model.getFrameId("tool0")
    meant, turned = nominal.predict(q), []
    for i in range(3):
        pin.framesForwardKinematics(model, data, new[i])
        there = data.oMf[tool]
        assert np.abs(there.translation - meant.T[i]).max() < 1e-8
        turned.append(1e3 * np.linalg.norm(pin.log3(meant.R[i] @ there.rotation.T)))
    assert turned[0] < 1e-5
    assert [float(found[1]), float(found[2])] == pytest.approx(turned[1:], rel=0.01)


def test_commands_that_stay_are_told_with_how_far_the_tcp_is_off_there(run: Run, tmp_path: Path) -> None:
    """A UR5 whose forearm is 0.15 m short."""
    nominal = gtpin.read_model("ur5")
    geometry, name = nominal.geometry, "placement[wrist_1_joint].x"
    short = gtpin.Model(geometry.with_values(geometry.values + 0.15 * (np.array(geometry.names) == name)))
    gtpin.write_model(short, tmp_path / "short")
    q = np.array([[0.3, -1.2, 2.0, 0.2, 1.5, 0.1], [0.3, -1.2, 0.0, 0.2, 1.5, 0.1]])
    Commands(np.array(["bent", "far"], dtype=object), q).write(tmp_path / "commands.csv")
    ran = run("export", tmp_path / "short", "-o", tmp_path / "new.csv", "--commands", tmp_path / "commands.csv")
    assert ran.code == 0, ran.err
    found = re.search(r"leaves 1 of 2 commands as they were, .*: far \(row 3\) off by (\S+) mm and (\S+) mrad", ran.err)
    assert found is not None, ran.err
    assert float(found[1]) == pytest.approx(150.0, rel=0.01)  # the forearm is straight: the whole arm beyond it moves
    assert float(found[2]) == pytest.approx(0.0, abs=1e-6)


def test_corrected_commands_outside_of_the_range_are_named(run: Run, tmp_path: Path) -> None:
    """A drive that goes too short by 0.3 per mille must be told more, 0.2 mm beyond its range at the end of it."""
    model = gtpin.read_model("gantry_tau")
    short = active(model, model.robot.home_q[None], "encoder_scale", "cart2", first=-3e-4)
    gtpin.write_model(replace(model, effects=(short,)), tmp_path / "short")
    q = np.zeros((3, 3))
    q[1:, 1] = model.robot.upper[1] - np.array([1e-3, 0.0])
    Commands(np.array(["home", "near", "end"], dtype=object), q).write(tmp_path / "commands.csv")
    ran = run(
        "export", tmp_path / "short", "-o", tmp_path / "new.csv", "--commands", tmp_path / "commands.csv", "--json"
    )
    said = [text for text in json.loads(ran.out)["warnings"] if "range" in text]
    assert said == ["new.csv has commands outside of the robot's range: q2 of end (row 4)"]


def test_where_no_table_can_correct_anything_the_error_says_what_can(run: Run, tmp_path: Path) -> None:
    for robot, words in (("ur5", "--format dh"), ("gantry_tau", "write a URDF")):
        said = run("export", robot, "-o", tmp_path / "corrections.csv").failed()
        assert words in said
        assert "--commands" in said


def test_what_moves_the_target_is_not_promised_to_be_corrected() -> None:
    model, q = gtpin.read_model("ur5"), np.random.default_rng(0).uniform(-1.0, 1.0, (20, 6))
    time = {"time": np.linspace(0.0, 1e4, 20)}
    drift = active(model, q, "target_drift", "platform", covariates=time, first=1e-4)
    assert beside(model) == ""
    assert "without" in (said := beside(replace(model, effects=(drift,))))
    assert "target" in said


def test_a_table_of_corrections_is_what_to_command(run: Run, erring: Path, tmp_path: Path) -> None:
    ran = run("export", erring, "-o", tmp_path / "drives.csv")
    assert "drives.csv does not hold target_offset@platform" in ran.err
    table = pd.read_csv(tmp_path / "drives.csv")
    assert set(table.actuator) == {"cart2"}
    np.testing.assert_allclose(table.forward * (1.0 + 3e-4), table.nominal, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(table.forward, table.reverse)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "more", "written"),
    [
        ("p.cfg", ["--box", -0.1, 0.1, -0.1, 0.1, -0.1, 0.1], ["p.cfg"]),
        ("p.g", ["--box", -0.1, 0.1, -0.1, 0.1, -0.1, 0.1], ["p.g", "p_heightmap.csv"]),
        ("q.csv", ["--format", "grid"], ["q.csv"]),
        ("q.csv", ["--format", "grid", "--controller", "gantry_tau"], ["q.csv"]),
    ],
)
def test_tables_of_all_errors_say_what_they_leave(
    run: Run, erring: Path, file: str, more: list[object], written: list[str], tmp_path: Path
) -> None:
    origin = ["--origin", *gtpin.read_model("gantry_tau").kinematics.home.T[0]] if "--box" in more else []
    ran = run("export", erring, "-o", tmp_path / file, *more, *origin, "--json")
    told = json.loads(ran.out)
    assert told["written"] == [str(tmp_path / name) for name in written]
    assert all((tmp_path / name).is_file() for name in written)
    # The target's offset is the instrument's; the drive's scale is all that is left to correct.
    assert re.search(r"not corrected: target_offset@platform: it moves the target", told["warnings"][0])
    assert re.search(rf"{file} leaves \S+.* of \S+ um of the TCP's error in the (box|whole range)", told["warnings"][1])
    about_parts = [text for text in told["warnings"][2:] if "leaves lengths of parts in x off by" in text]
    assert len(about_parts) == ("--box" in more)
    assert len(told["warnings"]) == 2 + len(about_parts)  # one part is the whole: nothing is said of each part alone
