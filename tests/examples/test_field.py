"""The cases of examples/field: every command of its page gives the right answer."""

import sys
from pathlib import Path

import numpy as np
import pytest
from urdfs import crossing

import gtpin
from gtpin.cli import main

FIELD = Path(__file__).parents[2] / "examples" / "field"
pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.fixture
def run(monkeypatch, capsys):
    """Exit code and standard error of a command."""

    def command(*arguments):
        monkeypatch.setattr(sys, "argv", ["gtpin", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code, capsys.readouterr().err

    return command


@pytest.mark.slow
def test_noise_of_millimetres_is_not_what_a_far_nominal_model_leaves():
    found = gtpin.calibrate(gtpin.Dataset.read(FIELD / "far_nominal"))
    errors = np.linalg.norm(found.residual[:, :3], axis=1)
    assert np.sqrt((errors**2).mean()) < 5e-4
    assert found.noise.position_sigma < 3e-4  # made with 20 to 200 um


@pytest.mark.slow
def test_scatter_beyond_the_declared_noise_is_unknown():
    found = gtpin.diagnose(gtpin.Dataset.read(FIELD / "scatter"))
    assert (found.verdict, [d.reason for d in found.doubts]) == ("unknown", ["excess"])


@pytest.mark.slow
def test_virtual_poses_of_a_five_bar_are_on_one_assembly(tmp_path, run):
    code, _ = run("simulate", "-o", tmp_path / "sim", "--robot", FIELD / "five_bar" / "five_bar.urdf")
    assert code in (0, None)
    data = gtpin.Dataset.read(tmp_path / "sim")
    # Elbows by hand, and the tip as the intersection of two circles: the same of the two at every pose.
    left = np.array([-0.12, 0.0]) + 0.30 * np.column_stack([-np.sin(data.q[:, 0]), np.cos(data.q[:, 0])])
    right = np.array([0.12, 0.0]) + 0.31 * np.column_stack([-np.sin(data.q[:, 1]), np.cos(data.q[:, 1])])
    tips = [crossing(left, 0.42, right, 0.40, side) for side in (1.0, -1.0)]
    off = [np.linalg.norm(data.position[:, :2] - tip, axis=1).max() for tip in tips]
    assert min(off) < 0.02 < max(off)  # the machine is some millimetres off nominal


@pytest.mark.slow
def test_an_undetermined_motion_names_its_joints(tmp_path, run):
    folder = FIELD / "undetermined"
    code, said = run("predict", folder / "four_bar.urdf", folder / "q.csv", "-o", tmp_path / "out.csv")
    assert code == 2
    assert "1 passive motion" in said
    assert "extra" in said
    assert not (tmp_path / "out.csv").exists()


def test_a_xacro_file_is_to_be_expanded(tmp_path, run):
    q = FIELD / "undetermined" / "q.csv"
    code, said = run("predict", FIELD / "xacro" / "arm.xacro", q, "-o", tmp_path / "out.csv")
    assert code == 2
    assert "expand it first" in said


def test_a_site_with_a_bodys_name_is_the_tcp_that_was_asked_for(tmp_path, run):
    folder = FIELD / "site_and_body"
    out = tmp_path / "out.csv"
    code, said = run("predict", folder / "arm.xml", folder / "q.csv", "--tcp", "tool", "-o", out)
    assert code in (0, None)
    assert "tool" in said
    found = np.genfromtxt(out, delimiter=",", skip_header=1)[1, 1:4]
    a, b = 0.5, -0.3  # Rz(a) (0.4, 0, 0) + Rz(a) Ry(b) (0.1, 0, 0.05), over 0.3
    reach = 0.4 + 0.1 * np.cos(b) + 0.05 * np.sin(b)
    right = [reach * np.cos(a), reach * np.sin(a), 0.3 - 0.1 * np.sin(b) + 0.05 * np.cos(b)]
    np.testing.assert_allclose(found, right, atol=1e-12)


LEG = [[0.02, 0.0, -0.54], [0.02, 0.0, -0.34], [0.02, 0.0, -0.64]]
"""(0.02, 0, -q - 0.04), m, by hand."""
CRANK = [[0.31171479, 0.0, 0.20082668], [0.3550466, 0.0, 0.19791851], [0.25223721, 0.0, 0.18923056]]
"""Pinocchio's placements, and SciPy's least squares on the six numbers of log6 of the cut."""
SPHERICAL = [[0.007453, 0.014907, 0.149072], [0.027058, 0.047937, 0.139535], [0.041450, 0.080479, 0.119604]]
"""MuJoCo's sites, and least squares on their gap, 26 nm left."""
PLANAR = [[0.0174, 0.0, 0.4352], [0.0194, 0.0, 0.3878]]
"""The plane's answer, by circles."""
FIVE_BAR = [[0.01738567, 0.43524222, 0.0], [0.01942232, 0.38784681, 0.0]]
"""MuJoCo's sites, and least squares from the keyframe; the simulation from the open posture ends there too."""
LOOPS = {
    "spherical_loop/spherical_6_digits.xml --tcp tool": (SPHERICAL, 1e-6, "close only to 2.2e-08 m"),
    "rounded_right_angle/five_bar.urdf": (PLANAR, 4e-4, "axes of ml and mr are 1.6 mrad from parallel"),
    "rounded_right_angle/five_bar.xml --tcp pen": (PLANAR, 4e-4, "axes of ml and mr are 1.6 mrad from parallel"),
    "telescope_leg/leg.urdf": (LEG, 1e-9, '<home q="0.4"'),
    "telescope_leg/leg.xml --tcp foot": (LEG, 1e-9, ""),
    "telescope_leg/no_actuator.xml --tcp foot --actuators length": (LEG, 1e-9, ""),
    "weld_loop/robot.yaml --tcp tool": (CRANK, 1e-8, "nearest to zero"),
    "weld_loop/robot.urdf --tcp tool": (CRANK, 1e-8, "robot.yaml beside it"),
    "weld_loop/crank.xml --tcp tool": (CRANK, 1e-8, "open at its initial posture"),
    "keyframe/fivebar.xml --tcp pen": (FIVE_BAR, 1e-8, ""),
}


@pytest.mark.parametrize("arguments", LOOPS)
def test_loops_close_where_others_close_them(tmp_path, run, arguments):
    right, tolerance, said = LOOPS[arguments]
    file, *options = arguments.split()
    code, error = run("predict", FIELD / file, (FIELD / file).parent / "q.csv", *options, "-o", tmp_path / "out.csv")
    assert code in (0, None)
    assert said in error
    assert "mend <home>" not in error
    found = np.genfromtxt(tmp_path / "out.csv", delimiter=",", skip_header=1)[:, 1:4]
    np.testing.assert_allclose(found, right, rtol=0, atol=tolerance)


def test_a_loop_without_drives_names_the_element_that_gives_them(tmp_path, run):
    folder = FIELD / "telescope_leg"
    code, said = run(
        "predict", folder / "no_actuator.xml", folder / "q.csv", "--tcp", "foot", "-o", tmp_path / "out.csv"
    )
    assert code == 2
    assert "name the driven joints in its <actuator>" in said
    assert "<gtpin>" not in said


def test_the_page_names_every_folder():
    page = (FIELD / "README.md").read_text()
    assert {f"| `{folder.name}` |" in page for folder in FIELD.iterdir() if folder.is_dir()} == {True}
