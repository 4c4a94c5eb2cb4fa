"""Each shipped machine's forward kinematics is that of a solution that knows nothing of gtpin's."""

import numpy as np
import pytest
from closures import NAMES, nominal
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log

CLOSE = 1e-10


def three_spheres(centres: np.ndarray, radii: np.ndarray, near: np.ndarray) -> np.ndarray:
    """The point (N, 3) at three distances (N, 3) from three centres (N, 3, 3), of the two the one nearer to a point."""
    a, b, c = centres[:, 0], centres[:, 1] - centres[:, 0], centres[:, 2] - centres[:, 0]
    d = np.linalg.norm(b, axis=1)
    ex = b / d[:, None]
    i = np.einsum("ni,ni->n", ex, c)
    ey = c - i[:, None] * ex
    j = np.linalg.norm(ey, axis=1)
    ey /= j[:, None]
    r = radii.T**2
    x = (r[0] - r[1] + d**2) / (2.0 * d)
    y = (r[0] - r[2] + i**2 + j**2 - 2.0 * i * x) / (2.0 * j)
    z = np.sqrt(r[0] - x**2 - y**2)
    foot, up = a + x[:, None] * ex + y[:, None] * ey, z[:, None] * np.cross(ex, ey)
    both = np.stack([foot + up, foot - up])
    return both[np.linalg.norm(both - near, axis=2).argmin(axis=0), np.arange(len(a))]


def forward(name: str, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    poses = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot(name))).forward(q)
    assert poses.reached.all()
    return poses.T, poses.R


def turn(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(log(one @ np.swapaxes(other, 1, 2))).max())


@pytest.mark.parametrize("name", NAMES)
def test_every_machine_loads_by_name_and_closes_at_home_where_it_says(name: str) -> None:
    robot, closures = gtpin.load_robot(name), nominal(name)
    posture = gtpin.home(robot)
    assert name in gtpin.robot_names()
    assert np.abs(closures.residual(posture.q[None], posture.T[None], posture.R[None])).max() < 1e-13
    assert np.abs(posture.T - closures.T).max() < 1e-6  # Jugglebot's own length is rounded to a micrometre


@pytest.mark.parametrize("name", NAMES)
def test_sites_and_links_have_the_machine_s_own_names(name: str) -> None:
    robot = gtpin.load_robot(name)
    legs = tuple(f"leg{i}" for i in range(1, 7))
    carts = {
        "gantry_tau_6dof": ("1", "2a", "2b", "3a", "3b", "3c"),
        "linear_delta": ("1", "2", "3"),
        "tau": ("1", "2", "3"),
    }
    word = "arm" if name == "tau" else "cart"
    assert robot.sites == (legs if name.startswith("stewart") else tuple(f"{word}{c}" for c in carts[name]))
    links = {frame.name for frame in robot.model.frames}
    assert {*robot.sites, *robot.rod_sites, "platform"} <= links


@pytest.mark.parametrize("name", NAMES)
def test_arrays_and_pinocchio_follow_the_tests_own_closures(name: str) -> None:
    closures = nominal(name)
    q = closures.in_range(np.random.default_rng(0), 60)
    T, R = closures.follow(q, 0.02)
    there = forward(name, q)
    assert np.abs(there[0] - T).max() < CLOSE
    assert turn(there[1], R) < CLOSE
    posture = gtpin.home(gtpin.load_robot(name))
    for i in range(8):
        there = posture.moved_to(q[i])
        assert np.abs(there.T - T[i]).max() < CLOSE
        assert turn(there.R[None], R[i][None]) < CLOSE


def test_the_delta_is_where_its_three_spheres_meet() -> None:
    """Parallel pairs of equal rods keep the platform level; what is left is 999 mm from three points on the towers."""
    q = nominal("linear_delta").in_range(np.random.default_rng(1), 200)
    towers = np.radians([210.0, 330.0, 90.0])
    centres = np.zeros((len(q), 3, 3))
    centres[..., 0], centres[..., 1] = 3.0 * 0.17475 * np.cos(towers), 3.0 * 0.17475 * np.sin(towers)
    centres[..., 2] = 0.3 + np.sqrt(9.0 * (0.333**2 - 0.17475**2)) + q
    T, R = forward("linear_delta", q)
    assert np.abs(T - three_spheres(centres, np.full((len(q), 3), 0.999), np.zeros(3))).max() < CLOSE
    assert turn(R, np.tile(np.eye(3), (len(q), 1, 1))) < CLOSE


def test_the_rotary_tau_turns_with_its_third_arm_and_is_where_three_spheres_meet() -> None:
    closures = nominal("tau")
    q = closures.in_range(np.random.default_rng(2), 200)
    yaw = Rotation.from_euler("z", q[:, [2]]).as_matrix()
    single = [0, 1, 3]  # one rod of each arm
    centres = closures.C(q)[:, single] - closures.P[single] @ np.swapaxes(yaw, 1, 2)
    T, R = forward("tau", q)
    assert turn(R, yaw) < CLOSE
    assert np.abs(T - three_spheres(centres, closures.L(q)[:, single], closures.T)).max() < CLOSE


