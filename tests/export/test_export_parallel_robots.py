"""A URDF and its YAML: read as the loader of example-parallel-robots reads them, and by that loader where it is there."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pinocchio as pin
import pytest
from drawn_machines import Drawn
from pinocchio_loops import Loops

import gtpin
from gtpin.export import export


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
    position, turn = loops.worst(drawn.model.robot, drawn.q, drawn.poses)
    assert position < 1e-9
    assert turn < 1e-9


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
    position, turn = Loops(model, ends, drives).worst(drawn.model.robot, drawn.q, drawn.poses)
    assert position < 1e-9
    assert turn < 1e-9


def test_a_robot_without_loops_is_refused(tmp_path: Path) -> None:
    slides = "".join(
        f'<link name="part{k}"/><joint name="slide{k}" type="prismatic"><parent link="part{k - 1}"/><child link="part{k}"/>'
        f'<axis xyz="1 {k} 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
        for k in (1, 2)
    )
    arm = f'<robot name="arm"><link name="part0"/>{slides}</robot>'
    (tmp_path / "arm.urdf").write_text(arm, encoding="utf-8")
    model = gtpin.read_model(tmp_path / "arm.urdf")
    with pytest.raises(gtpin.GtpinError, match="arm has no loops"):
        export(model, tmp_path / "out.yaml")
    assert not (tmp_path / "out.yaml").exists()
    assert not (tmp_path / "out.urdf").exists()
