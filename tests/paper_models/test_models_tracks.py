"""Measured tracks, out of carts measured by themselves in a frame of their own."""

import model_machines as mm
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError, ModelError
from gtpin.paper.tracks import MeasuredTrack, measured_tracks

PATHS = tuple(mm.bent(mm.AXES[c], mm.wavy(1e-4, 10 + c)) for c in range(3))
FRAMES = [Rotation.identity(), *Rotation.random(6, rng=np.random.default_rng(1))]


@pytest.mark.parametrize("turn", FRAMES)
def test_a_known_path_comes_out_of_any_trackers_frame(turn: Rotation):
    # Targets at the same place of every cart, so that the tracks' places tell the turn about their direction exactly but
    # for the paths' own residuals: 1e-4 m on 1.5 m.
    tracks = measured_tracks(mm.ROBOT, mm.carts_of(PATHS, turn=turn, targets=np.tile([0.1, 0.05, -0.1], (3, 1))))
    q = np.linspace(-0.65, 0.70, 101)
    for track, path in zip(tracks, PATHS, strict=True):
        assert np.allclose(track.displacement(q), path(q), rtol=0, atol=1e-7)


@pytest.mark.parametrize("turn", FRAMES)
def test_the_trackers_frame_does_not_matter_wherever_the_targets_are(turn: Rotation):
    targets = np.array([[0.1, 0.0, 0.0], [0.0, -0.15, 0.1], [0.05, 0.1, 0.1]])
    one = measured_tracks(mm.ROBOT, mm.carts_of(PATHS, turn=Rotation.identity(), targets=targets))
    other = measured_tracks(mm.ROBOT, mm.carts_of(PATHS, turn=turn, shift=(-7.0, 2.0, 1.0), targets=targets))
    for a, b in zip(one, other, strict=True):
        assert np.allclose(a.path, b.path, rtol=0, atol=1e-12)
        assert np.allclose(a.origin, b.origin, rtol=0, atol=1e-12)


@pytest.mark.parametrize("turn", FRAMES)
def test_the_carts_measured_turning_comes_out_too(turn: Rotation):
    turns = tuple(mm.bent(np.array([0.0, 1e-4, 0.0]), mm.wavy(2e-4, 20 + c)) for c in range(3))
    carts = mm.carts_of(PATHS, turn=turn, turns=turns)
    tracks = measured_tracks(mm.ROBOT, carts, orientations=True)
    nearest = np.argmin(np.abs(mm.POINTS))  # where the measured turning counts from
    for track, known in zip(tracks, turns, strict=True):
        wanted = known(mm.POINTS) - known(mm.POINTS)[nearest]
        assert np.allclose(track.turn(mm.POINTS), wanted, rtol=0, atol=1e-6)  # of 2e-4 rad: rotations hardly commute


def test_orientations_are_used_only_on_demand():
    carts = mm.carts_of(PATHS, turns=tuple(mm.bent(np.zeros(3), mm.wavy(2e-4, c)) for c in range(3)))
    assert all(track.turns is None for track in measured_tracks(mm.ROBOT, carts))


def test_between_measured_points_the_path_is_straight():
    path = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [2.0, 0.0, 0.4]])
    track = MeasuredTrack(np.array([-1.0, 0.0, 2.0]), path, None, np.zeros(3))
    assert np.allclose(track.displacement(np.array([-0.5, 1.0])), [[0.5, 0.1, 0.0], [1.5, 0.1, 0.2]])
    assert np.allclose(track.slope(np.array([-0.5, 1.0])), [[1.0, 0.2, 0.0], [0.5, -0.1, 0.2]])


def test_a_track_ends_where_its_measurement_ends():
    (track, *_) = measured_tracks(mm.ROBOT, mm.carts_of(PATHS))
    ends = track.q[[0, -1]]
    assert ends.tolist() == [-0.65, 0.70]
    assert np.isfinite(track.displacement(ends)).all()
    assert np.isnan(track.displacement(ends + np.array([-1e-9, 1e-9]))).all()


def test_repeated_visits_count_as_their_mean():
    carts = mm.carts_of(PATHS)
    off = 1e-5 * np.random.default_rng(0).standard_normal(carts.position.shape)
    twice = CartMeasurements(
        np.tile(carts.cart, 2), np.tile(carts.q, 2), np.concatenate([carts.position + off, carts.position - off])
    )
    for one, two in zip(measured_tracks(mm.ROBOT, carts), measured_tracks(mm.ROBOT, twice), strict=True):
        assert np.allclose(one.path, two.path, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kept", [lambda q: q > 0.0, lambda q: q < 0.0, lambda q: np.abs(q) < 0.02])
def test_a_cart_measured_on_one_side_only_is_refused(kept):
    carts = mm.carts_of(PATHS)
    rows = (carts.cart != 2) | kept(carts.q)
    with pytest.raises(DatasetError, match="cart2"):
        measured_tracks(mm.ROBOT, CartMeasurements(carts.cart[rows], carts.q[rows], carts.position[rows]))


def test_turning_that_was_not_measured_is_refused():
    with pytest.raises(DatasetError, match="orientations"):
        measured_tracks(mm.ROBOT, mm.carts_of(PATHS), orientations=True)


def test_commands_of_a_track_must_ascend():
    with pytest.raises(ModelError):
        MeasuredTrack(np.array([0.0, 0.0]), np.zeros((2, 3)), None, np.zeros(3))
