"""Choice of poses, against every choice there is, against random ones, and against actual calibrations."""

from itertools import combinations

import numpy as np
import pytest
from accuracy_machines import MODEL, ROBOT, commands

import gtpin
from gtpin.accuracy.planning import Signal, best_poses, plan_poses, signal
from gtpin.data import Dataset, InstrumentSection
from gtpin.errors import ModelError
from gtpin.noise.noise import Noise

NOISE = Noise(1.5e-5, 5e-5)


def small(seed: int, poses: int = 12, size: int = 5) -> Signal:
    rng = np.random.default_rng(seed)
    B = 3.0 * rng.standard_normal((poses, 2, size)) * rng.uniform(0.1, 1.0, (poses, 1, 1))
    return Signal(B, tuple(f"p{i}" for i in range(size)))


def test_what_poses_tell_is_the_log_determinant() -> None:
    told = small(0)
    B = told.B.reshape(-1, 5)
    expected = np.log(np.linalg.det(np.eye(24) + B @ B.T))
    assert told.nats() == pytest.approx(expected)


def test_chosen_poses_are_the_best_of_all_choices_or_nearly_so() -> None:
    """Exchange finds a choice that no single exchange improves: of 20 small problems, the best of all in most."""
    hits = 0
    for seed in range(20):
        told = small(seed)
        best = max(told.nats(np.array(rows)) for rows in combinations(range(12), 4))
        found = told.nats(best_poses(told, 4))
        assert found >= 0.98 * best
        hits += found >= best - 1e-9
    assert hits >= 15


def test_no_exchange_of_a_single_pose_gains() -> None:
    told = small(3, poses=30)
    rows = best_poses(told, 6)
    found = told.nats(rows)
    for place in range(6):
        for other in set(range(30)) - set(rows.tolist()):
            assert told.nats(np.r_[np.delete(rows, place), other]) <= found + 1e-8


def test_the_best_beat_random_choices_in_nats_and_in_prediction() -> None:
    found = plan_poses(MODEL, commands(150, seed=1), 15, NOISE, commands(40, seed=2), draws=60)
    assert len(found.rows) == 15 == len(set(found.rows.tolist()))
    assert found.nats > found.random_nats.max()
    assert found.error < found.random_error.min()
    assert ((found.variance_reduction >= 0.0) & (found.variance_reduction <= 1.0)).all()


def test_learned_is_what_a_calibration_of_these_poses_reports() -> None:
    q = commands(30, seed=3)
    instrument = InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5)
    poses = MODEL.predict(q)
    rng = np.random.default_rng(4)
    dataset = Dataset(
        robot="gantry_tau",
        pose=np.array([str(i) for i in range(30)], dtype=object),
        q=q,
        position=poses.T + 1.5e-5 * rng.standard_normal((30, 3)),
        orientation=gtpin.Poses(poses.T, turned(rng) @ poses.R).quaternions,
        instrument=instrument,
    )
    calibration = gtpin.calibrate(dataset)
    told = signal(MODEL, q, NOISE)
    np.testing.assert_allclose(told.variance_reduction(), calibration.variance_reduction, atol=5e-3)
    found, reported = told.observability().indices, calibration.observability.indices
    assert found["O1"] == pytest.approx(reported["O1"], rel=0.05)


def turned(rng: np.random.Generator) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(5e-5 * rng.standard_normal((30, 3))).as_matrix()


def test_an_instrument_whose_place_is_not_known_tells_less() -> None:
    q = commands(30, seed=5)
    known, free = signal(MODEL, q, NOISE), signal(MODEL, q, NOISE, free_frame=True)
    assert (free.variance_reduction() <= known.variance_reduction() + 1e-9).all()
    assert free.variance_reduction().sum() < known.variance_reduction().sum() - 1.0
    assert free.observability().variance_reduction.sum() == pytest.approx(free.variance_reduction().sum(), abs=1e-4)


def test_orientations_tell_more_than_positions_alone() -> None:
    q = commands(20, seed=6)
    assert signal(MODEL, q, NOISE).nats() > signal(MODEL, q, NOISE, orientation=False).nats()


def test_the_frame_that_is_measured_in_does_not_matter() -> None:
    from scipy.spatial.transform import Rotation

    q = commands(10, seed=7)
    frame = gtpin.Frame(np.ones(3), Rotation.from_rotvec([0.4, 0.1, -0.9]).as_matrix())
    there = gtpin.Model(gtpin.Geometry.nominal(ROBOT), frame)
    assert signal(there, q, NOISE).nats() == pytest.approx(signal(MODEL, q, NOISE).nats())


def test_more_poses_than_there_are_is_refused() -> None:
    with pytest.raises(ModelError, match="13 poses out of 12"):
        best_poses(small(0), 13)
