"""Data that can't be the robot's are refused, and a fit that does not deserve the name is warned of."""

from dataclasses import replace

import numpy as np
import pytest
from virtual_gantry import commands, draw, measured

import gtpin
from gtpin.data import Instrument
from gtpin.errors import ConvergenceError, DatasetError, GtpinWarning, ModelError
from gtpin.kinematics.rod_kinematics import RodKinematics

COUNT = 80


@pytest.fixture(scope="module")
def good():
    rng = np.random.default_rng(7)
    return measured(draw(rng), commands(rng, COUNT), rng)


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: replace(d, q=d.q[:, [1, 0, 2]]),
        lambda d: replace(d, q=d.q[:, [0, 2, 1]]),
        lambda d: replace(d, q=d.q * [1.0, 1.0, -1.0]),
        lambda d: replace(d, position=d.position[:, [0, 2, 1]]),
        lambda d: replace(d, position=d.position * [1.0, -1.0, 1.0]),
    ],
    ids=["q1 and q2 swapped", "q2 and q3 swapped", "q3 negated", "y and z swapped", "y mirrored"],
)
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_columns_in_a_wrong_order_or_sign_never_give_a_model(good, spoil):
    with pytest.raises((DatasetError, ConvergenceError)) as caught:
        gtpin.calibrate(spoil(good))
    assert "column" in str(caught.value)


@pytest.mark.slow
def test_scalar_last_quaternions_are_recognised_in_a_free_frame_though_the_plate_hardly_turns(good):
    free = replace(good, instrument=Instrument(position_sigma=1.5e-5, orientation_sigma=5e-5, frame="free"))
    assert gtpin.calibrate(free).chi2_per_dof < 1.5
    with pytest.raises(DatasetError, match="looks like xyzw"):
        gtpin.calibrate(replace(free, orientation=np.roll(good.orientation, -1, axis=1)))


def test_a_station_among_the_poses_is_refused(good):
    station = tuple(float(x) for x in good.position[3])
    with pytest.raises(DatasetError, match="station"):
        gtpin.calibrate(
            replace(good, instrument=Instrument(position_sigma=1.5e-5, orientation_sigma=5e-5, station=station))
        )


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # of the frame, which this looks like
def test_parameters_far_outside_their_tolerances_are_warned_of_by_name(good):
    shifted = replace(good, position=good.position + np.array([0.0, 0.0, 0.05]))
    with pytest.warns(GtpinWarning, match=r"tolerances from nominal: (cart|platform)_joint"):
        gtpin.calibrate(shifted)


def test_errors_in_a_third_of_the_poses_are_not_passed_over_in_silence(good):
    rng = np.random.default_rng(8)
    position = good.position.copy()
    spoilt = rng.choice(len(good), len(good) // 3, replace=False)
    position[spoilt] += 0.01 * rng.standard_normal((len(spoilt), 3))
    with pytest.raises(DatasetError, match=r"\d+ of \d+ rows do not fit the others"):
        gtpin.calibrate(replace(good, position=position))


@pytest.mark.parametrize("options", [{"directions": "cart"}, {"scale": "link"}, {"without": "lenght"}, {"arm": "half"}])
def test_options_that_do_not_exist_are_refused(options):
    with pytest.raises(ModelError):
        gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"), **options)


def test_one_name_may_be_left_out_without_a_list():
    geometry = gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"), without="length")
    assert len(geometry.names) == 42


def test_pinocchio_s_derivative_refuses_parameters_that_no_urdf_holds():
    robot = gtpin.load_robot("gantry_tau")
    with pytest.raises(ModelError):
        gtpin.geometry_jacobian(gtpin.home(robot), gtpin.Geometry.nominal(robot, arm="reduced"))


def test_observability_indices_are_those_of_the_whitened_derivative_down_to_what_the_data_hardly_see(good):
    found = gtpin.calibrate(good)
    kinematics = RodKinematics(found.model.geometry)
    J = kinematics.geometry_jacobian(good.q, kinematics.forward(good.q)) * found.model.geometry.tolerance
    J /= np.array([1.5e-5] * 3 + [5e-5] * 3)[None, :, None]
    s = np.linalg.svd(J.reshape(-1, 48), compute_uv=False)
    assert s[-1] < 1e-6 * s[0]  # far below what the square of J could tell
    expected = {
        "O1": np.exp(np.log(s).mean()) / np.sqrt(J.shape[0] * 6),
        "O2": s[-1] / s[0],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": 1.0 / (1.0 / s).sum(),
    }
    assert found.observability.indices == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_commands_in_reverse_order_in_half_of_the_rows_never_give_a_model(seed):
    rng = np.random.default_rng(seed)
    dataset = measured(draw(rng), commands(rng, COUNT), rng)
    q = dataset.q.copy()
    q[COUNT // 2 :, 1] = q[COUNT // 2 :, 1][::-1]
    with pytest.raises((DatasetError, ConvergenceError), match=r"poses|rows|fit"):
        gtpin.calibrate(replace(dataset, q=q))
