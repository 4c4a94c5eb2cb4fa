"""An instrument that stood elsewhere in each session is named as the reason, with the sessions and how far it moved."""

import re
from dataclasses import replace

import numpy as np
import pytest
from test_recognise import elsewhere, machine, refusal

import gtpin

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


def in_sessions(data, moves, *, first=0):
    """The data in as many sessions as there are moves, m, of the instrument along x; rows in the order of the file."""
    part = np.arange(len(data)) * len(moves) // len(data)
    shift = np.zeros((len(data), 3))
    shift[:, 0] = np.array(moves)[part]
    names = np.array([f"s{first + i}" for i in part])
    return replace(data, position=data.position + shift, covariates={**data.covariates, "session": names})


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart"])
@pytest.mark.parametrize("orientations", [True, False])
@pytest.mark.parametrize("move", [0.03, 0.1, 1.0])
@pytest.mark.study
def test_sessions_between_which_a_free_frame_moved_are_named_with_how_far(robot, orientations, move):
    data = in_sessions(elsewhere(machine(robot, 641), 641, "free"), [0.0, 0.0, move])
    merged = np.where(data.covariates["session"] == "s2", "later", "earlier")
    data = replace(data, covariates={**data.covariates, "session": merged})
    text = refusal(data if orientations else replace(data, orientation=None))
    assert "the instrument moved between sessions: from where it stood in session earlier by" in text
    told = re.search(r"by ([0-9.e+]+) mm in session later", text)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * move, rel=0.2)
    assert 'set stations = "session" under [instrument]' in text


@pytest.mark.slow
@pytest.mark.study
def test_a_motion_of_a_centimetre_is_named_where_the_fit_fails():
    data = in_sessions(elsewhere(machine("gantry_tau", 2), 5, "free"), [0.0, 0.02])
    assert "the instrument moved between sessions" in refusal(data)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart", "gantry_tau_6dof", "linear_delta"])
@pytest.mark.parametrize("frame", ["robot", "free"])
@pytest.mark.parametrize("orientations", [True, False])
def test_sessions_of_different_parts_of_the_workspace_are_not_taken_for_motions(robot, frame, orientations):
    data = machine(robot, 642)
    seen = data if frame == "robot" else elsewhere(data, 642, "free")
    for axis in range(3):  # each session has a part of the workspace along an axis, the second a slice of it
        order = np.argsort(data.position[:, axis])
        names = np.full(len(data), "rest", dtype=object)
        names[order[:10]] = "slice"
        names[order[len(order) // 2 :]] = "half"
        part = replace(seen, covariates={**seen.covariates, "session": names.astype(str)})
        gtpin.calibrate(part if orientations else replace(part, orientation=None))


def test_a_motion_below_a_millimetre_is_left_to_a_diagnosis():
    data = in_sessions(elsewhere(machine("gantry_tau", 643), 643, "free"), [0.0, 3e-4])
    assert gtpin.calibrate(data).residual.shape[0] == len(data)


@pytest.mark.slow
def test_a_drive_s_zero_that_changes_between_sessions_is_left_to_a_diagnosis():
    data = in_sessions(elsewhere(machine("gantry_tau", 644), 644, "free"), [0.0, 0.0])
    later = data.covariates["session"] == "s1"
    off = replace(data, pose=np.arange(len(data)), q=data.q + np.outer(later, [4e-3, 0.0, 0.0]))
    found = gtpin.diagnose(off)
    assert ("zero_shift", "cart1") in [(cause.effect, cause.site) for cause in found.causes]
