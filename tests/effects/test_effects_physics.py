"""Signs, units and meaning of the effects, by arguments that don't use their code."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_places import (
    EFFECTS,
    FIT,
    GEOMETRY,
    KINEMATICS,
    ROBOT,
    SETTINGS,
    basis,
    displaced,
    given,
    operating_points,
    some,
)

from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.rack import FLANKS
from gtpin.effects.tracks import TIPS
from gtpin.robot.parameters import rotation_axes

RODS = {site: i for i, site in enumerate(ROBOT.rod_sites)}
LENGTHS = np.array([GEOMETRY[f"length[{rod.name}]"] for rod in ROBOT.rods])
STEP = 1.0  # N, by which the tool's force is changed; the energy is quadratic in it


def parameters(name: str, coefficients: np.ndarray) -> dict[str, float]:
    return {n: value for n, (value, _) in EFFECTS[name].parameters(coefficients, SETTINGS.get(name)).items()}


def pushed(at: OperatingPoints, axis: str, by: float) -> OperatingPoints:
    return replace(at, covariates={**at.covariates, f"f{axis}": at.covariates[f"f{axis}"] + by})


def travel(name: str, q: np.ndarray, coefficients: np.ndarray, **columns: np.ndarray) -> np.ndarray:
    """(N,) what an effect does to cart 2 along its track where all carts are told to go to q (N,)."""
    commands = np.tile(q[:, None], (1, 3))
    told = {key: np.resize(values, len(q)) for key, values in FIT.covariates.items()} | columns
    at = OperatingPoints(KINEMATICS, commands, KINEMATICS.forward(commands), told, FIT.references)
    return displaced(at, name, "cart2", coefficients).command[:, 1]


def rising_energy(at: OperatingPoints, energy) -> np.ndarray:
    """(N, 3) derivative of an energy by the tool's force: by Castigliano's theorem, how far the tool gives way."""
    return np.stack(
        [(energy(pushed(at, axis, STEP)) - energy(pushed(at, axis, -STEP))) / (2.0 * STEP) for axis in "xyz"], axis=1
    )


def gives_way(
    name: str, site: str, column: int, give: float, stretched: Callable[[OperatingPoints], np.ndarray]
) -> None:
    """A coefficient moves the tool as the derivative of give / 2 times the sum of squares (N, k) by the tool's force."""
    at = operating_points(10, seed=1)
    moved = (basis(name, site, at).displacement(at) @ given(name, site, {column: give}))[:, :3]
    expected = rising_energy(at, lambda now: give / 2.0 * (stretched(now) ** 2).sum(axis=1))
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def of_cart(site: str, direction: int) -> tuple[list[int], np.ndarray]:
    """The rods of a cart, and one of its axes: along the track, and two across it."""
    cart = ROBOT.sites.index(site)
    v = ROBOT.actuators[cart].axis
    return [i for i, rod in enumerate(ROBOT.rods) if rod.carrier == cart], np.vstack([v, rotation_axes(v)[:2]])[
        direction
    ]


@pytest.mark.parametrize("site", ["arm", "link1", "link2b", "link3c"])
def test_links_give_way_as_castigliano_says(site: str) -> None:
    rods = list(RODS.values()) if site == "arm" else [RODS[site]]
    gives_way("link_compliance", site, 0, 3e-8, lambda now: now.force[:, rods])


@pytest.mark.parametrize("site", ["cart1", "cart2", "cart3"])
@pytest.mark.parametrize("direction", [0, 1, 2])
def test_carts_give_way_as_castigliano_says(site: str, direction: int) -> None:
    mine, axis = of_cart(site, direction)

    def pull(now: OperatingPoints) -> np.ndarray:
        return np.einsum("nk,nki->ni", now.force[:, mine], now.along[:, mine]) @ axis[:, None]

    gives_way("cart_compliance", site, direction, 5e-8, pull)


