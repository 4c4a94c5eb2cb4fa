"""A scene in the style of MuJoCo Menagerie as the nominal robot: objects beside it, meshes that are missing, measured poses."""

import re
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.errors import RobotError

mujoco = pytest.importorskip("mujoco")

ARM, SCENE = ((Path(__file__).parent / "menagerie" / name).read_text() for name in ("arm.xml", "scene.xml"))
ZERO, HALF = 1.2e-3, 2e-4
"""rad: the zero of ``lift`` is off, and half the play of ``elbow``."""
LOWER = np.array([-2.0, -1.8, 0.4, -1.5, -1.5, -2.0])
UPPER = np.array([2.0, -0.2, 2.2, 1.5, 1.5, 2.0])


def in_folder(folder: Path, scene: str = SCENE, arm: str = ARM) -> Path:
    """The files as somebody downloads them, without the meshes."""
    (folder / "arm.xml").write_text(arm, encoding="utf-8")
    (folder / "scene.xml").write_text(scene, encoding="utf-8")
    return folder / "scene.xml"


def commands(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return LOWER + (UPPER - LOWER) * rng.random((n, 6)), rng.choice([-1.0, 1.0], (n, 6))


def real_machine(q: np.ndarray, approach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and quaternions of the tool by MuJoCo: a zero that is off, and lost motion."""
    model = mujoco.MjModel.from_xml_string(re.sub(r"<mesh [^>]*/>|<geom class=.visual.[^>]*/>", "", ARM))
    data, found = mujoco.MjData(model), []
    for row, came in zip(q, approach, strict=True):
        data.qpos[:] = row
        data.qpos[1] += ZERO
        data.qpos[2] -= HALF * came[2]
        mujoco.mj_kinematics(model, data)
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, data.site("attachment_site").xmat)
        found.append(np.concatenate([data.site("attachment_site").xpos, turn]))
    poses = np.array(found)
    return poses[:, :3], poses[:, 3:]


def measurements(folder: Path) -> Path:
    """A dataset beside the scene: 120 poses with the noise of a laser tracker."""
    q, approach = commands(120, 11)
    (T, R), rng = real_machine(q, approach), np.random.default_rng(12)
    T = T + rng.normal(0.0, 1.5e-5, T.shape)
    tilted = np.empty_like(R)
    for row, turn, to in zip(R, np.c_[np.ones(len(q)), rng.normal(0.0, 2.5e-5, (len(q), 3))], tilted, strict=True):
        mujoco.mju_mulQuat(to, turn / np.linalg.norm(turn), row)
    target = folder / "data"
    target.mkdir()
    ways = range(1, 7)
    head = ["pose", *(f"q{i}" for i in ways), *"xyz", "qw", "qx", "qy", "qz", *(f"approach{i}" for i in ways)]
    rows = [
        ",".join([str(i), *(f"{value:.12g}" for value in row)])
        for i, row in enumerate(np.hstack([q, T, tilted, approach]))
    ]
    (target / "poses.csv").write_text("\n".join([",".join(head), *rows]), encoding="utf-8")
    (target / "dataset.toml").write_text(
        'schema = "gtpin-dataset/1"\nrobot = "../scene.xml"\ntcp = "attachment_site"\n'
        '[instrument]\nposition_sigma = 1.5e-5\norientation_sigma = 5e-5\nframe = "robot"\n',
        encoding="utf-8",
    )
    return target


def test_objects_of_the_scene_are_not_of_the_robot(tmp_path: Path) -> None:
    robot = gtpin.load_robot(in_folder(tmp_path))
    assert robot.sites == ("pan", "lift", "elbow", "wrist1", "wrist2", "wrist3")
    np.testing.assert_array_equal(robot.home_q, [0.0, -1.0, 1.5, 0.3, 0.2, 0.0])  # the arm's keyframe
    assert {"table", "base"} <= {frame.name for frame in robot.model.frames}
    assert not {"cube", "door"} & {frame.name for frame in robot.model.frames}


def test_without_actuators_only_what_floats_is_an_object(tmp_path: Path) -> None:
    arm = re.sub(r"<actuator>.*</actuator>|<keyframe>.*</keyframe>", "", ARM, flags=re.DOTALL)
    robot = gtpin.load_robot(in_folder(tmp_path, arm=arm))
    assert set(robot.sites) == {"pan", "lift", "elbow", "wrist1", "wrist2", "wrist3", "door_hinge"}


def test_a_body_on_the_world_that_is_driven_is_of_the_robot(tmp_path: Path) -> None:
    """A gantry's second axis, say, or a turntable."""
    driven = SCENE.replace("</mujoco>", '<actuator><motor joint="door_hinge"/></actuator></mujoco>')
    with pytest.raises(RobotError, match="keyframe home has 6 numbers for 14 coordinates of joints"):
        gtpin.load_robot(in_folder(tmp_path, driven))
    arm = re.sub(r"<keyframe>.*</keyframe>", "", ARM, flags=re.DOTALL)
    assert gtpin.load_robot(in_folder(tmp_path, driven, arm)).n_actuators == 7


@pytest.mark.slow
def test_an_offset_and_a_backlash_are_found_in_poses_beside_a_scene(tmp_path: Path) -> None:
    in_folder(tmp_path)
    dataset = gtpin.Dataset.read(measurements(tmp_path))
    found = gtpin.diagnose(dataset)
    assert [(cause.effect, cause.site) for cause in found.causes] == [("backlash", "elbow")]
    half = found.causes[0].parameters["half_width"]
    assert abs(half.value + HALF) < 4.0 * half.sigma
    q, approach = commands(50, 13)
    expected, _ = real_machine(q, approach)
    ways = {f"approach{i + 1}": approach[:, i] for i in range(6)}
    off = np.linalg.norm(found.model.predict(q, ways).T - expected, axis=1)
    nominal = np.linalg.norm(gtpin.Model(gtpin.Geometry.nominal(found.model.robot)).predict(q).T - expected, axis=1)
    assert nominal.max() > 3e-4
    assert off.max() < 3e-5
