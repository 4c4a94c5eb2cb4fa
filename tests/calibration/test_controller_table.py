"""The table of Denavit and Hartenberg of an arm, and its corrections, against matrices multiplied by hand."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.data import InstrumentSection
from gtpin.errors import GtpinWarning
from gtpin.export import export
from gtpin.model.dh import controller_table
from gtpin.model.fit_conditions import ModelDiscrepancy
from gtpin.output.shown import present

A = np.array([0.0, -0.425, -0.39225, 0.0, 0.0, 0.0])
D = np.array([0.089159, 0.0, 0.0, 0.10915, 0.09465, 0.0823])
ALPHA = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])
"""The table of the UR5 that its maker publishes."""


def by_hand(q, theta, a, d, alpha):
    """(4, 4) product of the matrices of a table, standard convention."""
    T = np.eye(4)
    for t, ai, di, al in zip(q + theta, a, d, alpha, strict=True):
        c, s, ca, sa = np.cos(t), np.sin(t), np.cos(al), np.sin(al)
        T = T @ [[c, -s * ca, s * sa, ai * c], [s, c * ca, -c * sa, ai * s], [0, sa, ca, di], [0, 0, 0, 1]]
    return T


def table_of(model, name, n):
    """(n,) nominal values of one parameter, 0 where the table has none."""
    found = {(p.site, p.name): p.nominal for p in controller_table(model)}
    return np.array([found.get((site, name), 0.0) for site in model.robot.sites[:n]])


def test_a_ur5_has_the_table_that_its_maker_publishes() -> None:
    model = gtpin.read_model("ur5")
    np.testing.assert_allclose(table_of(model, "theta", 6), 0.0, atol=1e-6)
    np.testing.assert_allclose(table_of(model, "a", 6)[:5], A[:5], atol=1e-6)
    np.testing.assert_allclose(table_of(model, "d", 6)[:5], D[:5], atol=1e-6)
    np.testing.assert_allclose(table_of(model, "alpha", 6)[:5], ALPHA[:5], atol=1e-6)


@pytest.mark.parametrize("name", ["ur5", "xarm7", "z1"])
def test_the_table_moves_the_tcp_as_the_robot(name: str) -> None:
    model = gtpin.read_model(name)
    robot, rng = model.robot, np.random.default_rng(1)
    n = len([p for p in controller_table(model) if p.name == "theta"])
    values = [table_of(model, what, n) for what in ("theta", "a", "d", "alpha")]
    q = np.zeros((4, robot.n_actuators))
    q[1:, :n] = rng.uniform(-1.0, 1.0, (3, n))
    found = model.predict(q)
    tables = [by_hand(row[:n], *values) for row in q]
    poses = [
        np.block([[R, T[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]) for R, T in zip(found.R, found.T, strict=True)
    ]
    # base * table(q) * tool = pose(q); the base turns about the first axis, the tool is what is left at q = 0.
    base = np.eye(4)
    base[:3, :3] = _first_frame(robot)
    tool = np.linalg.inv(base @ tables[0]) @ poses[0]
    for table, pose in zip(tables, poses, strict=True):
        np.testing.assert_allclose(base @ table @ tool, pose, atol=2e-6)


def _first_frame(robot):
    """The axes of the first frame: z the first joint's, x across the first two."""
    first, second = robot.actuators[0].axis, robot.actuators[1].axis
    x = np.cross(first, second)
    return np.column_stack([x, np.cross(first, x), first])