@pytest.mark.parametrize("name", ["stewart", "stewart_jugglebot", "gantry_tau_6dof"])
def test_machines_of_six_drives_go_back_where_their_closed_inverse_came_from(name: str) -> None:
    """A leg is as long as its joints are apart; a cart stands where a sphere about the platform's joint cuts its track."""
    closures, rng = nominal(name), np.random.default_rng(3)
    lift = 0.12 if name == "stewart_jugglebot" else 0.0  # its home is at the lower end
    T = closures.T + np.array([0.0, 0.0, lift]) + rng.uniform(-0.1, 0.1, (200, 3))
    R = Rotation.from_rotvec(rng.uniform(-0.15, 0.15, (200, 3))).as_matrix() @ closures.R
    a = T[:, None] + closures.P @ np.swapaxes(R, 1, 2) - closures.C0
    if closures.kind == "leg":
        q = np.linalg.norm(a, axis=2) - closures.L0
    else:
        along = np.einsum("nki,ki->nk", a, closures.axis)
        q = along - np.sqrt(along**2 - np.einsum("nki,nki->nk", a, a) + closures.L0**2)
    inside = ((q >= closures.lower) & (q <= closures.upper)).all(axis=1)
    assert inside.mean() > 0.5
    there = forward(name, q[inside])
    assert np.abs(there[0] - T[inside]).max() < CLOSE
    assert turn(there[1], R[inside]) < CLOSE


@pytest.mark.parametrize("name", NAMES)
def test_exported_urdf_predicts_what_the_model_predicts(name: str, tmp_path) -> None:
    geometry = gtpin.Geometry.nominal(gtpin.load_robot(name), without=["scale"] if name == "stewart_jugglebot" else [])
    rng = np.random.default_rng(4)
    geometry = geometry.with_values(
        geometry.values + 0.3 * geometry.tolerance * rng.standard_normal(len(geometry.values))
    )
    model = gtpin.Model(geometry)
    gtpin.write_model(model, tmp_path / "model")
    q = nominal(name).in_range(rng, 50, share=0.6)
    expected = model.predict(q)
    assert expected.reached.all()
    again = gtpin.read_model(tmp_path / "model").predict(q)
    np.testing.assert_array_equal(again.T, expected.T)
    urdf = gtpin.read_model(tmp_path / "model" / "robot.urdf").predict(q)
    assert np.abs(urdf.T - expected.T).max() < 1e-9
    assert turn(urdf.R, expected.R) < 1e-9


DRIVES = ("encoder_scale", "linearity", "rack_periodic", "rack_step", "zero_shift", "backlash", "servo_lag")
GUIDES = ("straightness", "cart_rotation", "cart_compliance")
LINKS = ("joint_clearance", "joint_runout")


@pytest.mark.parametrize("name", NAMES)
def test_sites_are_the_machine_s_own_parts(name: str) -> None:
    robot, closures = gtpin.load_robot(name), nominal(name)
    sites = {effect: known.sites(robot) for effect, known in effects_by_id().items()}
    for effect in (*DRIVES, "cross_coupling"):
        assert sites[effect] == closures.sites, effect
    assert sites["thermal_track"] == (closures.sites if closures.kind in ("track", "leg") else ())
    for effect in GUIDES:
        assert sites[effect] == (closures.sites if closures.kind == "track" else ()), effect
    for effect in LINKS:
        assert sites[effect] == closures.rods, effect
    for effect in ("link_compliance", "thermal_links"):
        assert sites[effect] == ("arm", *closures.rods), effect
    for effect in ("tracker_drift", "frame_shift", "tracker_scale"):
        assert sites[effect] == ("frame",), effect
    assert sites["target_offset"] == ("platform",)


@pytest.mark.parametrize("name", ["stewart", "stewart_jugglebot"])
def test_a_drive_s_error_is_a_leg_s_error_in_length(name: str) -> None:
    """The leg's length by its ends, with the error, is the length without it and the error."""
    closures, rng = nominal(name), np.random.default_rng(0)
    kinematics = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot(name)))
    q = closures.in_range(rng, 40)
    session = np.array([f"day{i % 2}" for i in range(len(q))], dtype=object)
    at = OperatingPoints(kinematics, q, kinematics.forward(q), {"session": session})
    sizes = {"encoder_scale": 1e-3, "zero_shift": 5e-4}
    for effect, size in sizes.items():
        known = effects_by_id()[effect]
        coefficients = np.zeros(len(known.basis(at, "leg3")))
        coefficients[0] = size
        acting = ActiveEffect(known, "leg3", None, coefficients, np.zeros((len(coefficients),) * 2), at.references)
        poses = with_effects(kinematics, q, at.covariates, [acting])
        error = size * (q[:, 2] if effect == "encoder_scale" else (session == "day0"))
        gap = closures.residual(q, poses.T, poses.R)
        np.testing.assert_allclose(gap[:, 2], error, rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.delete(gap, 2, axis=1), 0.0, atol=1e-12)


def test_an_arm_s_error_is_an_angle() -> None:
    closures = nominal("tau")
    kinematics = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot("tau")))
    q = closures.in_range(np.random.default_rng(1), 40)
    at = OperatingPoints(kinematics, q, kinematics.forward(q), {})
    known = effects_by_id()["encoder_scale"]
    coefficients = np.zeros(len(known.basis(at, "arm2")))
    coefficients[0] = 1e-3
    acting = ActiveEffect(known, "arm2", None, coefficients, np.zeros((len(coefficients),) * 2), at.references)
    poses = with_effects(kinematics, q, {}, [acting])
    np.testing.assert_allclose(closures.residual(q * [1.0, 1.001, 1.0], poses.T, poses.R), 0.0, atol=1e-12)
