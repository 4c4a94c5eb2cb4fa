"""Folds: a partition of the rows in which visits to one pose go together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gtpin.data import Dataset, by_region, by_session, random
from gtpin.errors import DatasetError


def dataset(n, repeats, seed, stretch=(1, 1, 1)):
    rng = np.random.default_rng(seed)
    pose = np.concatenate([np.arange(n), rng.integers(0, n, repeats)])
    position = rng.uniform(0, 1, (n, 3))[pose] * stretch
    session = rng.integers(0, 3, n + repeats)
    session[:2] = (0, 1)
    return Dataset("r", pose, np.arange(n)[pose][:, None], position, covariates={"session": session})


def is_partition_of_poses(masks, data):
    assert (np.sum(masks, axis=0) == 1).all()
    assert all(mask.any() for mask in masks)
    assert all(mask.dtype == bool for mask in masks)
    for pose in set(data.pose):
        assert sum(mask[data.pose == pose].any() for mask in masks) == 1


@pytest.mark.slow
@settings(deadline=None, derandomize=True)
@given(st.integers(8, 40), st.integers(0, 20), st.integers(0, 5), st.integers(2, 8))
def test_every_split_is_a_partition_that_no_pose_straddles(n, repeats, seed, folds):
    data = dataset(n, repeats, seed)
    for masks in (by_region(data, folds), random(data, folds, seed)):
        is_partition_of_poses(masks, data)
        assert len(masks) == folds
        sizes = [len(set(data.pose[mask])) for mask in masks]
        assert max(sizes) - min(sizes) <= 1
    is_partition_of_poses(by_session(data), data)


def test_sessions_without_shared_poses_are_the_folds():
    data = Dataset("r", [1, 2, 3], [[1.0], [2.0], [3.0]], np.zeros((3, 3)), covariates={"session": ["b", "a", "b"]})
    assert [mask.tolist() for mask in by_session(data)] == [[False, True, False], [True, False, True]]


def test_a_pose_goes_with_the_session_that_visited_it_most():
    pose, session = [1, 2, 2, 2, 3], ["a", "a", "b", "b", "b"]
    data = Dataset("r", pose, np.array(pose, float)[:, None], np.zeros((5, 3)), covariates={"session": session})
    assert by_session(data)[0].tolist() == [True, False, False, False, False]


def test_one_session_or_none_can_not_be_split():
    for covariates in ({}, {"session": [1, 1.0]}):
        data = Dataset("r", [1, 2], [[1.0], [2.0]], np.zeros((2, 3)), covariates=covariates)
        with pytest.raises(DatasetError):
            by_session(data)


def test_regions_cut_the_longest_side():
    data = dataset(40, 10, 0, stretch=(1, 10, 1))
    low, high = by_region(data, 2)
    assert data.position[low, 1].max() < data.position[high, 1].min()


def test_regions_are_smaller_than_the_whole():
    data = dataset(400, 0, 1)
    for mask in by_region(data, 8):
        assert np.prod(np.ptp(data.position[mask], axis=0)) < 0.3


def test_folds_do_not_depend_on_the_order_of_rows():
    data = dataset(30, 10, 2)
    order = np.random.default_rng(3).permutation(len(data))
    for split in (lambda d: by_region(d, 4), lambda d: random(d, 4, 7), by_session):
        for mask, shuffled in zip(split(data), split(data.take(order)), strict=True):
            assert (mask[order] == shuffled).all()


def test_the_seed_makes_random_folds_repeatable_and_different():
    data = dataset(30, 0, 0)
    assert np.array_equal(random(data, 3, 1), random(data, 3, 1))
    assert not np.array_equal(random(data, 3, 1), random(data, 3, 2))


@pytest.mark.parametrize("folds", [-1, 0, 1, 11])
def test_too_few_or_too_many_folds_are_refused(folds):
    data = dataset(10, 5, 0)
    for split in (by_region, random):
        with pytest.raises(DatasetError, match="10 poses"):
            split(data, folds)
