"""LinuxCNC's probe logs."""

from __future__ import annotations

import numpy as np
import pytest
from printed import PROBE_LOG, Write
from typer.testing import CliRunner

import gtpin
from gtpin.errors import DatasetError
from gtpin.extras.importers.commands import import_app
from gtpin.extras.importers.linuxcnc_probe import read_linuxcnc_probe
from gtpin.extras.importers.touches import commands

MILL = """<robot name="mill">
  <link name="base"/><link name="x"/><link name="y"/><link name="tool0"/>
  <joint name="jx" type="prismatic"><parent link="base"/><child link="x"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="jy" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="jz" type="prismatic"><parent link="y"/><child link="tool0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"""


def test_named_axes_are_the_commands_in_metres_and_radians(write: Write) -> None:
    log = write("probe.txt", PROBE_LOG)
    q = read_linuxcnc_probe(log, "mm", "ZXYCB").q
    assert q is not None
    np.testing.assert_allclose(q[1], [-8.866e-6, -0.025, -0.05, np.pi / 2, np.pi / 6])
    q = read_linuxcnc_probe(log, "inch", "XYZ", zero=(0.1, 0.2, 0.3)).q
    assert q is not None
    np.testing.assert_allclose(q[1], [0.1 - 25 * 0.0254, 0.2 - 50 * 0.0254, 0.3 - 0.008866 * 0.0254])


def test_without_axes_the_commands_follow_from_the_robot(write: Write) -> None:
    kinematics = gtpin.read_model(str(write("mill.urdf", MILL))).kinematics
    log = write("probe.txt", PROBE_LOG)
    given, _ = commands(read_linuxcnc_probe(log, "mm", "xyz", zero=(0.0, 0.1, 0.0)), kinematics, np.zeros(3))
    found, poses = commands(read_linuxcnc_probe(log, "mm"), kinematics, np.array([0.0, 0.1, 0.0]))
    np.testing.assert_allclose(found, given, atol=1e-9)
    np.testing.assert_allclose(poses.T[2], [0.0, 0.1254, 0.011133e-3], atol=1e-9)


def test_a_line_that_lost_its_beginning_is_refused(write: Write) -> None:
    lines = PROBE_LOG.splitlines()
    with pytest.raises(DatasetError, match="row 2: the line has 2 numbers"):
        read_linuxcnc_probe(write("probe.txt", "\n".join([lines[0], lines[1][-11:], lines[2]])), "mm")


@pytest.mark.parametrize("axes", ["XX", "XYQ", "XY Z"])
def test_axes_that_a_log_does_not_have_are_refused(write: Write, axes: str) -> None:
    with pytest.raises(DatasetError, match="axes"):
        read_linuxcnc_probe(write("probe.txt", PROBE_LOG), "mm", axes)


def test_as_many_axes_are_needed_as_the_robot_has_actuators(write: Write) -> None:
    kinematics = gtpin.read_model("linear_delta").kinematics
    touches = read_linuxcnc_probe(write("probe.txt", PROBE_LOG), "mm", "XYZA")
    with pytest.raises(DatasetError, match="4 axes for the 3 actuators"):
        commands(touches, kinematics, np.zeros(3))


def test_a_place_that_the_robot_can_t_reach_is_named_by_its_row(write: Write) -> None:
    kinematics = gtpin.read_model("linear_delta").kinematics
    far = PROBE_LOG.replace("-25.000000 -50.000000", "-2500.000000 -50.000000")
    touches = read_linuxcnc_probe(write("probe.txt", far), "mm")
    with pytest.raises(DatasetError, match="row 2: linear_delta can't be"):
        commands(touches, kinematics, np.array([0.0, 0.0, 0.3]))


def test_only_few_touches_of_a_printers_bed_are_told_to_be_few(write: Write) -> None:
    mill, log = write("mill.urdf", MILL), write("probe.txt", PROBE_LOG)
    arguments = [str(log), "--unit", "mm", "--axes", "XYZ", "--robot", str(mill), "-o", str(log.parent / "touches")]
    told = CliRunner().invoke(import_app, ["linuxcnc-probe", *arguments])
    assert told.exit_code == 0
    assert "touches of" in told.output
    assert "mesh" not in told.output
