"""Data that can't be the robot's are refused, and a fit that does not deserve the name is warned of."""

from dataclasses import replace

import numpy as np
import pytest
from virtual_gantry import GANTRY, Machine, case, commands, indices, measured

import gtpin
from gtpin.errors import ConvergenceError, DatasetError, GtpinWarning, ModelError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.paper.geometry import PaperGeometry

COUNT = 80


@pytest.fixture(scope="module")
def good():
    return case(np.random.default_rng(7), COUNT)[1]


@pytest.mark.slow
def test_scalar_last_quaternions_are_recognised_in_a_free_frame_though_the_plate_hardly_turns(good):
    free = replace(good, instrument=good.instrument.model_copy(update={"frame": "free"}))
    assert gtpin.calibrate(free).chi2_per_dof < 1.5
    with pytest.raises(DatasetError, match="looks like xyzw"):
        gtpin.calibrate(replace(free, orientation=np.roll(good.orientation, -1, axis=1)))


def test_a_station_among_the_poses_is_refused(good):
    among = good.instrument.model_copy(update={"station": tuple(map(float, good.position[3]))})
    with pytest.raises(DatasetError, match="station"):
        gtpin.calibrate(replace(good, instrument=among))


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # of all tolerances
def test_parameters_far_outside_their_tolerances_are_warned_of_by_name():
    rng = np.random.default_rng(7)
    far = Machine(GANTRY.off({"platform_joint[2a].y": 0.02}), {})
    said = r"tolerances from nominal: .*platform_joint\[2a\]\.y \(\+\d+ tolerances\).* --free '"
    with pytest.warns(GtpinWarning, match=said):
        gtpin.calibrate(measured(far, commands(rng, COUNT), rng))


def test_a_frame_that_is_elsewhere_is_told_and_no_parameter_that_takes_it_up(good):
    shifted = replace(good, position=good.position + np.array([0.0, 0.0, 0.05]))
    with pytest.warns(GtpinWarning) as told:
        gtpin.calibrate(shifted)
    assert [text for text in map(str, (one.message for one in told)) if "tolerances" in text] == []
    assert any("the instrument's frame looks" in str(one.message) for one in told)


def test_errors_in_a_third_of_the_poses_are_not_passed_over_in_silence(good):
    rng = np.random.default_rng(8)
    position = good.position.copy()
    spoilt = rng.choice(len(good), len(good) // 3, replace=False)
    position[spoilt] += 0.01 * rng.standard_normal((len(spoilt), 3))
    with pytest.raises(DatasetError, match=r"\d+ of \d+ rows do not fit the others"):
        gtpin.calibrate(replace(good, position=position))


@pytest.mark.parametrize("options", [{"scale": "link"}, {"scale": "rod"}, {"without": "lenght"}])
def test_options_that_do_not_exist_are_refused(options):
    with pytest.raises(ModelError):
        gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"), **options)


def test_one_name_may_be_left_out_without_a_list():
    geometry = gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"), without="length")
    assert len(geometry.names) == 42


def test_pinocchio_s_derivative_refuses_parameters_that_no_urdf_holds():
    robot = gtpin.load_robot("gantry_tau")
    with pytest.raises(ModelError):
        gtpin.geometry_jacobian(gtpin.home(robot), PaperGeometry.nominal(robot, arm="reduced"))


def test_observability_indices_are_those_of_the_whitened_derivative_down_to_what_the_data_hardly_see(good):
    found = gtpin.calibrate(good)
    kinematics = Kinematics(found.model.geometry)
    J = kinematics.geometry_jacobian(good.q, kinematics.forward(good.q)) * found.model.geometry.tolerance
    J /= np.array([1.5e-5] * 3 + [5e-5] * 3)[None, :, None]
    s = np.linalg.svd(J.reshape(-1, 48), compute_uv=False)
    assert s[-1] < 1e-6 * s[0]  # far below what the square of J could tell
    assert found.observability.indices == pytest.approx(indices(s, J.shape[0] * 6), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_commands_in_reverse_order_in_half_of_the_rows_never_give_a_model(seed):
    _, dataset = case(np.random.default_rng(seed), COUNT)
    q = dataset.q.copy()
    q[COUNT // 2 :, 1] = q[COUNT // 2 :, 1][::-1]
    with pytest.raises((DatasetError, ConvergenceError), match=r"poses|rows|fit"):
        gtpin.calibrate(replace(dataset, q=q))