@pytest.mark.parametrize("site", ["cart2", "cart3"])
@pytest.mark.parametrize(("tip", "direction"), [("roll", 0), ("tip_a", 1), ("tip_b", 2)])
def test_carts_tip_as_castigliano_says(site: str, tip: str, direction: int) -> None:
    mine, axis = of_cart(site, direction)
    columns = range(len(basis("cart_compliance", site, FIT)))
    named = [k for k in columns if parameters("cart_compliance", given("cart_compliance", site, {k: 1.0}))[tip]]

    def moment(now: OperatingPoints) -> np.ndarray:
        arms = now.carrier_joints[:, mine] - now.carrier_joints[:, mine].mean(axis=1, keepdims=True)
        return np.cross(arms, now.force[:, mine, None] * now.along[:, mine]).sum(axis=1) @ axis[:, None]

    gives_way("cart_compliance", site, named[0], 5e-7, moment)


@pytest.mark.parametrize("site", RODS)
def test_a_tool_that_pulls_along_a_rod_puts_it_in_tension_and_lengthens_it(site: str) -> None:
    at, i = operating_points(6, seed=4), RODS[site]
    along = {f"f{axis}": 1e5 * at.along[:, i, c] for c, axis in enumerate("xyz")}
    at = replace(at, covariates={**at.covariates, **along})
    assert (at.force[:, i] > 0.0).all()
    for name in ("link_compliance", "joint_clearance"):
        longer = displaced(at, name, site, given(name, site, {0: 1e-5})).length
        assert (longer[:, i] > 0.0).all()
        assert not np.delete(longer, i, axis=1).any()


def test_play_is_the_difference_between_tension_and_compression() -> None:
    at = operating_points(60, seed=5)
    c = given("joint_clearance", "link2a", {0: 2e-5})
    longer, force = displaced(at, "joint_clearance", "link2a", c).length[:, 1], at.force[:, 1]
    assert (force > 0.0).any()
    assert (force < 0.0).any()
    gap = longer[force > 0.0].mean() - longer[force < 0.0].mean()
    assert gap == pytest.approx(parameters("joint_clearance", c)["play"], rel=1e-12)


@pytest.mark.parametrize("pulled", [0, 1, 2, 58, 59, 60])
def test_play_is_testable_where_two_poses_have_the_rarer_sign_of_force(pulled: int) -> None:
    # A dead weight on the tool, and a lift that turns the sign of the force in link 1.
    still = replace(operating_points(60, seed=6), covariates={f"f{axis}": np.zeros(60) for axis in "xyz"})
    sign = np.where(np.arange(60) < pulled, 1.0, -1.0)
    wanted = 100.0 * sign - still.force[:, 0]
    per_newton = pushed(still, "z", 1.0).force[:, 0] - still.force[:, 0]
    at = replace(still, covariates={**still.covariates, "fz": wanted / per_newton})
    np.testing.assert_allclose(at.force[:, 0], 100.0 * sign, rtol=1e-9)
    assert (EFFECTS["joint_clearance"].untestable(at, "link1") is None) == (2 <= pulled <= 58)


@pytest.mark.parametrize("reference", [20.0, 25.0])
def test_a_warm_link_is_longer_by_alpha_times_its_length_for_every_kelvin_above_the_reference(reference: float) -> None:
    at = replace(operating_points(10, seed=7, temp_link=np.full(10, reference + 3.0)), temperature=reference)
    longer = displaced(at, "thermal_links", "link3a", given("thermal_links", "link3a", {0: 12e-6})).length
    np.testing.assert_allclose(longer[:, RODS["link3a"]], 3.0 * 12e-6 * LENGTHS[RODS["link3a"]], rtol=1e-9)
    arm = displaced(at, "thermal_links", "arm", given("thermal_links", "arm", {0: 12e-6})).length
    np.testing.assert_allclose(arm, 3.0 * 12e-6 * np.tile(LENGTHS, (10, 1)), rtol=1e-9)


