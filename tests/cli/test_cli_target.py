"""The circle of a free target: a machine with a reflector off its tool is measured, calibrated and exported; the tool is right.

The machines are Pinocchio's own models, and five-bars in closed form, with geometries drawn from the tolerances assumed.
"""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from quick_first import quick_first
from ran import called
from scipy.spatial.transform import Rotation
from urdfs import crossing
from with_effects import active

import gtpin

TARGET = np.array([0.012, -0.034, 0.061])
"""The reflector in the frame of the tool, m: 71 mm off."""
NOISE, TOLERANCE = 2e-5, 5e-4
LOW, HIGH = np.array([-2.5, -2.4, 0.4, -2.5, 0.4, -2.5]), np.array([2.5, -0.3, 2.2, 2.5, 2.2, 2.5])
"""Ranges of commands: elbow and wrist are away from where they are straight."""
NAME = "ur10"


@dataclass(frozen=True)
class Machine:
    """A machine whose joints and tool were drawn from the tolerances, its tracker's frame, and the folder of its results."""

    real: Any
    nominal: Any
    folder: Path

    def tools(self, model: Any, q: np.ndarray, frame: str = "tool0") -> list[pin.SE3]:
        return [placed(model, frame, row) for row in q]

    def exported(self, file: Path, *options: str) -> str:
        """What ``gtpin export`` says on standard error."""
        ran = called("export", self.folder / "calibrated", "-o", file, *options)
        assert ran.code == 0, ran.err
        return ran.err


def placed(model: Any, frame: str, q: np.ndarray) -> pin.SE3:
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(frame)].copy()


def smallest_singular_value(model: Any, q: np.ndarray) -> float:
    """Of the Jacobian of the tool: next to a singular posture a drawn machine can't reach what the nominal robot does."""
    J = pin.computeFrameJacobian(model, model.createData(), q, model.getFrameId("tool0"))
    return float(np.linalg.svd(J, compute_uv=False)[-1])


def drawn(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(0.0, TOLERANCE, 3)), rng.normal(0.0, TOLERANCE, 3))


