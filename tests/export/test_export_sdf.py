"""SDF: a graph with real loops, read by the tests and solved by their own closures."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from closures import Closures
from drawn_machines import Drawn
from placed import Placed
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.export import export


class Graph:
    """The links and joints of an SDF at the poses in the file."""

    def __init__(self, file: Path) -> None:
        model = ElementTree.parse(file).getroot().find("model")
        assert model is not None
        self.links = {link.get("name", ""): Placed.of(told(link, "pose")) for link in model.findall("link")}
        self.joints = {joint.get("name", ""): joint for joint in model.findall("joint")}
        self.mass = sum(float(mass.text or "") for mass in model.iter("mass"))
        for frame in model.findall("frame"):
            self.links[frame.get("name", "")] = self.links[frame.get("attached_to", "")] @ Placed.of(
                told(frame, "pose")
            )

    def place(self, joint: Element) -> Placed:
        return self.links[told(joint, "child")] @ Placed.of(told(joint, "pose"))

    def closures(self, robot: gtpin.Robot) -> Closures:
        """A rod for each ball joint, by following joints from its links to the platform and to the base; travel from home."""
        drives, platform = [a.joint for a in robot.actuators], robot.description.platform
        kind, rods = "", []
        for ball in self.joints.values():
            if ball.get("type") != "ball":
                continue
            one, other = (list(self.chain(told(ball, end))) for end in ("child", "parent"))
            rod, carried = (one, other) if one and told(one[-1], "parent") == platform else (other, one)
            (moved,) = (joint for joint in (*rod, *carried) if joint.get("name") in drives)
            kind = "leg" if moved in rod else "track" if moved.get("type") == "prismatic" else "arm"
            place, axis = self.place(moved), np.array([float(word) for word in told(moved, "axis/xyz").split()])
            ends = self.place(rod[-1]).T, self.place(ball).T
            rods.append((drives.index(moved.get("name", "")), *ends, place.R @ axis, place.T))
        driver, hangs, seats, axes, origins = (np.array(values) for values in zip(*rods, strict=True))
        tcp, lengths = self.links[robot.tcp_frame], np.linalg.norm(hangs - seats, axis=1)
        own, still = (hangs - tcp.T) @ tcp.R, np.zeros(len(drives))
        return Closures("", "", kind, driver, own, seats, lengths, axes, origins, still, tcp.T, tcp.R)

    def chain(self, link: str) -> Iterator[Element]:
        """The joints that carry a link, up to the base or the platform."""
        for joint in self.joints.values():
            if told(joint, "child") == link and joint.get("type") not in ("ball", "fixed"):
                yield joint
                yield from self.chain(told(joint, "parent"))


def told(element: Element, path: str) -> str:
    text = element.findtext(path)
    assert text is not None
    return text


@pytest.mark.slow
def test_the_graph_closes_where_the_model_is(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    graph, robot = Graph(exported(".sdf")), drawn.model.robot
    closures = graph.closures(robot)
    assert len(closures.L0) == 6
    T, R = closures.follow(drawn.q - robot.home_q, 0.05)
    assert np.abs(T - drawn.poses.T).max() < 1e-9
    assert Rotation.from_matrix(R @ np.swapaxes(drawn.poses.R, 1, 2)).magnitude().max() < 1e-9


def test_every_loop_is_a_joint_and_nothing_else_holds_the_platform(
    drawn: Drawn, exported: Callable[[str], Path]
) -> None:
    graph, robot = Graph(exported(".sdf")), drawn.model.robot
    for loop in robot.description.loops:
        ball = graph.joints[loop.name]
        assert ball.get("type") == "ball"
        assert {told(ball, "parent"), told(ball, "child")} == {loop.anchor1.link, loop.anchor2.link}
    assert not [j for j in graph.joints.values() if told(j, "child") == robot.description.platform]
    assert {*robot.sites, *(rod.link for rod in robot.rods), "platform"} <= set(graph.links)


def test_masses_are_the_urdfs(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    told_mass = sum(inertia.mass for inertia in drawn.model.robot.model.inertias)
    assert Graph(exported(".sdf")).mass == pytest.approx(told_mass, rel=1e-12)


@pytest.mark.slow
def test_ranges_are_counted_from_the_pose_in_the_file(drawn_of: Callable[[str], Drawn], tmp_path: Path) -> None:
    drawn = drawn_of("stewart")
    export(drawn.model, tmp_path / "stewart.sdf")
    robot = drawn.model.robot
    for k, actuator in enumerate(robot.actuators):
        axis = Graph(tmp_path / "stewart.sdf").joints[actuator.joint].find("axis")
        assert axis is not None
        range_ = np.array([float(told(axis, f"limit/{end}")) for end in ("lower", "upper")])
        home = float(told(axis, "{urn:gtpin}home"))
        assert home == robot.home_q[k]
        np.testing.assert_allclose(range_ + home, [actuator.lower, actuator.upper], rtol=0, atol=1e-12)


@pytest.mark.skipif(not (shutil.which("gz") or shutil.which("ign")), reason="no gz sdf here")
def test_gazebos_own_parser_finds_no_fault(drawn: Drawn, exported: Callable[[str], Path]) -> None:
    command = shutil.which("gz") or shutil.which("ign")
    assert command is not None
    checked = subprocess.run([command, "sdf", "--check", str(exported(".sdf"))], capture_output=True, text=True)
    assert "Valid" in checked.stdout
    assert "Error" not in checked.stderr