def test_a_track_grows_from_its_fixed_point() -> None:
    c = given("thermal_track", "cart2", {0: 12e-6, 1: 12e-6 * 0.4})
    told = parameters("thermal_track", c)
    assert told["fixed_point"] == pytest.approx(-0.4)
    q = np.array([-0.4, -0.3, 0.1])
    warm = travel("thermal_track", q, c, temp_frame=np.full(3, 25.0))
    np.testing.assert_allclose(warm, told["expansion"] * 5.0 * (q - told["fixed_point"]), rtol=0, atol=1e-15)


def test_a_track_that_is_not_straight_is_as_large_as_said() -> None:
    q = np.linspace(ROBOT.lower[1], ROBOT.upper[1], 4001)
    for name, parts in (("linearity", ("",)), ("straightness", ("_a", "_b")), ("cart_rotation", ("_roll", "_a", "_b"))):
        c = some(name, "cart2", FIT)
        told = parameters(name, c)
        for part, own in zip(parts, np.split(c, len(parts)), strict=True):
            curve = travel(
                "linearity", q, np.concatenate([own, np.zeros(len(basis("linearity", "cart2", FIT)) - len(own))])
            )
            left = curve - np.polynomial.Polynomial.fit(q, curve, 1)(q)
            assert told[f"rms{part}"] == pytest.approx(np.sqrt((left**2).mean()), rel=0.02)
            assert told[f"peak_to_valley{part}"] == pytest.approx(np.ptp(left), rel=0.02)
            if name == "linearity":
                assert told["end_to_end"] == pytest.approx(curve[-1] - curve[0], abs=1e-12)


def test_straightness_and_rotation_lie_across_and_about_the_track() -> None:
    at = operating_points(12, seed=8)
    v = ROBOT.actuators[1].axis
    a, b = rotation_axes(v)[:2]
    n = len(basis("straightness", "cart2", at)) // 2
    for half, axis in ((0, a), (1, b)):
        seat = displaced(at, "straightness", "cart2", given("straightness", "cart2", {half * n: 1e-5})).seat_rate[:, 1]
        np.testing.assert_allclose(seat, (seat @ axis)[:, None] * axis, rtol=0, atol=1e-18)
    m = len(basis("cart_rotation", "cart2", at)) // 3
    mean = at.carrier_joints[:, 1:3].mean(axis=1)
    for third, axis in ((0, v), (1, a), (2, b)):
        seat = displaced(at, "cart_rotation", "cart2", given("cart_rotation", "cart2", {third * m: 1e-5})).seat_rate
        angle = 1e-5 * np.cos(np.pi * (at.q[:, 1] - ROBOT.lower[1]) / (ROBOT.upper[1] - ROBOT.lower[1]))
        for i in (1, 2):
            np.testing.assert_allclose(
                seat[:, i], np.cross(angle[:, None] * axis, at.carrier_joints[:, i] - mean), rtol=0, atol=1e-17
            )


def test_rack_errors_repeat_with_the_period_and_crest_at_the_phase() -> None:
    period = SETTINGS["rack_periodic"]
    c = given("rack_periodic", "cart2", {0: 2e-5, 1: -1.4e-5})
    told = parameters("rack_periodic", c)
    assert told["period"] == period
    q = np.linspace(-0.2, 0.2, 50)
    wave = travel("rack_periodic", q, c)
    np.testing.assert_allclose(travel("rack_periodic", q + 3.0 * period, c), wave, rtol=0, atol=1e-17)
    expected = told["amplitude"] * np.cos(2.0 * np.pi * q / period - told["phase"])
    np.testing.assert_allclose(wave, expected, rtol=0, atol=1e-17)


