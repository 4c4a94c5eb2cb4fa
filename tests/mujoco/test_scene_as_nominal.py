"""A scene in the way of MuJoCo Menagerie is the nominal robot: poses are MuJoCo's, and faults put in there are found."""

from pathlib import Path

import numpy as np
import pytest

import gtpin

mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="arm">
  <compiler angle="radian" meshdir="assets" autolimits="true"/>
  <default><default class="arm">
    <joint axis="0 0 1" range="-3.1 3.1" damping="1" armature="0.1"/>
    <position kp="2000" kv="200"/>
    <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
  </default></default>
  <asset><mesh name="link0" file="link0.obj"/></asset>
  <worldbody>
    <body name="base" childclass="arm" pos="0 0 0.1">
      <geom class="visual" mesh="link0"/>
      <inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
      <body name="link1" pos="0 0 0.2">
        <inertial pos="0 0 0.05" mass="3" diaginertia="0.02 0.02 0.02"/><joint name="joint1"/>
        <body name="link2" pos="0 0.05 0.1" quat="0.70710678 0.70710678 0 0">
          <inertial pos="0.2 0 0" mass="2.5" diaginertia="0.02 0.02 0.02"/><joint name="joint2" range="-2 2"/>
          <body name="link3" pos="0.4 0 0">
            <inertial pos="0.15 0 0" mass="1.5" diaginertia="0.01 0.01 0.01"/><joint name="joint3"/>
            <body name="link4" pos="0.3 0 0.02" euler="0 1.5707963 0">
              <inertial pos="0 0 0.05" mass="0.8" diaginertia="0.003 0.003 0.003"/><joint name="joint4"/>
              <body name="link5" pos="0 0 0.1" euler="1.5707963 0 0">
                <inertial pos="0 0 0.03" mass="0.4" diaginertia="0.001 0.001 0.001"/><joint name="joint5"/>
                <body name="link6" pos="0 0 0.08" euler="-1.5707963 0 0">
                  <inertial pos="0 0 0.02" mass="0.2" diaginertia="0.0005 0.0005 0.0005"/><joint name="joint6"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position class="arm" joint="joint1"/><position class="arm" joint="joint2"/><position class="arm" joint="joint3"/>
    <position class="arm" joint="joint4"/><position class="arm" joint="joint5"/><position class="arm" joint="joint6"/>
  </actuator>
</mujoco>
"""
SCENE = """
<mujoco model="arm scene">
  <include file="arm.xml"/>
  <asset>
    <texture type="2d" name="ground" builtin="checker" width="300" height="300"/>
    <material name="ground" texture="ground"/>
  </asset>
  <worldbody>
    <light pos="0 0 1.5" dir="0 0 -1"/>
    <geom name="floor" size="0 0 0.05" type="plane" material="ground"/>
    <body name="cube" pos="0.5 0 0.03"><freejoint/><geom type="box" size="0.03 0.03 0.03" mass="0.1"/></body>
    <body name="table" pos="0.8 0 0"><geom type="box" size="0.2 0.2 0.2"/></body>
  </worldbody>
</mujoco>
"""
JOINTS = tuple(f"joint{i}" for i in range(1, 7))
ZERO, PLAY = 2e-3, 4e-4
"""What is put in: joint 2 stands so far from where it should, and joint 3 lags so far behind on either side, rad."""
POSITION, ORIENTATION = 2e-5, 5e-5


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files as a user has them: the mesh is missing."""
    folder = tmp_path_factory.mktemp("menagerie")
    (folder / "arm.xml").write_text(ARM, encoding="utf-8")
    (folder / "scene.xml").write_text(SCENE, encoding="utf-8")
    return folder / "scene.xml"


def poses(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and quaternions of the last link by MuJoCo, which does not load a model whose mesh is missing."""
    without = ARM.replace('<mesh name="link0" file="link0.obj"/>', "").replace(
        '<geom class="visual" mesh="link0"/>', ""
    )
    model = mujoco.MjModel.from_xml_string(SCENE.replace('<include file="arm.xml"/>', _inner(without)))
    data = mujoco.MjData(model)
    places = [model.joint(name).qposadr[0] for name in JOINTS]
    body = model.body("link6").id
    T, R = np.empty((len(q), 3)), np.empty((len(q), 4))
    for i, row in enumerate(q):
        data.qpos[places] = row
        mujoco.mj_kinematics(model, data)
        T[i], R[i] = data.xpos[body], data.xquat[body]
    return T, R


def _inner(xml: str) -> str:
    """What an <include> takes of a file: all within the root."""
    return xml.strip().removeprefix('<mujoco model="arm">').removesuffix("</mujoco>")


def test_things_in_the_scene_are_no_part_of_the_robot_and_its_poses_are_mujoco_s(scene: Path) -> None:
    robot = gtpin.load_robot(scene)
    assert robot.sites == JOINTS
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 6))
    T, R = poses(q)
    found = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q)
    np.testing.assert_allclose(found.T, T, atol=1e-9)
    same = np.abs((found.quaternions * R).sum(axis=1))
    np.testing.assert_allclose(same, 1.0, atol=1e-9)


def test_a_zero_and_play_that_mujoco_s_machine_has_are_found(scene: Path) -> None:
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.5, 1.5, (160, 6))
    q[120:] = q[:40]
    side = rng.choice((-1.0, 1.0), (160, 6))
    true = q.copy()
    true[:, 1] += ZERO
    true[:, 2] -= PLAY * side[:, 2]
    T, R = poses(true)
    R = R + ORIENTATION / 2.0 * rng.standard_normal(R.shape)
    covariates = {f"approach{i + 1}": side[:, i] for i in range(6)} | {f"speed{i + 1}": np.zeros(160) for i in range(6)}
    dataset = gtpin.Dataset(
        robot=str(scene),
        pose=[str(i if i < 120 else i - 120) for i in range(160)],
        q=q,
        position=T + POSITION * rng.standard_normal(T.shape),
        orientation=R / np.linalg.norm(R, axis=1, keepdims=True),
        instrument=gtpin.data.Instrument(position_sigma=POSITION, orientation_sigma=ORIENTATION),
        covariates=covariates,
    )
    found = gtpin.diagnose(dataset)
    (cause,) = found.causes
    assert (cause.effect, cause.site) == ("backlash", "joint3")
    low, high = cause.parameters["half_width"].interval
    assert low < -PLAY < high  # negative: it stops before its command
    assert found.verdict == "explained"
    other = rng.uniform(-1.4, 1.4, (100, 6))
    expected, _ = poses(other + ZERO * np.eye(6)[1] - PLAY * np.eye(6)[2])  # every joint comes from below
    below = {name: np.ones(100) for name in covariates}
    off = found.model.predict(other, below).T - expected
    assert np.sqrt((off**2).sum(axis=1).mean()) < 3.0 * POSITION