def test_a_calibration_finds_the_errors_of_a_table_and_says_what_it_can_not_find(tmp_path) -> None:
    rng = np.random.default_rng(4)
    q = rng.uniform([-2.5, -2.6, -2.4, -2.9, -2.6, -2.9], [2.5, -0.5, 2.4, 0.5, 2.6, 2.9], (80, 6))
    theta, a, sigma = np.zeros(6), A.copy(), 2e-5
    theta[2], theta[4], a[1], a[2] = 1e-3, -5e-4, A[1] - 2e-4, A[2] + 2e-4
    reflector = np.array([0.0312, -0.0008, 0.0607, 1.0])
    turned = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    seen = [turned @ (by_hand(row, theta, a, D, ALPHA) @ reflector)[:3] + [2.8, -1.1, -0.4] for row in q]
    dataset = gtpin.Dataset(
        "ur5",
        [f"p{i}" for i in range(80)],
        q,
        np.array(seen) + sigma * rng.standard_normal((80, 3)),
        instrument=InstrumentSection(frame="free", target="free", position_sigma=sigma),
    )
    calibration = gtpin.calibrate(dataset)
    found = {(p.site, p.name): p for p in controller_table(calibration.model)}
    sites = calibration.model.robot.sites
    true = {(site, "theta"): theta[i] for i, site in enumerate(sites)} | {
        (site, "a"): a[i] - A[i] for i, site in enumerate(sites)
    }
    for key, p in found.items():
        if p.determined:
            assert abs(p.correction - true.get(key, 0.0)) < 4.0 * p.sigma, key
    assert found["elbow_joint", "theta"].determined
    assert found["elbow_joint", "theta"].sigma < 5e-5
    # The first joint's zero and height are the tracker's frame, the last one's zero is the place of the reflector.
    for key in ((sites[0], "theta"), (sites[0], "d"), (sites[5], "theta")):
        assert not found[key].determined
        assert abs(found[key].correction) < 1e-6
    assert {zero.site for zero in calibration.zeros} >= {sites[1], sites[2], sites[3]}
    assert not {zero.site for zero in calibration.zeros} & {sites[0], sites[5]}
    said = calibration.summary().partition("The controller's table")[2]
    rows = {tuple(line.split()[:2]): line for line in said.splitlines() if line.strip()}
    assert "not determined" in rows[sites[0], "theta"]
    assert "±" in rows["elbow_joint", "theta"]
    first = present(calibration).lead
    assert not [row for table in first.content for row in table.rows if sites[0] in row[0] or sites[5] in row[0]]
    assert "gtpin export DIR -o dh.csv --format dh" in {step.command for step in first.steps}
    unexplained = present(replace(calibration, sigma_scale=2.0))  # nothing to act on
    assert "The controller's table" not in unexplained.text()
    assert not [step for step in unexplained.lead.steps if "dh.csv" in step.command]
    with pytest.warns(
        GtpinWarning, match=r"the target sat at 31\.\d+, -0\.\d+, 60\.\d+ mm"
    ):  # the reflector is no tool
        (file,) = export(calibration.model, tmp_path / "dh.csv", "dh")
    assert "tool" not in {p.site for p in found.values()}
    rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    assert rows[0] == ["joint", "parameter", "unit", "nominal", "correction", "sigma", "determined"]
    assert len(rows) == 1 + len(found)


@pytest.mark.parametrize(
    ("known", "what"),
    [
        (True, r"302 um of .* unexplained \(errors from pose to pose\): cor"),
        (False, "302 um .*; noise of the instrument is"),
    ],
)
def test_a_table_of_a_model_that_leaves_more_says_that_its_sigmas_are_too_small(known, what, tmp_path) -> None:
    plain = gtpin.read_model("ur5")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        export(replace(plain, unexplained=ModelDiscrepancy(0.0, 0.0)), tmp_path / "all.csv", "dh")
    with pytest.warns(gtpin.GtpinWarning, match=rf"dh.csv is of a model that leaves {what}"):
        export(replace(plain, unexplained=ModelDiscrepancy(1.743e-4, 0.0, known)), tmp_path / "dh.csv", "dh")


def test_a_geometry_that_no_table_has_exactly_is_reported_to_first_order_and_not_exported(
    monkeypatch, tmp_path
) -> None:
    plain = gtpin.read_model("ur5")
    size = plain.geometry.tolerance
    rng = np.random.default_rng(0)
    off, q = size * rng.standard_normal(len(size)), rng.uniform(-2.0, 2.0, (100, 6))
    J = plain.kinematics.geometry_jacobian(q, plain.kinematics.forward(q))[:, :6].reshape(600, -1) * size / 1e-5
    covariance = np.linalg.inv(J.T @ J + np.eye(len(size))) * np.outer(size, size)  # of poses read to 10 um and 10 urad

    def calibrated(share: float) -> gtpin.Model:
        geometry = plain.geometry.with_values(plain.geometry.values + share * off)
        return replace(plain, geometry=geometry, covariance=covariance)

    def corrections(share: float) -> np.ndarray:
        return np.array([p.correction for p in controller_table(calibrated(share))])

    exact = [corrections(share) for share in (1.0, 0.1)]
    monkeypatch.setattr("gtpin.model.dh.STEPS", 1)
    large, small = (np.abs(corrections(share) - one).max() for share, one in zip((1.0, 0.1), exact, strict=True))
    assert 0.0 < small < large / 50.0  # an error of second order: a hundredth
    model = calibrated(1.0)
    with pytest.raises(gtpin.GtpinError, match="has not converged in 1 steps; export a URDF"):
        export(model, tmp_path / "dh.csv", "dh")


@pytest.mark.parametrize("name", ["gantry_tau", "panda"])
def test_other_robots_have_no_table(name: str, tmp_path) -> None:
    model = gtpin.read_model(name)
    assert controller_table(model) == ()
    with pytest.raises(gtpin.GtpinError, match="is not a serial arm"):
        export(model, tmp_path / "dh.csv", "dh")