def test_no_period_between_two_that_are_tried_is_missed() -> None:
    periods = np.array(EFFECTS["rack_periodic"].nonlinear_values(FIT, "cart2"))
    span = np.ptp(FIT.q[:, 1])
    true = np.exp(np.random.default_rng(0).uniform(np.log(periods.min()), np.log(periods.max()), 200))
    # Turns that the nearest period is off by over the whole track: half of that at either end once the phase is fitted.
    off = np.abs(span / true[:, None] - span / periods).min(axis=1)
    assert off.max() <= 1.0 / 12.0 + 1e-9


@pytest.mark.parametrize("pitch", [np.pi * 1.5e-3, 5e-3, 20e-3 / 3, 10e-3, 40e-3 / 3])
def test_the_teeth_of_common_racks_are_among_the_periods(pitch: float) -> None:
    """Straight teeth of module 1.5 mm, and helical ones, whose pitches are parts of 20 and 40 mm."""
    periods = EFFECTS["rack_periodic"].nonlinear_values(FIT, "cart2")
    assert min(periods) < pitch < max(periods)


def test_a_step_is_beyond_its_place_and_its_slope_starts_there() -> None:
    place = SETTINGS["rack_step"]
    c = given("rack_step", "cart2", {0: 4e-5, 1: 1e-4})
    moved = travel("rack_step", place + np.array([-0.1, -1e-6, 1e-6, 0.1]), c)
    np.testing.assert_allclose(moved, [0.0, 0.0, 4e-5 + 1e-10, 5e-5], rtol=0, atol=1e-15)
    assert parameters("rack_step", c) == {"place": place, "step": 4e-5, "slope": 1e-4}


@pytest.mark.parametrize("width", [0.01, 0.03])
def test_a_step_whose_flank_is_a_ramp_rises_from_zero_to_its_height_over_the_ramp(width: float) -> None:
    place = SETTINGS["rack_step"]
    c = given("rack_step", "cart2", {0: 4e-5, 2 + FLANKS.index(width): 4e-5})
    at = width * np.array([-3.0, -0.5, -0.25, 0.0, 0.25, 0.5, 3.0])
    expected = 4e-5 * np.array([0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0])
    np.testing.assert_allclose(travel("rack_step", place + at, c), expected, rtol=0, atol=1e-15)
    assert parameters("rack_step", c)["step"] == 4e-5


def test_a_harmonic_has_its_amplitude_in_the_middle_of_the_range_however_it_changes_towards_the_ends() -> None:
    middle = (ROBOT.lower[1] + ROBOT.upper[1]) / 2.0
    near = middle + SETTINGS["rack_periodic"] * np.linspace(-0.5, 0.5, 201)
    c = given("rack_periodic", "cart2", {0: 2e-5, 2: 1e-5, 4: -1.5e-5})
    assert np.ptp(travel("rack_periodic", near, c)) == pytest.approx(4e-5, rel=0.05)
    assert parameters("rack_periodic", c)["amplitude"] == 2e-5
    assert parameters("rack_periodic", c)["harmonic"] == 0.0


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_a_cart_with_a_dead_zone_hardly_moves_under_small_forces_and_as_a_linear_one_beyond(direction: int) -> None:
    at, give = operating_points(200, seed=4), 5e-8
    mine, axis = of_cart("cart3", direction)
    force = np.einsum("nk,nki->ni", at.force[:, mine], at.along[:, mine]) @ axis
    c = given("cart_compliance", "cart3", {direction: give, TIPS - 3 + direction: -give})
    moved = displaced(at, "cart_compliance", "cart3", c).seat_rate[:, mine[0]] @ axis
    assert np.all(np.abs(moved) < give * np.abs(force))  # never farther than without a dead zone
    assert np.all(np.sign(moved) == np.sign(force))
    order = np.argsort(np.abs(force))
    share = (moved / (give * force))[order]
    assert np.all(np.diff(share) > 0.0)  # the larger the force, the nearer to the linear spring


