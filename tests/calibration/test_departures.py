"""Departures of a calibrated geometry from nominal: a zero that is off is found as a zero, with what it moves the TCP by."""

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed
from monte_carlo import assert_chi2
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from urdfs import crossing, joint, loop, own, urdf

import gtpin
from gtpin.data import InstrumentSection
from gtpin.model.departures import departures, size_of
from gtpin.report.geometry import change_words, departure_words

FIVE_BAR = str(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
FIELD = str(Path(__file__).parents[2] / "examples" / "field" / "five_bar" / "five_bar.urdf")
pytestmark = pytest.mark.filterwarnings("ignore:off by more than", "ignore:the nominal model is not")  # as is meant
TURNED = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
NOISE = 2e-5


def seen(robot, joint, off, frame="robot", seed=1):
    """Commands of a nominal robot whose joint stands at ``off`` when its command is zero, and the calibration of its poses."""
    machine, rng = gtpin.load_robot(robot), np.random.default_rng(seed)
    q = machine.home_q + rng.uniform(-1.0, 1.0, (60, machine.n_actuators)) * (1.0 if robot == "ur10" else 0.3)
    shift = np.zeros(machine.n_actuators)
    shift[joint] = off
    nominal = gtpin.Model(gtpin.Geometry.nominal(machine))
    T = nominal.predict(q + shift).T + NOISE * rng.standard_normal((len(q), 3))
    T = T @ TURNED.T + [1.0, 2.0, 3.0] if frame == "free" else T
    dataset = gtpin.Dataset(
        robot, [str(i) for i in range(len(q))], q, T, instrument=InstrumentSection(frame=frame, position_sigma=NOISE)
    )
    moved = nominal.predict(q + shift).T - nominal.predict(q).T
    return q, moved, gtpin.calibrate(dataset)


@pytest.mark.parametrize(
    ("robot", "joint", "off"),
    [("ur10", 2, np.deg2rad(1.0)), (FIVE_BAR, 0, np.deg2rad(1.0)), ("gantry_tau", 1, 9e-3)],
)
def test_a_zero_that_is_off_comes_first_with_the_displacement_that_it_makes(robot, joint, off) -> None:
    q, moved, calibration = seen(robot, joint, off)
    first = departures(calibration.model, q)[0]
    assert first.name == f"zero[{gtpin.load_robot(robot).sites[joint]}]"
    assert abs(first.value - off) < 4.0 * first.sigma
    # In the same proportion to the whole as its value to the true one.
    assert first.position_rms == pytest.approx(size_of(moved) * abs(first.value / off), rel=0.01)


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize(("robot", "joint"), [("ur10", 2), (FIVE_BAR, 0), (FIELD, 0)])
def test_warnings_and_the_json_name_the_zero_and_not_the_parameters_that_imitate_it(robot, joint) -> None:
    """A shift of the elbow's placement and a zero of the drive move the TCP alike, to the first order."""
    off = np.deg2rad(1.0)
    _, _, calibration = seen(robot, joint, off)
    site = gtpin.load_robot(robot).sites[joint]
    texts = [text for text in calibration.warnings if "tolerances" in text]
    assert texts
    assert all(f"zero of {site} +" in text and " deg" in text and "placement" not in text for text in texts)
    zero = next(one for one in calibration.to_json()["equivalent_zeros"] if one["site"] == site)
    assert abs(zero["value"] - off) < 4.0 * zero["sigma"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_a_first_screen_names_the_zero_whatever_cause_is_open() -> None:
    """A joint's axis that moves as the joint turns can take up most of a wrong zero of the drive."""
    machine, rng = gtpin.load_robot(FIVE_BAR), np.random.default_rng(1)
    nominal, off = gtpin.Geometry.nominal(machine), np.deg2rad([0.0, 1.0])
    q = machine.home_q + rng.uniform(-0.3, 0.3, (60, 2))
    spread = nominal.tolerance * np.random.default_rng(7).standard_normal(len(nominal.values))
    T = gtpin.Model(nominal.with_values(nominal.values + spread)).predict(q + off).T + NOISE * rng.standard_normal(
        (60, 3)
    )
    section = InstrumentSection(position_sigma=NOISE)
    found = gtpin.diagnose(gtpin.Dataset(FIVE_BAR, [str(i) for i in range(60)], q, T, instrument=section))
    first = departures(found.model, found.dataset.q)[0]
    assert first.name == "zero[drive_right]"
    assert abs(first.value - off[1]) < 4.0 * first.sigma
    assert first.position_rms > 0.5 * found.baseline.by_instrument[0].before


def test_where_the_instrument_stood_anywhere_a_displacement_is_without_what_its_place_absorbs() -> None:
    off = np.deg2rad(1.0)
    q, moved, calibration = seen("ur10", 2, off, frame="free")
    first, *others = departures(calibration.model, q)
    assert first.name == "zero[elbow_joint]"
    nominal = calibration.by_instrument[0].before  # of the nominal robot, at the best place of the instrument
    assert first.position_rms == pytest.approx(nominal, rel=0.01)
    assert first.position_rms < 0.6 * size_of(moved)
    assert size_of(sum(one.displacement for one in others)) < 0.01 * nominal


def test_all_departures_together_are_the_displacement_from_the_nominal_to_the_calibrated_pose() -> None:
    for robot, drive, off in (("ur10", 2, 0.01), ("gantry_tau", 1, 3e-3)):
        q, _, calibration = seen(robot, drive, off)
        nominal = gtpin.Model(gtpin.Geometry.nominal(calibration.model.robot))
        change = calibration.model.predict(q).T - nominal.predict(q).T
        whole = sum(one.displacement for one in departures(calibration.model, q))
        assert size_of(whole - change) < 0.01 * size_of(change)


LONG = 8e-3


def with_a_longer_far_link(tmp_path: Path, robot: str, tolerance: dict[str, float]) -> tuple[gtpin.Calibration, list]:
    """A five-bar whose pin is 8 mm farther along a far link, seen by a tracker: its calibration, and its departures."""
    xml = Path(FIVE_BAR).read_text()
    nominal = gtpin.load_robot(FIVE_BAR)
    anchor = next(name for name in gtpin.Geometry.nominal(nominal).names if name.startswith("anchor") and ".x" in name)
    geometry, rng = gtpin.Geometry.nominal(nominal), np.random.default_rng(3)
    off = LONG * np.array([name == anchor for name in geometry.names])
    q = nominal.home_q + rng.uniform(-0.4, 0.4, (80, 2))
    T = gtpin.Model(geometry.with_values(geometry.values + off)).predict(q).T + NOISE * rng.standard_normal((80, 3))
    if robot == "own tolerance":
        given = " ".join(f'{kind}="{size}"' for kind, size in tolerance.items())
        xml, tolerance = xml.replace("</gtpin>", f"<tolerance {given}/></gtpin>"), {}
    file = tmp_path / "five_bar.urdf"
    file.write_text(xml)
    section = InstrumentSection(frame="free", position_sigma=NOISE)
    data = gtpin.Dataset(str(file), [str(i) for i in range(80)], q, T, instrument=section, tolerance=tolerance)
    found = gtpin.calibrate(data)
    gtpin.write_model(found.model, tmp_path / "model")
    return found, [departures(model, q) for model in (found.model, gtpin.read_model(tmp_path / "model"))]


@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize(
    ("robot", "tolerance"),
    [("own tolerance", {"placement_position": 8e-3}), ("", {"placement_position": 8e-3}), ("", {})],
    ids=["in the URDF", "in the dataset", "widened by the calibration"],
)
def test_screen_and_json_have_the_values_of_the_table_wherever_tolerances_come_from(tmp_path, robot, tolerance) -> None:
    found, both = with_a_longer_far_link(tmp_path, robot, tolerance)
    assert any(p.widened > 1.0 for p in found.model.geometry.parameters) is (not tolerance)
    table = {p["name"]: p for p in found.to_json()["parameters"]}
    for some in both:  # as fitted, and as read from its folder
        longest = max((one for one in some if one.name.startswith("anchor")), key=lambda one: one.position_rms)
        assert abs(longest.value) > 0.3 * LONG
        for one in (one for one in some if one.name in table):
            own = table[one.name]
            # The zeros, whose size is not known, add to the sigma, and little to the value.
            assert one.value == pytest.approx(own["value"] - own["nominal"], abs=0.3 * one.sigma)
            assert one.sigma > (1.0 - 1e-6) * own["sigma"]


BASE, NEAR, FAR = 0.1, 0.2, 0.3
"""Half the distance of the drives, and lengths of the links of a planar five-bar, m."""
START = np.array([2.2, 0.94])
"""Angles of the near links at command zero, rad."""


def tip(q: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(N, 3) where the far links meet, m; ``angles``: (2,) zeros of the drives, rad."""
    at = q + START + angles
    elbows = NEAR * np.stack([np.cos(at), np.sin(at)], axis=2) + np.array([[-BASE, 0.0], [BASE, 0.0]])
    met = crossing(elbows[:, 0], FAR, elbows[:, 1], FAR)
    return np.column_stack([met, np.zeros(len(q))])


def circles() -> str:
    """The nominal URDF of that five-bar."""
    parts = [("base", "left", -BASE, 2.2), ("left", "left_far", NEAR, -1.44)]
    parts += [("base", "right", BASE, 0.94), ("right", "right_far", NEAR, 1.44)]
    joints = [joint(f"to_{b}", a, b, f"{x} 0 0", rpy=f"0 0 {yaw}", limit=2.0) for a, b, x, yaw in parts]
    end = f"{FAR} 0 0"
    pin_of_both = loop("left_far", end, "right_far", end)
    tool = joint("t", "left_far", "tool", end, kind="fixed")
    return urdf("five_bar", *joints, tool, pin_of_both, own(["to_left", "to_right"], "tool"))


@pytest.mark.parametrize("zero", quick_first([4e-3, 2e-2]))
def test_zeros_and_elbows_of_a_five_bar_are_told_as_uncertain_as_they_are(zero: float, tmp_path: Path) -> None:
    """A shift of an elbow across its link is the same motion as the drive's zero: no data distinguish them."""
    (tmp_path / "bar.urdf").write_text(circles())
    for seed in range(4):
        rng = np.random.default_rng([seed, 7])
        angles = zero * np.array([1.0, -1.0]) * rng.choice([-1.0, 1.0])
        q = rng.uniform(-0.5, 0.5, (60, 2))
        T = tip(q, angles) + NOISE * rng.standard_normal((60, 3))
        section = InstrumentSection(position_sigma=NOISE)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            data = gtpin.Dataset(str(tmp_path / "bar.urdf"), [str(i) for i in range(60)], q, T, instrument=section)
            found = gtpin.calibrate(data)
        assert max(abs(own.value - true) / own.sigma for own, true in zip(found.zeros, angles, strict=True)) < 3.0
        others = [one for one in departures(found.model, q) if one.what != "zero"]
        assert max(abs(one.value) / one.sigma for one in others) < 4.0


def test_a_nominal_geometry_has_no_departures() -> None:
    model = gtpin.read_model("ur5")
    assert departures(model, model.robot.home_q[None]) == ()


@pytest.mark.slow
def test_sigmas_of_a_zero_hold_and_others_are_not_named() -> None:
    """Machines with deviations as large as the tolerances, and one zero far beyond them."""
    machine, z, named = gtpin.load_robot("gantry_tau"), [], []
    nominal, off = gtpin.Geometry.nominal(machine), np.array([0.0, 0.009, 0.0])
    for seed in range(30):
        rng = np.random.default_rng([seed, 5])
        true = nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))
        q = rng.uniform(-0.4, 0.4, (60, 3))
        poses = gtpin.Model(true).predict(q + off)
        T = poses.T + NOISE * rng.standard_normal((60, 3))
        ids = [str(i) for i in range(60)]
        given = InstrumentSection(position_sigma=NOISE, orientation_sigma=5e-5)
        turned = Rotation.from_rotvec(5e-5 * rng.standard_normal((60, 3))) * Rotation.from_matrix(poses.R)
        wxyz = turned.as_quat(scalar_first=True)
        found = departures(gtpin.calibrate(gtpin.Dataset("gantry_tau", ids, q, T, wxyz, instrument=given)).model, q)
        zeros = {one.name: one for one in found if one.what == "zero"}
        named += zeros
        if one := zeros.get("zero[cart2]"):
            z.append((one.value - off[1]) / one.sigma)
    assert len(z) >= 25
    assert len(named) - len(z) <= 5  # one joint in twenty
    assert_chi2(float(np.sum(np.square(z))), len(z))


def test_a_link_that_is_shorter_is_told_as_shorter_where_the_table_has_its_length_negative() -> None:
    robot, rng = gtpin.load_robot("ur10"), np.random.default_rng(1)
    real = pin.buildModelFromXML(robot.description.xml)
    elbow, short = real.getJointId("elbow_joint"), 1e-3
    at = real.jointPlacements[elbow].translation.copy()
    at[np.argmax(np.abs(at))] -= short * np.sign(at[np.argmax(np.abs(at))])
    real.jointPlacements[elbow].translation = at
    q = rng.uniform(-1.5, 1.5, (60, 6))
    T = placed(real, q)[0] + NOISE * rng.standard_normal((60, 3))
    section = InstrumentSection(frame="robot", position_sigma=NOISE)
    calibration = gtpin.calibrate(gtpin.Dataset("ur10", [str(i) for i in range(60)], q, T, instrument=section))
    first = departures(calibration.model, q)[0]
    assert first.name == "a[shoulder_lift_joint]"
    assert departure_words(first) == "length |a| of shoulder_lift_joint"
    assert abs(first.value - short) < 4.0 * first.sigma  # the table has a = -0.612 m
    assert change_words(first).startswith(("−", "-"))
