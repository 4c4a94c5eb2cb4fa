"""Tilt sensors on any link: what they read, its derivatives, and causes that one of them shows alone; by Pinocchio alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from virtual_stations import written

import gtpin
from gtpin.data.instrument_tables import TiltTable
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import DatasetError
from gtpin.instruments.instrument import Read
from gtpin.instruments.readings import Readings
from gtpin.instruments.tilt import Tilt
from gtpin.kinematics.kinematics import Kinematics

Floats = np.ndarray
STEP, NOISE, MOUNT = 1e-6, 5e-5, 5e-3
UP = np.array([0.0, 0.0, 1.0])
LINKS = ("base", "link1", "link2", "link3", "tool0")
PLACES = ((0.0, 0.0, 0.3), (0.12, 0.05, 0.2), (0.0, 0.0, 0.6))
MASSES = (12.0, 9.0, 6.0)


def urdf(file: Path, first: str = "0 0 1") -> Path:
    """An arm of three turning joints J1 to J3 with masses; ``first``: axis of J1."""
    parts = ['<robot name="arm"><link name="base"/>']
    for i, ((x, y, z), mass, axis) in enumerate(zip(PLACES, MASSES, (first, "0 1 0", "0 1 0"), strict=True), 1):
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="0.02 0 0.25"/><mass value="{mass}"/>'
            '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="J{i}" type="revolute"><parent link="{LINKS[i - 1]}"/><child link="link{i}"/>'
            f'<origin xyz="{x} {y} {z}" rpy="0.1 0 0.2"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="9" velocity="1"/></joint>'
        )
    tool = '<link name="tool0"/><joint name="t" type="fixed"><parent link="link3"/><child link="tool0"/>'
    file.write_text(f'{"".join(parts)}{tool}<origin xyz="0.05 0 0.4"/></joint></robot>')
    return file


@dataclass(frozen=True)
class Arm:
    """A machine: Pinocchio's model of the nominal arm, and of the machine with its errors."""

    file: Path
    nominal: pin.Model
    true: pin.Model

    @staticmethod
    def drawn(folder: Path, rng: np.random.Generator, first: str = "0 0 1") -> Arm:
        """Its joints stand 0.3 mm and 0.3 mrad off."""
        file = urdf(folder / "arm.urdf", first)
        nominal, true = (pin.buildModelFromUrdf(str(file)) for _ in range(2))
        for joint in range(1, 4):
            error = pin.SE3(pin.exp3(rng.normal(0.0, 3e-4, 3)), rng.normal(0.0, 3e-4, 3))
            true.jointPlacements[joint] = true.jointPlacements[joint] * error
        return Arm(file, nominal, true)

    def rotation(self, q: Floats, link: str, model: pin.Model | None = None) -> Floats:
        """(3, 3) of a link."""
        model = self.true if model is None else model
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        return np.array(data.oMf[model.getFrameId(link)].rotation)

    def moments(self, q: Floats) -> Floats:
        """(6,) force, N, and moment, N m, of gravity on J1, in its placement frame, of the machine."""
        data = self.true.createData()
        pin.forwardKinematics(self.true, data, q)
        pin.rnea(self.true, data, q, np.zeros(3), np.zeros(3))
        own = data.f[1]  # what holds the links up, in the frame of the moved joint
        back = pin.SE3(np.array(data.oMi[1].rotation), np.zeros(3))
        placed = pin.SE3(np.array(self.true.jointPlacements[1].rotation), np.zeros(3))
        return -np.asarray(placed.actInv(back.act(own)).vector)


def folder_of(folder: Path, arm: Arm, q: Floats, tilts: Floats, link: str | None, **said: object) -> Path:
    keys = {"name": "level", "kind": "tilt", "sigma": NOISE} | ({"link": link} if link else {}) | said
    toml = {"schema": "gtpin-dataset/2", "robot": str(arm.file), "instrument": [keys]}
    columns = {"pose": [f"p{i}" for i in range(len(q))]} | {f"q{i + 1}": list(q[:, i]) for i in range(q.shape[1])}
    return written(folder, toml, {"level": columns | {"tilt_x": list(tilts[:, 0]), "tilt_y": list(tilts[:, 1])}})


