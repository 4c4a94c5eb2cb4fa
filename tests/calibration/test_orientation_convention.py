"""Orientations of one convention that were converted as another's are refused; those that are right never are."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from quick_first import quick_first
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.calibration.checks.readings import BY_AXIS, reread
from gtpin.errors import DatasetError


def converted(data, wrongly):
    rotation = Rotation.from_quat(data.orientation.copy(), scalar_first=True)
    return replace(data, orientation=wrongly(rotation).as_quat(scalar_first=True))


WRONGLY = {
    "rotation vectors as fixed xyz": lambda r: Rotation.from_euler("xyz", r.as_rotvec()),
    "fixed xyz as rotation vectors": lambda r: Rotation.from_rotvec(r.as_euler("xyz")),
    "fixed xyz as moving XYZ": lambda r: Rotation.from_euler("XYZ", r.as_euler("xyz")),
    "moving XYZ as fixed xyz": lambda r: Rotation.from_euler("xyz", r.as_euler("XYZ")),
}
MEANT = (
    "rotation vectors",
    "Euler angles xyz about fixed",
    "Euler angles xyz about fixed",
    "Euler angles zyx about fixed",
)


@pytest.mark.slow
@pytest.mark.parametrize(("wrongly", "meant"), list(zip(WRONGLY, MEANT, strict=True)))
@pytest.mark.parametrize("effects", [0, 1])
def test_a_wrong_conversion_is_refused_with_the_convention_that_fits(wrongly, meant, effects):
    data = make_case(641 + effects, robot="stewart", n_effects=effects, poses=100, held_out=1).dataset
    with pytest.raises(DatasetError, match="the orientations look like") as caught:
        gtpin.calibrate(converted(data, WRONGLY[wrongly]))
    assert f"look like {meant}" in str(caught.value)
    assert caught.value.column == "qw qx qy qz"


@pytest.mark.filterwarnings("ignore:set aside as gross errors")
def test_turns_so_small_that_the_nominal_robot_hides_them_show_after_the_fit():
    data = make_case(643, robot="stewart", n_effects=0, poses=120, held_out=1).dataset
    few = data.take(Rotation.from_quat(data.orientation.copy(), scalar_first=True).magnitude() < 0.15)
    spoilt = converted(few, WRONGLY["fixed xyz as rotation vectors"])
    right, wrong = (Rotation.from_quat(d.orientation.copy(), scalar_first=True) for d in (few, spoilt))
    changed = (wrong * right.inv()).magnitude()
    assert np.median(changed) < 5e-3
    with pytest.raises(DatasetError, match="the orientations look like Euler angles xyz about fixed axes"):
        gtpin.calibrate(spoilt)


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # of what an effect does to a fit
@pytest.mark.parametrize("robot", quick_first(["stewart", "ur5"]))
@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("seed", quick_first([7, 8, 9]))
def test_a_convention_is_named_beside_a_large_backlash(robot, declared, seed):
    site = gtpin.load_robot(robot).sites[0]
    made = make_case(seed, robot=robot, effects=[("backlash", site)], noncentrality=4000.0, poses=400, held_out=1)
    data = converted(made.dataset, WRONGLY["fixed xyz as rotation vectors"])
    if robot == "stewart":  # small turns, whose second order alone differs
        data = data.take(Rotation.from_quat(data.orientation.copy(), scalar_first=True).magnitude() < 0.12)
    if not declared:
        unknown = data.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
        data = replace(data, instrument=unknown)
    with pytest.raises(DatasetError, match="the orientations look like"):
        gtpin.calibrate(data)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # of what two effects do to a fit
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart", "tau"])
@pytest.mark.parametrize("declared", [True, False])
def test_effects_are_no_convention(robot, declared):
    for seed in (651, 652):
        data = make_case(seed, robot=robot, n_effects=2, noncentrality=4000.0, poses=80, held_out=1).dataset
        if not declared:
            unknown = data.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
            data = replace(data, instrument=unknown)
        assert gtpin.calibrate(data).model is not None


def test_every_reading_by_axes_is_undone_by_its_reverse():
    rotation = Rotation.from_rotvec(np.random.default_rng(5).normal(0, 0.3, (40, 3)))
    for meant, taken in permutations(BY_AXIS, 2):
        there = reread(rotation, taken, meant, by_axis=True)
        again = reread(there, meant, taken, by_axis=True)
        assert (again * rotation.inv()).magnitude() == pytest.approx(0.0, abs=1e-6)
        assert (there * rotation.inv()).magnitude().max() > 1e-3
