"""URDF: loaded by Pinocchio and yourdfpy, its loops closed by the tests; well-formed for Isaac Sim's importer; and with
the YAML of example-parallel-robots, read by its loader where it is there."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from drawn_machines import Drawn
from placed import Placed

import gtpin
from gtpin.export import export

Anchor = tuple[int, "pin.SE3"]


def anchor(model: pin.Model, element: Element | None) -> Anchor:
    """The point that <link1> or <link2> tells, on a joint."""
    assert element is not None
    frame = model.frames[model.getFrameId(element.get("link"), pin.FrameType.BODY)]
    point = np.array([float(x) for x in element.get("xyz", "").split()])
    return frame.parentJoint, frame.placement * pin.SE3(np.eye(3), point)


class Loops:
    """Anchors that must coincide, and the driven joints in the order of q."""

    def __init__(self, model: pin.Model, ends: list[tuple[Anchor, ...]], drives: list[str]) -> None:
        self.model, self.data, self.ends = model, model.createData(), ends
        joints = [model.getJointId(name) for name in drives]
        self.driven = [model.idx_vs[j] for j in joints]
        self.driven_q = [model.idx_qs[j] for j in joints]
        self.free = np.setdiff1d(np.arange(model.nv), self.driven)

    def worst(self, robot: gtpin.Robot, q: np.ndarray, poses: gtpin.Poses) -> tuple[float, float]:
        """Largest difference, m and rad, to poses at commands q (N, n), each reached from home in small strides."""
        home, position, turn = robot.home_q, 0.0, 0.0
        start = self.closed(self.with_drives(pin.neutral(self.model), home))
        frame = self.model.getFrameId(robot.tcp_frame, pin.FrameType.BODY)
        for row, T, R in zip(q, poses.T, poses.R, strict=True):
            x = start
            for share in np.linspace(0.0, 1.0, 9)[1:]:
                x = self.closed(self.with_drives(x, home + share * (row - home)))
            pin.framesForwardKinematics(self.model, self.data, x)
            there = self.data.oMf[frame]
            position = max(position, float(np.abs(there.translation - T).max()))
            turn = max(turn, float(np.linalg.norm(pin.log3(there.rotation @ R.T))))
        return position, turn

    def with_drives(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        x = x.copy()
        x[self.driven_q] = q
        return x

    def closed(self, x: np.ndarray) -> np.ndarray:
        for _ in range(30):
            pin.computeJointJacobians(self.model, self.data, x)
            gap, J = zip(*(self._gap(*pair) for pair in self.ends), strict=True)
            if np.abs(np.concatenate(gap)).max() < 1e-12:
                return x
            step = np.zeros(self.model.nv)
            step[self.free] = np.linalg.solve(np.vstack(J)[:, self.free], -np.concatenate(gap))
            x = pin.integrate(self.model, x, step)
        raise AssertionError("the loops don't close")

    def _gap(self, one: Anchor, other: Anchor) -> tuple[np.ndarray, np.ndarray]:
        (p, J), (r, K) = self._point(*one), self._point(*other)
        return p - r, J - K

    def _point(self, joint: int, placement: pin.SE3) -> tuple[np.ndarray, np.ndarray]:
        where = self.data.oMi[joint]
        arm = where.rotation @ placement.translation
        if joint == 0:
            return arm, np.zeros((3, self.model.nv))
        J = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
        return where.translation + arm, J[:3] - pin.skew(arm) @ J[3:]


@pytest.mark.slow
def test_pinocchio_closes_it_where_the_model_is(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    file, robot = exported(".urdf"), drawn.model.robot
    model = pin.buildModelFromUrdf(str(file))
    root = ElementTree.parse(file).getroot()
    ends = [tuple(anchor(model, loop.find(end)) for end in ("link1", "link2")) for loop in root.iter("loop_joint")]
    loops = Loops(model, ends, [a.joint for a in robot.actuators])
    assert max(loops.worst(robot, drawn.q, drawn.poses)) < 1e-9


def test_yourdfpy_puts_both_ends_of_every_loop_in_one_place(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    """yourdfpy moves what it knows to move; where the platform floats is told by the model."""
    file, robot = exported(".urdf"), drawn.model.robot
    other = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    assert other.validate()
    again = gtpin.load_robot(file, tcp=robot.tcp_frame)
    home = gtpin.home(again)
    base, platform = other.base_link, robot.description.platform
    for q in drawn.q[:10]:
        posture = home.moved_to(q)
        other.update_cfg(_coordinates(again, posture.configuration, other.actuated_joint_names))
        floating = _pose(other, platform, robot.tcp_frame)
        where = Placed(posture.R, posture.T) @ floating.inverse()
        for loop in robot.description.loops:
            told = next(e for e in again.description.loops if e.name == loop.name)
            ends = []
            for end in (told.anchor1, told.anchor2):
                on_platform = end.link in _below(other, platform)
                link = where @ _pose(other, platform, end.link) if on_platform else _pose(other, base, end.link)
                ends.append(link.at(np.array(end.xyz)))
            np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)


def test_loops_have_the_form_that_isaac_documents(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    """<loop_joint name type><link1 link xyz rpy/><link2 link xyz rpy/></loop_joint> under <robot>, of links that exist.

    Special characters in names become underscores there, so that there must be none.
    """
    root = ElementTree.parse(exported(".urdf")).getroot()
    links = {link.get("name") for link in root.findall("link")}
    names = [element.get("name", "") for tag in ("link", "joint", "loop_joint") for element in root.findall(tag)]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)
    loops = root.findall("loop_joint")
    assert len(loops) == 6
    for loop in loops:
        assert set(loop.attrib) == {"name", "type"}
        assert loop.get("type") == "spherical"
        assert [end.tag for end in loop] == ["link1", "link2"]
        for end in loop:
            assert set(end.attrib) == {"link", "xyz", "rpy"}
            assert end.get("link") in links
            assert all(len([float(x) for x in end.get(key, "").split()]) == 3 for key in ("xyz", "rpy"))


def _coordinates(robot: gtpin.Robot, configuration: np.ndarray, names: list[str]) -> np.ndarray:
    model = robot.model
    return np.array([configuration[model.idx_qs[model.getJointId(name)]] for name in names])


def _pose(urdf: yourdfpy.URDF, base: str, link: str) -> Placed:
    matrix = urdf.get_transform(link, base)
    return Placed(matrix[:3, :3], matrix[:3, 3])


def _below(urdf: yourdfpy.URDF, link: str) -> set[str]:
    found = {link}
    for joint in urdf.robot.joints * 4:
        if joint.parent in found:
            found.add(joint.child)
    return found


def read(file: Path) -> dict[str, list]:
    """Its lines are JSON, which is YAML."""
    pairs = (line.split(": ", 1) for line in file.read_text(encoding="utf-8").splitlines())
    return {key: json.loads(value) for key, value in pairs}


@pytest.mark.slow
def test_frames_of_both_files_close_it_where_the_model_is(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    file = exported(".yaml")
    told = read(file)
    assert set(told["type"]) == {"3d"}
    model = pin.buildModelFromUrdf(str(file.with_suffix(".urdf")))
    ends = []
    for pair in told["closed_loop"]:
        frames = [model.frames[model.getFrameId(name)] for name in pair]
        ends.append(tuple((frame.parentJoint, frame.placement) for frame in frames))
    loops = Loops(model, ends, told["name_mot"])
    assert max(loops.worst(drawn.model.robot, drawn.q, drawn.poses)) < 1e-9


def test_the_loader_itself_takes_them(
    drawn: Drawn, exported: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    loader = pytest.importorskip("example_parallel_robots.loader_tools")
    exported(".yaml")
    folder = exported(".yaml").parent
    model, constraints, actuation, _, _ = loader.completeRobotLoader(str(folder), "robot.urdf", "robot.yaml")
    ends = [((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement)) for c in constraints]
    drives = [a.joint for a in drawn.model.robot.actuators]
    assert list(actuation.mot_joints_names) == drives
    assert max(Loops(model, ends, drives).worst(drawn.model.robot, drawn.q, drawn.poses)) < 1e-9


def test_a_robot_without_loops_is_refused(tmp_path: Path) -> None:
    with pytest.raises(gtpin.GtpinError, match="ur5 has no loops"):
        export(gtpin.read_model("ur5"), tmp_path / "out.yaml")
    assert not list(tmp_path.iterdir())
