"""The circle of a Denavit-Hartenberg table: its poses are those of the URDF of the same model, read by Pinocchio."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed
from circle_machines import NOISE, TARGET, Floats, arm, off
from drawn_machines import told
from scipy.spatial.transform import Rotation

import gtpin

POSES, NEAR = 400, 1e-6
"""Number of poses, and the largest difference of the two, m."""
Table = dict[str, dict[str, float]]


def table_of(file: Path) -> tuple[Table, Table]:
    """By joint and parameter, the nominal values and the corrected ones."""
    nominal: Table = {}
    corrected: Table = {}
    for row in csv.DictReader(file.open(encoding="utf-8")):
        value = float(row["nominal"])
        nominal.setdefault(row["joint"], {})[row["parameter"]] = value
        corrected.setdefault(row["joint"], {})[row["parameter"]] = value + float(row["correction"])
    return nominal, corrected


def frame(table: Table, angles: Floats) -> pin.SE3:
    """The last frame at commands (n,), from the first axis on: theta, d, a, alpha, beta of each joint in turn."""
    at, (x, y, z) = pin.SE3.Identity(), np.eye(3)
    for own, angle in zip((table[joint] for joint in table if joint != "tool"), angles, strict=True):
        at *= pin.SE3(pin.exp3((own["theta"] + angle) * z), own.get("d", 0.0) * z)
        at *= pin.SE3(pin.exp3(own.get("alpha", 0.0) * x), own.get("a", 0.0) * x)
        at *= pin.SE3(pin.exp3(own.get("beta", 0.0) * y), np.zeros(3))
    return at


def tool(table: Table) -> pin.SE3:
    """What the rows of the tool add to it: shifts, then turns about x, y and z."""
    at = pin.SE3.Identity()
    for name, twist in zip(("x", "y", "z", "rx", "ry", "rz"), np.eye(6), strict=True):
        at *= pin.exp6(pin.Motion(twist * table.get("tool", {}).get(name, 0.0)))
    return at


def tool_in_last_frame(table: Table, plain: pin.Model, q: Floats, name: str) -> pin.SE3:
    """Where the nominal robot has its tool: from A X = X B of the motions A of the last frame and B of the tool."""
    T, R = placed(plain, q, name)
    poses, ends = [pin.SE3(turn, at) for at, turn in zip(T, R, strict=True)], [frame(table, row) for row in q]
    A, B = ([one[0].inverse() * other for other in one[1:]] for one in (ends, poses))
    turns = ([pin.log3(one.rotation) for one in some] for some in (A, B))
    turn = Rotation.align_vectors(*turns)[0].as_matrix()
    left = np.concatenate([one.rotation - np.eye(3) for one in A])
    right = np.concatenate([turn @ b.translation - a.translation for a, b in zip(A, B, strict=True)])
    return pin.SE3(turn, np.linalg.lstsq(left, right, rcond=None)[0])


def difference(model: gtpin.Model, folder: Path) -> float:
    """Root mean square distance of the tool by the table and by the URDF, m, after the best rigid motion: no table has where
    the machine stands."""
    told(model, folder / "dh.csv", "dh")
    told(model, folder / "robot.urdf")
    nominal, corrected = table_of(folder / "dh.csv")
    robot = model.robot
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (POSES, robot.n_actuators))
    plain, real = pin.buildModelFromXML(robot.description.xml), pin.buildModelFromUrdf(str(folder / "robot.urdf"))
    last = tool_in_last_frame(nominal, plain, q[:60], robot.tcp_frame) * tool(corrected)
    found = np.array([(frame(corrected, row) * last).translation for row in q])
    return off(found, placed(real, q, robot.tcp_frame)[0])


def ur10(folder: Path, joint: str, rpy: str) -> Path:
    """A URDF of the UR10 in which one joint is turned against its parent."""
    text = gtpin.load_robot("ur10").description.xml
    turned = re.sub(rf'(<joint name="{joint}" type.*?rpy=")[^"]*', rf"\g<1>{rpy}", text, count=1, flags=re.DOTALL)
    assert turned != text
    (folder / "turned.urdf").write_text(turned, encoding="utf-8")
    return folder / "turned.urdf"


@pytest.mark.parametrize("size", [1.0, 20.0])
@pytest.mark.parametrize(
    ("joint", "rpy"),
    [
        ("", ""),
        ("shoulder_pan_joint", "0.6 -0.3 0.2"),  # the base is tilted
        ("elbow_joint", "0.0004 0.0 -0.0003"),  # the axes of shoulder and elbow are nearly parallel
        ("wrist_2_joint", "0.004 0.0 0.02"),
    ],
)
def test_a_table_has_the_poses_of_the_urdf(joint: str, rpy: str, size: float, tmp_path: Path) -> None:
    """Placements are off by ``size`` times their tolerances."""
    geometry = gtpin.read_model(ur10(tmp_path, joint, rpy) if joint else "ur10").geometry
    wrong = size * geometry.tolerance * np.random.default_rng(5).standard_normal(len(geometry.names))
    known = np.diag((0.02 * geometry.tolerance) ** 2)
    model = gtpin.Model(geometry.with_values(geometry.values + wrong), covariance=known)
    assert difference(model, tmp_path) < NEAR


def measured(kind: str, folder: Path) -> gtpin.Dataset:
    """A UR10 with wrong placements, measured by a tracker elsewhere, whose target is ``free``, or known to within 2 mm."""
    rng = np.random.default_rng(2)
    dataset = arm("ur10", "", rng).dataset(rng, folder)
    if kind == "free":
        return dataset
    (folder / "dataset.toml").write_text(
        f'schema = "gtpin-dataset/2"\nrobot = "ur10"\n[[instrument]]\nname = "tracker"\nkind = "tracker"\nfile = "poses.csv"\n'
        f'position_sigma = {NOISE}\nframe = "free"\ntarget = {(TARGET + 1e-3).tolist()}\ntarget_sigma = 2e-3\n'
    )
    return gtpin.Dataset.read(folder)


@pytest.mark.parametrize("kind", ["free", "known to within 2 mm"])
def test_a_table_of_an_arm_with_an_unknown_target_has_the_poses_of_the_urdf(kind: str, tmp_path: Path) -> None:
    model = gtpin.calibrate(measured(kind, tmp_path)).model
    assert model.free_target
    assert difference(model, tmp_path) < NEAR
    assert any("a free target" in text for text in told(model, tmp_path / "again.urdf")) is (kind == "free")