def test_places_of_steps_lie_inside_the_commands() -> None:
    places = EFFECTS["rack_step"].nonlinear_values(FIT, "cart3")
    assert len(places) > 50
    assert FIT.q[:, 2].min() < min(places) < max(places) < FIT.q[:, 2].max()


def test_a_scale_is_travel_for_every_unit_of_command() -> None:
    c = np.array([1e-4, 3e-5, 0.0])
    q = np.array([ROBOT.lower[1], -0.3, 0.3, ROBOT.upper[1]])
    np.testing.assert_allclose(travel("encoder_scale", q, np.array([1e-4, 0.0, 0.0])), 1e-4 * q, rtol=1e-12)
    scale = travel("encoder_scale", q, c) / q
    assert parameters("encoder_scale", c)["uneven"] == pytest.approx(scale[-1] - scale[0], rel=1e-9)


def test_backlash_is_what_approaches_from_either_side_differ_by() -> None:
    c = given("backlash", "cart2", {0: -2e-5})
    q = np.array([-0.1, 0.2])
    up, down = (travel("backlash", q, c, approach2=np.full(2, side)) for side in (1.0, -1.0))
    np.testing.assert_allclose(up - down, parameters("backlash", c)["reversal"], rtol=1e-12)
    np.testing.assert_allclose(up, -2e-5, rtol=1e-12)


def test_a_drive_that_lags_is_behind_its_command() -> None:
    c = given("servo_lag", "cart2", {0: 3e-4})
    moved = travel("servo_lag", np.zeros(2), c, speed2=np.array([0.2, -0.1]))
    np.testing.assert_allclose(moved, [-6e-5, 3e-5], rtol=1e-12)
    assert parameters("servo_lag", c)["lag"] == 3e-4


def test_a_coupling_takes_a_cart_from_end_to_end_by_what_it_says_in_the_mean_over_the_others() -> None:
    rng = np.random.default_rng(1)
    c = 3e-5 * rng.standard_normal(len(basis("cross_coupling", "cart2", FIT)))
    told = parameters("cross_coupling", c)
    assert list(told) == ["end_to_end[1]", "end_to_end[2]"]
    low, high = ROBOT.lower, ROBOT.upper
    # Of eighths: waves up to order 5 have mean zero there.
    middles = low + (high - low) * (np.arange(8)[:, None] + 0.5) / 8.0
    for k, other in ((0, 0), (1, 2)):
        rest = [i for i in range(3) if i != other]
        q = np.stack([np.insert(middles[[a, b], rest], other, low[other]) for a in range(8) for b in range(8)])
        far = q.copy()
        far[:, other] = high[other]
        # Carts so far apart can't be reached all; what the effect does to the command does not ask.
        poses = KINEMATICS.forward(np.zeros_like(q))
        moved = [
            displaced(OperatingPoints(KINEMATICS, commands, poses, {}), "cross_coupling", "cart2", c).command[:, 1]
            for commands in (q, far)
        ]
        assert (moved[1] - moved[0]).mean() == pytest.approx(told[f"end_to_end[{k + 1}]"])


def test_shifts_between_sessions_are_about_their_mean() -> None:
    c = np.array([3e-5, -1e-5, 4e-5])
    told = parameters("zero_shift", c)
    q = np.zeros(3)
    moved = travel("zero_shift", q, c, session=np.array(["day0", "day1", "day2"], dtype=object))
    np.testing.assert_allclose([told[f"shift[{k}]"] for k in (1, 2, 3)], moved - moved.mean(), rtol=0, atol=1e-18)
    assert told["largest_difference"] == pytest.approx(5e-5)