@pytest.mark.parametrize("link", LINKS)
def test_readings_and_their_derivatives_are_those_of_pinocchio_s_rotation_of_the_link(
    tmp_path: Path, link: str
) -> None:
    arm = Arm.drawn(tmp_path, np.random.default_rng(0))
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 3))

    def read(q: Floats) -> Floats:
        return np.array([arm.rotation(row, link, arm.nominal)[:, :2].T @ UP for row in q])

    dataset = gtpin.Dataset.read(folder_of(tmp_path / "set", arm, q, read(q), link, mount_sigma=0.0))
    robot = gtpin.load_robot(arm.file).measuring([], [link])
    kinematics = Kinematics(gtpin.Geometry.nominal(robot))
    poses, readings = kinematics.forward(q), Readings.of(dataset, robot)
    assert np.abs(readings.residual_at(poses)).max() < 1e-12
    found = readings.by_motion(poses) @ kinematics.command_jacobian(q, poses)
    slopes = [(read(q + h) - read(q - h)) / (2.0 * STEP) for h in STEP * np.eye(3)]
    np.testing.assert_allclose(found, np.stack(slopes, axis=2), rtol=0, atol=1e-8)
    # A link is moved by the joints that carry it.
    assert np.abs(found).max(axis=(0, 1)).astype(bool).tolist()[1:] == [link not in LINKS[:2], link not in LINKS[:3]]


def test_a_link_that_is_not_there_is_refused_with_the_nearest_names(tmp_path: Path) -> None:
    arm = Arm.drawn(tmp_path, np.random.default_rng(0))
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 3))
    dataset = gtpin.Dataset.read(folder_of(tmp_path / "set", arm, q, np.zeros((20, 2)), "lnik2"))
    with pytest.raises(DatasetError, match="arm has no link 'lnik2'") as caught:
        gtpin.calibrate(dataset)
    assert caught.value.column == "instrument.0.link"
    assert "did you mean link2" in caught.value.hint


