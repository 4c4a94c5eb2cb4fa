"""The examples of real arms: what they read is what was measured; and on the data themselves, where these are at hand."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scripts import load

import gtpin
from gtpin.data import by_region
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints

REAL = Path(__file__).parents[2] / "examples" / "real"
DATA = os.environ.get("GTPIN_REAL_DATA", "")
"""Folder of the files of github.com/pauljac7700/serial_robots_datasets."""
UR5 = Path(DATA) / "UR5" / "3D_UR5_uncalibrated_grid_cleaned.csv"

# Barrett Technology, WAM Arm User's Manual, D1001, version AH.00, Table 5: a, alpha, d.
BARRETT = (
    (0.0, -np.pi / 2, 0.0),
    (0.0, np.pi / 2, 0.0),
    (0.045, -np.pi / 2, 0.55),
    (-0.045, np.pi / 2, 0.0),
    (0.0, -np.pi / 2, 0.3),
    (0.0, np.pi / 2, 0.0),
    (0.0, 0.0, 0.06),
)


def table(joints: int = 6, rows: int = 30) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    columns = {"step_order": np.arange(rows)}
    columns |= {f"{axis}_t": rng.uniform(-500.0, 500.0, rows) for axis in "xyz"}
    columns |= {f"{axis}_dif": rng.normal(0.0, 2.0, rows) for axis in "xyz"}
    columns |= {f"joint_{i + 1}": rng.uniform(-60.0, 60.0, rows) for i in range(joints)}
    return pd.DataFrame(columns)


def by_hand(q: np.ndarray) -> np.ndarray:
    """Pose of the last frame by the distal Denavit-Hartenberg convention."""
    pose = np.eye(4)
    for angle, (a, alpha, d) in zip(q, BARRETT, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        pose = pose @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]]
    return pose


@pytest.mark.parametrize("joints", [6, 7])
def test_a_reading_is_the_target_position_and_the_difference(joints: int, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    given = table(joints)
    given.to_csv(file, index=False)
    load("real/tsinghua").main([str(file), "-o", str(tmp_path / "dataset")])
    dataset = gtpin.Dataset.read(tmp_path / "dataset")
    by_pose = given.set_index(given["step_order"].astype(str)).loc[list(dataset.pose)]
    for i, axis in enumerate("xyz"):
        np.testing.assert_allclose(
            1e3 * dataset.position[:, i], by_pose[f"{axis}_t"] + by_pose[f"{axis}_dif"], rtol=1e-9
        )
    np.testing.assert_allclose(np.degrees(dataset.q[:, -1]), by_pose[f"joint_{joints}"], rtol=1e-9)
    assert (dataset.instrument.frame, dataset.instrument.target) == ("free", "free")
    assert gtpin.load_robot(dataset.robot_reference).n_actuators == joints


def test_a_log_without_a_column_is_refused_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    table().drop(columns="y_dif").to_csv(file, index=False)
    with pytest.raises(SystemExit) as refused:
        load("real/tsinghua").main([str(file), "-o", str(tmp_path / "dataset")])
    assert "y_dif" in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert not (tmp_path / "dataset").exists()


def test_the_wam_of_the_urdf_is_that_of_barrett_s_table() -> None:
    robot = gtpin.load_robot(REAL / "wam.urdf")
    model = gtpin.Model(gtpin.Geometry.nominal(robot))
    q = np.random.default_rng(1).uniform(-0.8, 1.2, (20, 7))
    predicted = model.predict(q)
    for row, R, T in zip(q, predicted.R, predicted.T, strict=True):
        expected = by_hand(row)
        np.testing.assert_allclose(T, expected[:3, 3], atol=1e-9)
        np.testing.assert_allclose(R, expected[:3, :3], atol=1e-9)


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.skipif(not UR5.is_file(), reason="GTPIN_REAL_DATA names no folder with the measured data")
def test_geometry_of_a_real_ur5_predicts_left_out_regions_better_than_was_published() -> None:
    """Jacobi (2025) has a mean error of 0.1549 mm after calibration and a neural network."""
    dataset = load("real/tsinghua").dataset_of(pd.read_csv(UR5))
    off = load("real/ladder").off
    errors = [off(gtpin.calibrate(dataset.take(~held)).model, dataset.take(held)) for held in by_region(dataset, 3)]
    assert np.concatenate(errors).mean() < 0.1549


def test_curves_of_two_series_agree_where_both_have_poses_of_one_machine() -> None:
    """Two machines with the same line in one joint, measured by other poses; a third one with another phase."""
    same_curves = load("real/same_curves")
    robot = gtpin.load_robot("ur5")
    rng = np.random.default_rng(3)
    series = [gtpin.Dataset("ur5", [str(i) for i in range(400)], q, np.zeros((400, 3))) for q in poses_of(rng)]
    one, same, other = (erring(robot, phase, series[0]) for phase in (0.4, 0.4, 2.0))
    j = robot.sites.index("elbow_joint")
    agrees = same_curves.compared([one, same], series, j)
    differs = same_curves.compared([one, other], series, j)
    assert agrees["degrees"] == pytest.approx(np.degrees(1.2 - -1.0), abs=10.0)  # where both ranges have poses
    assert agrees["difference"] < 1e-9
    assert agrees["correlation"] == pytest.approx(1.0)
    assert differs["correlation"] < 0.5
    far = [series[0], series[1].take(series[1].q[:, j] > 1.3)]
    assert same_curves.compared([one, same], far, j) is None


def poses_of(rng: np.random.Generator) -> list[np.ndarray]:
    return [rng.uniform(low, high, (400, 6)) for low, high in ((-2.0, 1.2), (-1.0, 2.0))]


def erring(robot: gtpin.Robot, phase: float, data: gtpin.Dataset) -> gtpin.Model:
    """A nominal arm whose elbow has a line of 11 periods a turn."""
    geometry = gtpin.Geometry.nominal(robot)
    model = gtpin.Model(geometry)
    at = OperatingPoints(model.kinematics, data.q, model.predict(data.q), {})
    effect = next(e for e in gtpin.catalogue() if e.id == "rack_periodic")
    c = 3e-4 * np.array([np.cos(phase), np.sin(phase), 0.0, 0.0])
    line = ActiveEffect(effect, "elbow_joint", 2.0 * np.pi / 11.0, c, np.zeros((4, 4)), at.references)
    return dataclasses.replace(model, effects=(line,))