def test_frames_shift_what_is_seen_by_the_session() -> None:
    c = np.random.default_rng(1).standard_normal(18) * np.tile([1e-5] * 3 + [1e-6] * 3, 3)
    home = KINEMATICS.home
    at = OperatingPoints(
        KINEMATICS, np.zeros((3, 3)), home[[0, 0, 0]], {"session": np.array(["day0", "day1", "day2"], dtype=object)}
    )
    twist = displaced(at, "frame_shift", "frame", c).twist
    told = parameters("frame_shift", c)
    for k in range(3):
        values = [told[f"{kind}_{axis}[{k + 1}]"] for kind in ("shift", "turn") for axis in "xyz"]
        np.testing.assert_allclose(values, twist[k] - twist.mean(axis=0), rtol=0, atol=1e-18)


def test_a_drift_is_from_the_first_pose_to_the_last() -> None:
    c = some("tracker_drift", "frame", FIT)
    told = parameters("tracker_drift", c)
    home, (start, span) = KINEMATICS.home, FIT.references.time
    times = np.linspace(start, start + span, 301)
    at = OperatingPoints(KINEMATICS, np.zeros((301, 3)), home[[0] * 301], {"time": times}, FIT.references)
    twist = displaced(at, "tracker_drift", "frame", c).twist
    values = [told[f"{kind}_{axis}"] for kind in ("shift", "turn") for axis in "xyz"]
    np.testing.assert_allclose(values, twist[-1] - twist[0], rtol=0, atol=1e-15)
    assert told["largest_shift"] == pytest.approx(np.ptp(twist[:, :3], axis=0).max(), rel=0.01)
    assert told["largest_turn"] == pytest.approx(np.ptp(twist[:, 3:], axis=0).max(), rel=0.01)


@pytest.mark.parametrize(("effect", "site"), [("tracker_drift", "frame"), ("target_drift", "platform")])
def test_a_drift_since_an_earlier_model_moves_nothing_on_average(effect: str, site: str) -> None:
    """An earlier model knows the frame: what has moved everywhere alike is no drift, but a shift."""
    start, span = FIT.references.time
    times = np.linspace(start, start + span, 3001)
    home = KINEMATICS.home
    at = OperatingPoints(KINEMATICS, np.zeros((3001, 3)), home[[0] * 3001], {"time": times}, FIT.references)
    known = effects_by_id()[effect]
    first, change = (one.basis(at, site) for one in (known, known.as_change()))
    mean = [np.abs((basis.twist * basis.sigma).mean(axis=0)).max() for basis in (first, change)]
    assert mean[0] > 1e-5
    assert mean[1] < 1e-3 * mean[0]


def test_an_instrument_that_reads_too_long_puts_points_farther_apart() -> None:
    at = operating_points(5, seed=9, fixed=FIT.references)
    seen = at.poses.T + displaced(at, "tracker_scale", "frame", given("tracker_scale", "frame", {0: 1e-4})).twist[:, :3]
    apart, true = (np.linalg.norm(T[1:] - T[0], axis=1) for T in (seen, at.poses.T))
    np.testing.assert_allclose(apart / true, 1.0 + 1e-4, rtol=1e-9)


def test_a_target_sits_beyond_the_tcp_in_its_own_frame() -> None:
    at = operating_points(5, seed=10)
    offset = np.array([1e-4, -2e-4, 3e-4])
    seen = displaced(at, "target_offset", "platform", offset).twist[:, :3]
    np.testing.assert_allclose(seen, at.poses.R @ offset, rtol=0, atol=1e-18)
    assert parameters("target_offset", offset) == {"offset_x": 1e-4, "offset_y": -2e-4, "offset_z": 3e-4}


def test_a_ball_out_of_round_lengthens_its_own_link_by_its_direction_alone() -> None:
    at = operating_points(20, seed=11, fixed=FIT.references)
    c = some("joint_runout", "link2b", at)
    longer = displaced(at, "joint_runout", "link2b", c).length
    assert not np.delete(longer, RODS["link2b"], axis=1).any()
    # Together, the carts carry everything along the tracks: where the tracks are parallel the links keep their directions.
    assert 0.3 < np.std(longer[:, RODS["link2b"]]) / parameters("joint_runout", c)["rms"] < 3.0
