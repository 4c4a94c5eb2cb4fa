"""SDF: a graph with real loops, read by the tests and solved by their own closures."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import Drawn
from scipy.spatial.transform import Rotation
from sdf_graph import Graph, told

from gtpin.export import export


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
