"""A robot's result does not depend on where its file puts the frames of joints along and about their own axes."""

from pathlib import Path
from xml.etree.ElementTree import Element, fromstring, tostring

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.data import InstrumentSection

ROBOTS = ("ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "so100", "z1", "talos_left_arm")


def origin_of(element: Element) -> pin.SE3:
    at = element.find("origin")
    xyz, rpy = ((at.get(k) or "0 0 0") if at is not None else "0 0 0" for k in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(rpy.split(), float)), np.array(xyz.split(), float))


def put(element: Element, placement: pin.SE3) -> None:
    at = element.find("origin")
    if at is None:
        at = Element("origin")
        element.insert(0, at)
    at.set("xyz", " ".join(repr(float(v)) for v in placement.translation))
    at.set("rpy", " ".join(repr(float(v)) for v in pin.rpy.matrixToRpy(placement.rotation)))


def rewritten(robot: gtpin.Robot, rng: np.random.Generator, far: float, turn: float) -> str:
    """The same machine in a file whose joints' frames are moved along (``far``, m) and turned about their own axes.

    Where the frame of a joint's link is the TCP, that joint stays as it is.
    """
    root = fromstring(robot.description.xml)
    links = {link.get("name"): link for link in root.findall("link")}
    for joint in root.findall("joint"):
        child = joint.find("child").get("link")
        if joint.get("type") not in ("revolute", "continuous", "prismatic") or child == robot.tcp_frame:
            continue
        given = joint.find("axis")
        axis = np.array((given.get("xyz") if given is not None else "1 0 0").split(), float)
        axis /= np.linalg.norm(axis)
        moved = pin.SE3(
            pin.exp3(axis * rng.uniform(-turn, turn)), axis * far * rng.choice([-1, 1]) * rng.uniform(0.5, 1.0)
        )
        put(joint, origin_of(joint) * moved)
        carried = [other for other in root.findall("joint") if other.find("parent").get("link") == child]
        for part in [*carried, *links[child].findall("inertial")]:
            put(part, moved.inverse() * origin_of(part))
    return tostring(root, encoding="unicode")


def loaded(tmp_path: Path, name: str, xml: str) -> gtpin.Robot:
    (tmp_path / name).write_text(xml)
    return gtpin.load_robot(tmp_path / name)


@pytest.mark.parametrize("name", ROBOTS)
def test_frames_that_are_far_out_are_brought_to_one_place(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(5)
    plain = gtpin.load_robot(name)
    one, two = (loaded(tmp_path, f"{far}.urdf", rewritten(plain, rng, far, 3.0)) for far in (100.0, 500.0))
    for model in (one.model, two.model):
        assert [np.round(i.mass, 9) for i in model.inertias] == [np.round(i.mass, 9) for i in plain.model.inertias]
    q = pin.neutral(plain.model)
    places = []
    for robot in (one, two):
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, q)
        places.append(np.array([M.translation for M in data.oMi]))
    assert np.abs(places[0] - places[1]).max() < 1e-9
    assert np.abs(places[0]).max() < 10.0
    commands = rng.uniform(-1.0, 1.0, (20, plain.n_actuators))
    expected = plain.forward(commands)
    for robot in (one, two):
        poses = robot.forward(commands)
        assert np.abs(poses.T - expected.T).max() < 1e-9
        assert np.abs(poses.R - expected.R).max() < 1e-9
        still = np.zeros_like(commands)
        torques = [r.inverse_dynamics(commands, still, still) for r in (plain, robot)]
        assert np.abs(torques[0] - torques[1]).max() < 1e-6 * np.abs(torques[0]).max()


def test_two_files_of_one_machine_give_one_result(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    plain = gtpin.load_robot("ur5")
    real = plain.model.copy()
    for j in range(1, real.njoints):
        real.jointPlacements[j] = real.jointPlacements[j] * pin.exp6(2e-4 * rng.standard_normal(6))
    q = rng.uniform(-2.0, 2.0, (80, 6))
    data, tip = real.createData(), real.getFrameId(plain.tcp_frame)
    T, quaternions = np.empty((80, 3)), np.empty((80, 4))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(real, data, row)
        T[i] = data.oMf[tip].translation + 3e-5 * rng.standard_normal(3)
        x, y, z, w = pin.Quaternion(data.oMf[tip].rotation @ pin.exp3(1e-4 * rng.standard_normal(3))).coeffs()
        quaternions[i] = w, x, y, z
    found = []
    for far in (100.0, 500.0):
        loaded(tmp_path, f"{far}.urdf", rewritten(plain, rng, far, 0.0))
        instrument = InstrumentSection(position_sigma=3e-5, orientation_sigma=1e-4, frame="robot")
        dataset = gtpin.Dataset(
            robot=str(tmp_path / f"{far}.urdf"),
            pose=np.arange(80),
            q=q,
            position=T,
            orientation=quaternions,
            instrument=instrument,
        )
        found.append(gtpin.diagnose(dataset))
    one, two = found
    assert one.verdict == two.verdict == "none"
    assert one.model.geometry.names == two.model.geometry.names
    sigma = np.sqrt(np.diag(one.model.covariance))
    assert np.abs((one.model.geometry.values - two.model.geometry.values) / sigma).max() < 1e-4
    for number, result in enumerate(found):
        written = loaded(tmp_path, f"out{number}.urdf", result.model.kinematics.urdf())
        assert np.abs(written.forward(q).T - result.model.kinematics.forward(q).T).max() < 1e-9