def off(found: np.ndarray, true: np.ndarray) -> float:
    """Root mean square distance (N, 3), m, after the best rigid motion: where the tracker stood was not known."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    turn, _ = Rotation.align_vectors(b, a)
    return float(np.sqrt(((turn.apply(a) - b) ** 2).sum(axis=1).mean()))


def off_with_tool(found: np.ndarray, true: np.ndarray, turned: np.ndarray) -> float:
    """The same with a shift of the tool: where it sits was not known either. ``turned``: (N, 3, 3) its rotations."""
    x = true - true.mean(axis=0)
    base = np.concatenate(
        [np.tile(np.eye(3), (len(x), 1, 1)), -np.cross(x[:, None], np.eye(3)).transpose(0, 2, 1), turned], axis=2
    ).reshape(-1, 9)
    left = (found - true).ravel()
    left = left - base @ np.linalg.lstsq(base, left, rcond=None)[0]
    return float(np.sqrt((left**2).sum() / len(x)))


def stated(text: str) -> tuple[float, float]:
    """Expected error and upper end of its interval, m, of a warning on corrected commands."""
    found = re.search(r"expected error of the machine's TCP of ([\d.]+) um .*?\(95 %: [\d.]+ to ([\d.]+) um", text)
    assert found is not None, text
    return 1e-6 * float(found[1]), 1e-6 * float(found[2])


@pytest.fixture(scope="module", params=quick_first([1, 2, 3]))
def machine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """Points of a tracker that stood anywhere, imported as users do, and calibrated."""
    rng, folder = np.random.default_rng(request.param), tmp_path_factory.mktemp("circle")
    nominal = pin.buildModelFromXML(gtpin.load_robot(NAME).description.xml)
    real = nominal.copy()
    for joint in range(1, real.njoints):
        real.jointPlacements[joint] = real.jointPlacements[joint] * drawn(rng)
    tool = real.getFrameId("tool0")
    real.frames[tool].placement = real.frames[tool].placement * drawn(rng)
    stood = pin.SE3(pin.exp3(np.array([0.1, -0.2, 2.1])), np.array([2.3, -1.1, 0.4]))
    q = rng.uniform(LOW, HIGH, (100, 6))
    lines = []
    for i, row in enumerate(q):
        seen = stood.act(placed(real, "tool0", row).act(TARGET)) + NOISE * rng.standard_normal(3)
        lines.append(",".join([f"p{i}", *map(repr, map(float, np.degrees(row))), *map(repr, map(float, 1e3 * seen))]))
    (folder / "points.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    columns = "pose,q1,q2,q3,q4,q5,q6,x,y,z"
    words = f"import points {folder / 'points.csv'} --columns={columns} --separator comma --unit mm --angle deg --robot {NAME}"
    assert called(*words.split(), "-o", str(folder / "measured")).code == 0
    assert called("calibrate", str(folder / "measured"), "-o", str(folder / "calibrated")).code == 0
    return Machine(real, nominal, folder)


def corrected(machine: Machine) -> tuple[np.ndarray, np.ndarray, str]:
    """New commands, those that ``export --commands`` writes in their place, and what it says."""
    q = np.random.default_rng(99).uniform(LOW, HIGH, (300, 6))
    q = np.array([row for row in q if smallest_singular_value(machine.nominal, row) > 0.03])[:200]
    assert len(q) == 200
    table, file = machine.folder / "program.csv", machine.folder / "corrected.csv"
    rows = ["pose,q1,q2,q3,q4,q5,q6", *(",".join([f"n{i}", *map(repr, map(float, row))]) for i, row in enumerate(q))]
    table.write_text("\n".join(rows) + "\n", encoding="utf-8")
    ran = called("export", str(machine.folder / "calibrated"), "-o", str(file), "--commands", str(table), "--force")
    assert ran.code == 0, ran.err
    found = [[float(row[f"q{i}"]) for i in range(1, 7)] for row in csv.DictReader(file.open(encoding="utf-8"))]
    return q, np.array(found), ran.err


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
def test_the_tool_of_an_exported_robot_is_the_tool_and_the_target_a_link_of_its_own(
    machine: Machine, suffix: str
) -> None:
    q, _, said = corrected(machine)
    expected, most = stated(said)
    assert 1e-4 < expected < 1.5e-3  # of the tool's tolerance on the last link
    file = machine.folder / f"robot.{suffix}"
    assert "has the tool, tool0, where the robot's own file has it (assumed: to 0.5 mm" in machine.exported(file)
    read = pin.buildModelFromUrdf(str(file)) if suffix == "urdf" else pin.buildModelFromMJCF(str(file))
    for frame, point, allowed in (("tool0", np.zeros(3), min(2.0 * expected, most)), ("target", TARGET, 2.0 * NOISE)):
        true = np.array([M.act(point) for M in machine.tools(machine.real, q)])
        found = np.array([M.translation for M in machine.tools(read, q, frame)])
        assert off(found, true) < allowed, frame


def test_corrected_commands_bring_the_tool_and_not_the_target_to_where_the_program_wants_it(machine: Machine) -> None:
    q, found, said = corrected(machine)
    expected, most = stated(said)
    wanted = np.array([M.translation for M in machine.tools(machine.nominal, q)])
    before = off(np.array([M.translation for M in machine.tools(machine.real, q)]), wanted)
    after = off(np.array([M.translation for M in machine.tools(machine.real, found)]), wanted)
    assert after < min(2.0 * expected, most, before)
    assert "has the tool, tool0, where the robot's own file has it" in said


def test_tables_of_a_drive_tell_the_error_of_the_tool_and_not_how_far_off_the_target_sat(
    machine: Machine, tmp_path: Path
) -> None:
    """The elbow goes 0.3 mrad too far per rad. The controller has the exported kinematics, and commands by the table."""
    q, scale = np.random.default_rng(98).uniform(LOW, HIGH, (100, 6)), 3e-4
    model = gtpin.read_model(machine.folder / "calibrated")
    erring = replace(model, effects=(active(model, q, "encoder_scale", "elbow_joint", scale=scale),))
    gtpin.write_model(erring, tmp_path / "model")
    file = tmp_path / "corrections.csv"
    ran = called("export", tmp_path / "model", "-o", file)
    assert ran.code == 0, ran.err
    expected, most = stated(ran.err)
    rest = re.search(r"where the tool sits, (\S+) um; everything else, (\S+) um", ran.err)
    assert rest is not None
    assert "The file holds the model exactly" in ran.err
    parts = json.loads(called("export", tmp_path / "model", "-o", file, "--force", "--json").out)["not_determined"]
    assert 1e6 * parts["tool"] == pytest.approx(float(rest[1]), rel=0.01)
    assert parts["base"] > parts["tool"] > parts["rest"] > 0.0
    rows = [row for row in csv.DictReader(file.open(encoding="utf-8")) if row["actuator"] == "elbow_joint"]
    nominal, forward = (np.array([float(row[name]) for row in rows]) for name in ("nominal", "forward"))
    told = q.copy()
    told[:, 2] = np.interp(q[:, 2], nominal, forward) * (1.0 + scale)
    urdf = tmp_path / "robot.urdf"
    machine.exported(urdf)
    read = pin.buildModelFromUrdf(str(urdf))
    found = np.array([M.translation for M in machine.tools(read, q)])
    true = np.array([M.translation for M in machine.tools(machine.real, told)])
    assert off(found, true) < min(2.0 * expected, most) < 4e-3
    turned = np.array([M.rotation for M in machine.tools(machine.real, told)])
    assert off_with_tool(found, true, turned) < 3e-6 * float(rest[2])


def test_a_model_that_is_read_again_knows_the_target_and_an_exported_urdf_the_tool(
    machine: Machine, tmp_path: Path
) -> None:
    model = gtpin.read_model(machine.folder / "calibrated")
    assert model.geometry.target is not None
    assert np.linalg.norm(pin.exp6(model.geometry.target).translation - TARGET) < 3.0 * TOLERANCE
    content = json.loads((machine.folder / "calibrated" / "model" / "model.json").read_text(encoding="utf-8"))
    del content["target"]  # as in models of older versions
    older = tmp_path / "older"
    shutil.copytree(machine.folder / "calibrated" / "model", older)
    (older / "model.json").write_text(json.dumps(content), encoding="utf-8")
    assert np.allclose(gtpin.read_model(older).geometry.target, model.geometry.target, atol=0.0)
    again = gtpin.load_robot(machine.folder / "calibrated" / "model" / "robot.urdf")
    assert again.tcp_frame == "tool0"
    assert "target" in again.links
    assert again.tcp_placement.isApprox(model.robot.tcp_placement, 1e-12)


def test_the_table_of_an_arm_and_its_report_have_no_correction_of_the_tool(machine: Machine) -> None:
    file = machine.folder / "dh.csv"
    assert "the target sat at" in machine.exported(file, "--format", "dh")
    assert "tool," not in file.read_text(encoding="utf-8")
    report = (machine.folder / "calibrated" / "report.txt").read_text(encoding="utf-8")
    assert "The tool stays as it is: the data do not determine it" in " ".join(report.split())


def test_the_expected_error_of_the_machine_is_that_of_its_tool_as_far_as_it_is_known(
    machine: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gtpin.accuracy.figures.write_figures", lambda *_: None)  # most of the time
    ran = called("sensitivity", machine.folder / "calibrated", "-o", tmp_path / "accuracy", "--json")
    assert ran.code == 0, ran.err
    assert "the model has the tool, tool0, where the robot's own file has it" in ran.err
    q, _, _ = corrected(machine)
    file = tmp_path / "robot.urdf"
    machine.exported(file)
    read = pin.buildModelFromUrdf(str(file))
    true, found = (np.array([M.translation for M in machine.tools(one, q)]) for one in (machine.real, read))
    assert off(found, true) < 2.0 * json.loads(ran.out)["expected"]["position"]["mean"]


def test_an_sdf_has_the_tool_where_the_robots_file_has_it_and_the_target_71_mm_off(machine: Machine) -> None:
    file = machine.folder / "robot.sdf"
    assert "the target sat at" in machine.exported(file)
    frames = {frame.get("name"): frame for frame in ElementTree.parse(file).getroot().iter("frame")}
    places = []
    for name in ("tool0", "target"):
        pose = np.array([float(word) for word in str(frames[name].findtext("pose")).split()])
        places.append(pin.SE3(pin.rpy.rpyToMatrix(*pose[3:]), pose[:3]))
    assert frames["tool0"].get("attached_to") == frames["target"].get("attached_to")
    assert np.linalg.norm((places[0].inverse() * places[1]).translation - TARGET) < 3.0 * TOLERANCE


LENGTH, FAR, HALF_BASE, TOOL = 0.3, 0.4, 0.1, 0.45
"""The five-bar of docs/own_machine.md, m."""


def five_bar(
    q: np.ndarray, far: tuple[float, float], near: tuple[float, float], tool: tuple[float, float]
) -> np.ndarray:
    """(N, 2) a point of the left far link, x and z, in closed form; ``tool``: along the link and across it."""
    angles = q + np.array([2.2, 0.9416])
    seats = np.array([[-HALF_BASE, 0.0], [HALF_BASE, 0.0]])
    elbows = seats + np.array(near)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    link = (crossing(elbows[:, 0], far[0], elbows[:, 1], far[1]) - elbows[:, 0]) / far[0]
    return elbows[:, 0] + tool[0] * link + tool[1] * np.stack([-link[:, 1], link[:, 0]], axis=1)


@pytest.mark.parametrize("seed", quick_first([1, 2, 3]))
def test_commands_of_a_five_bar_with_a_target_off_its_tool_are_corrected_in_its_plane(
    seed: int, tmp_path: Path
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "own_machine.md").read_text(encoding="utf-8")
    (text,) = re.findall(r'f"""(<robot name="five_bar">.*?</robot>)"""', page, re.DOTALL)
    sizes = {"LENGTH": LENGTH, "FAR": FAR, "-HALF_BASE": -HALF_BASE, "HALF_BASE": HALF_BASE, "TOOL": TOOL}
    for name, value in sizes.items():
        text = text.replace("{" + name + "}", str(value))
    (tmp_path / "five_bar.urdf").write_text(text, encoding="utf-8")
    rng = np.random.default_rng(seed)
    far, near = (tuple(size + rng.normal(0.0, TOLERANCE, 2)) for size in (FAR, LENGTH))
    q, new = rng.uniform(-0.6, 0.6, (120, 2)), rng.uniform(-0.6, 0.6, (200, 2))
    at = five_bar(q, far, near, (TOOL + 0.02, 0.067))
    seen = np.stack([at[:, 0], np.zeros(len(q)), at[:, 1]], axis=1) + NOISE * rng.standard_normal((len(q), 3))
    for name, head, table in (
        ("points", "", np.column_stack([q, 1e3 * seen])),
        ("program", "pose,q1,q2\n", new),
    ):
        rows = "".join(f"p{i}," + ",".join(map(repr, map(float, row))) + "\n" for i, row in enumerate(table))
        (tmp_path / f"{name}.csv").write_text(head + rows, encoding="utf-8")
    words = "--columns=pose,q1,q2,x,y,z --separator comma --unit mm --angle rad --robot"
    points, measured, calibrated = tmp_path / "points.csv", tmp_path / "measured", tmp_path / "calibrated"
    ran = called("import", "points", points, *words.split(), tmp_path / "five_bar.urdf", "-o", measured)
    assert ran.code == 0, ran.err
    assert called("calibrate", measured, "-o", calibrated).code == 0
    file = tmp_path / "corrected.csv"
    ran = called("export", calibrated, "-o", file, "--commands", tmp_path / "program.csv")
    assert ran.code == 0, ran.err
    found = np.array([[float(row["q1"]), float(row["q2"])] for row in csv.DictReader(file.open(encoding="utf-8"))])
    wanted = five_bar(new, (FAR, FAR), (LENGTH, LENGTH), (TOOL, 0.0))

    def far_off(commands: np.ndarray) -> float:
        at = five_bar(commands, far, near, (TOOL, 0.0))
        return off(*(np.column_stack([points, np.zeros(len(points))]) for points in (at, wanted)))

    expected, most = stated(ran.err)
    assert far_off(found) < min(2.0 * expected, most, far_off(new))
