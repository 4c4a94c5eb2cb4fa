"""The examples that prepare an import: a printer's URDF, and the sockets of a real arm."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scripts import load

import gtpin

DATA = Path(os.environ.get("GTPIN_REAL_DATA", ""))
SETS = [
    folder
    for folder in (DATA / "panda_mukca" / "panda_3", DATA / "data" / "panda_3", DATA / "panda_3")
    if os.environ.get("GTPIN_REAL_DATA") and folder.is_dir()
]
"""Where a set of github.com/platonics-delft/kinematics_calibration may be."""
JOINTS = [f"q{number}" for number in range(1, 8)]


def test_a_printer_s_nozzle_is_where_its_firmware_s_triangles_put_it(tmp_path: Path) -> None:
    urdf, arms, angles, radius = tmp_path / "printer.urdf", (215.0, 214.5, 216.0), (210.4, 329.9, 90.0), 111.27
    load("machines/printer").main(
        ["--radius", str(radius), "--arms", *map(str, arms), "--angles", *map(str, angles), "-o", str(urdf)]
    )
    kinematics = gtpin.read_model(str(urdf)).kinematics
    xyz = np.random.default_rng(0).uniform((-50.0, -50.0, 0.0), (50.0, 50.0, 60.0), (20, 3))
    q, poses = gtpin.commands_for(kinematics, 1e-3 * xyz)
    assert poses.reached.all()
    towers = radius * np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
    across = ((xyz[:, None, :2] - towers) ** 2).sum(axis=2)
    height = xyz[:, 2:] + np.sqrt(np.square(arms) - across)
    np.testing.assert_allclose(np.diff(q, axis=0), 1e-3 * np.diff(height, axis=0), atol=1e-9)


def sockets(folder: Path) -> None:
    """A set in its authors' layout: two places, one of which has one socket alone."""
    rng = np.random.default_rng(1)
    for name in ("front/hole_0", "front/hole_1", "left/hole_0"):
        file = folder / f"{name}.csv"
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(file, rng.uniform(-1.0, 1.0, (4, 7)), delimiter=",")
        np.savetxt(folder / f"{name}_pose.csv", np.tile([0.4, 0.1, 0.2, 0.0, 1.0, 0.0, 0.0], (4, 1)), delimiter=",")


def test_both_layouts_of_the_sockets_are_one_dataset_without_the_controller_s_poses(tmp_path: Path) -> None:
    script = load("real/panda_sockets")
    sockets(tmp_path / "raw")
    script.main([str(tmp_path / "raw"), "-o", str(tmp_path / "first")])
    found = pd.read_csv(tmp_path / "first" / "ball.csv")
    assert len(found) == 12
    np.testing.assert_allclose(
        found.loc[found["socket"] == "front/hole_1", JOINTS],
        np.loadtxt(tmp_path / "raw" / "front" / "hole_1.csv", delimiter=","),
    )
    poses = found.assign(socket=found["socket"] + "_pose", pose=found["pose"] + 100)
    (tmp_path / "table").mkdir()
    pd.concat([found, poses]).to_csv(tmp_path / "table" / "ball.csv", index=False)
    script.main([str(tmp_path / "table"), "-o", str(tmp_path / "second")])
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "second" / "ball.csv"), found)
    content = tomllib.loads((tmp_path / "second" / "dataset.toml").read_text(encoding="utf-8"))
    assert content["schema"] == "gtpin-dataset/2"
    assert len(gtpin.Dataset.read(tmp_path / "second")) == 12
    assert gtpin.load_robot(content["robot"], content["tcp"], content["actuators"]).n_actuators == 7
    (instrument,) = content["instrument"]
    assert (instrument["name"], instrument["kind"]) == ("ball", "socket")
    assert instrument["distances"] == [["front/hole_0", "front/hole_1", 0.05, 1e-4]]


def test_a_set_without_sockets_or_with_a_damaged_row_is_refused_in_one_line(tmp_path: Path) -> None:
    script = load("real/panda_sockets")
    (tmp_path / "empty").mkdir()
    sockets(tmp_path / "short")
    (tmp_path / "short" / "front" / "hole_0.csv").write_text("1,2,3\n", encoding="utf-8")
    sockets(tmp_path / "blank")
    (tmp_path / "blank" / "front" / "hole_0.csv").write_text("1,2,3,4,5,,7\n", encoding="utf-8")
    for name in ("empty", "short", "blank"):
        with pytest.raises(SystemExit) as refused:
            script.main([str(tmp_path / name), "-o", str(tmp_path / "out")])
        assert len(str(refused.value).splitlines()) == 1
        assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not SETS, reason="GTPIN_REAL_DATA names no folder with the measured data")
def test_two_sockets_of_the_real_tool_are_where_a_nominal_arm_puts_them_50_mm_apart() -> None:
    """A Panda that nobody has calibrated is a few millimetres off over its workspace, and less over 50 mm."""
    table = load("real/panda_sockets").table_of(SETS[0])
    robot = gtpin.load_robot("panda", "panda_link8", [f"panda_joint{number}" for number in range(1, 8)])
    poses = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(table[JOINTS].to_numpy())
    names, at = np.unique(table["socket"], return_inverse=True)
    # The ball in the flange's frame and each socket in the base's, by least squares: T + R ball = socket.
    A = np.zeros((len(at), 3, 3 + 3 * len(names)))
    A[:, :, :3] = poses.R
    for row, socket in enumerate(at):
        A[row, :, 3 + 3 * socket : 6 + 3 * socket] = -np.eye(3)
    found = np.linalg.lstsq(A.reshape(-1, A.shape[2]), -poses.T.ravel())[0]
    point = dict(zip(names, found[3:].reshape(-1, 3), strict=True))
    apart = [np.linalg.norm(point[f"{place}/hole_0"] - point[f"{place}/hole_1"]) for place in {n[:-7] for n in names}]
    assert len(apart) >= 2
    np.testing.assert_allclose(apart, 0.05, atol=0.003)