def test_the_base_is_seen_to_turn_with_the_frame_and_as_far_as_it_rocks(tmp_path: Path) -> None:
    """To first order and exactly alike; geometry does not move it, and nothing else does."""
    arm = Arm.drawn(tmp_path, np.random.default_rng(0))
    robot = gtpin.load_robot(arm.file).measuring([], ["base", "link2"])
    here, q = Kinematics(gtpin.Geometry.nominal(robot)), np.random.default_rng(1).uniform(-1.0, 1.0, (8, 3))
    poses, covariates = here.forward(q), {"time": np.arange(8.0)}
    at = OperatingPoints(here, q, poses, covariates)
    assert not here.geometry_jacobian(q, poses)[:, 6:9].any()
    for name, site, moves in (
        ("tracker_drift", "frame", True),
        ("bearing_compliance", "J1", True),
        ("joint_compliance", "J1", False),
        ("bearing_compliance", "J2", False),
        ("target_drift", "platform", False),
    ):
        basis = effects_by_id()[name].basis_of(at, site, ())
        c = np.random.default_rng(2).standard_normal(len(basis)) * basis.sigma * 1e-2
        first = basis.displacement(at) @ c
        assert first[:, 6:9].any() == moves, name
        active = ActiveEffect(effects_by_id()[name], site, None, c, np.zeros((len(c),) * 2), at.references)
        moved = with_effects(here, q, covariates, [active])
        for i, link in enumerate(("base", "link2")):
            turns = np.array([pin.log3(a @ b.T) for a, b in zip(moved.links[link], poses.links[link], strict=True)])
            np.testing.assert_allclose(first[:, 6 + 3 * i : 9 + 3 * i], turns, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_is_mounted_in_any_way_finds_its_mounting(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, q = Arm.drawn(tmp_path, rng), rng.uniform(-1.0, 1.0, (40, 3))
    mount = pin.exp3(2.0 * (axis := rng.standard_normal(3)) / np.linalg.norm(axis))
    tilts = np.array([(arm.rotation(row, "link2") @ mount)[:, :2].T @ UP for row in q])
    tilts += rng.normal(0.0, NOISE, tilts.shape)
    dataset = gtpin.Dataset.read(folder_of(tmp_path / "set", arm, q, tilts, "link2", mount_sigma=2.0))
    found = gtpin.calibrate(dataset)
    assert found.chi2 / found.dof < 1.5
    turned = np.array([found.unknown(f"level.mount.{axis}").value for axis in ("rx", "ry", "rz")])
    assert np.linalg.norm(pin.log3(pin.exp3(turned).T @ mount)) < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("effect", "first", "link"), [("joint_compliance", "1 0 0", "link2"), ("bearing_compliance", "0 0 1", "link1")]
)
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_a_compliance_of_the_first_joint_is_found_by_one_sensor_on_a_link_alone(
    tmp_path: Path, effect: str, first: str, link: str, seed: int
) -> None:
    """The drive of a level first joint gives way about it; the bearing of an upright one tilts under the moment across it."""
    rng = np.random.default_rng(100 + seed)
    arm, q, c = Arm.drawn(tmp_path, rng, first), rng.uniform(-1.0, 1.0, (150, 3)), 2e-5
    mount, tilts = pin.exp3(rng.normal(0.0, MOUNT, 3)), np.empty((len(q), 2))
    axis = np.array([float(x) for x in first.split()])
    for i, row in enumerate(q):
        moment = arm.moments(row)[3:]
        way = axis if effect == "joint_compliance" else np.eye(3) - np.outer(axis, axis)
        give = c * (way * (way @ moment) if way.ndim == 1 else way @ moment)
        bent = pin.Model(arm.true)
        bent.jointPlacements[1] = bent.jointPlacements[1] * pin.SE3(pin.exp3(give), np.zeros(3))
        tilts[i] = (arm.rotation(row, link, bent) @ mount)[:, :2].T @ UP + rng.normal(0.0, NOISE, 2)
    found = gtpin.diagnose(gtpin.Dataset.read(folder_of(tmp_path / "set", arm, q, tilts, link)))
    (cause,) = found.causes
    member = next(m for m in cause.members if (m.effect, m.site) == (effect, "J1"))
    name = "compliance" if effect == "joint_compliance" else "tilt"
    estimate = member.parameters[name]
    assert member.probability > 0.5
    assert abs(estimate.value - c) < 4.0 * estimate.sigma
    assert estimate.sigma < 0.1 * c


def test_a_sensor_on_the_tool_s_link_reads_what_one_on_the_platform_reads(tmp_path: Path) -> None:
    robot = gtpin.load_robot(urdf(tmp_path / "arm.urdf")).measuring([], ["tool0"])
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 3))
    poses, blank = Kinematics(gtpin.Geometry.nominal(robot)).forward(q), {"tilt_x": np.zeros(5), "tilt_y": np.zeros(5)}
    read = Read(blank, {}, np.full(5, -1), {})
    on_link, on_platform = (
        Tilt(TiltTable(name="level", kind="tilt", link=link), read, robot) for link in ("tool0", None)
    )
    u = np.array([0.01, -0.02, 0.03])
    np.testing.assert_allclose(on_link.predicted(poses, u), on_platform.predicted(poses, u), atol=1e-15)
    np.testing.assert_allclose(on_link.by_unknown(poses, u), on_platform.by_unknown(poses, u), atol=1e-15)
    away = replace(poses, R=poses.R[::-1])
    np.testing.assert_array_equal(on_link.predicted(away, u), on_link.predicted(poses, u))
