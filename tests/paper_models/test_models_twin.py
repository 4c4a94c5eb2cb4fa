"""The twin of the paper's experiment: what the paper reports of its machine holds for the twin."""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scripts import load

from gtpin import Dataset
from gtpin.comparison.compare import Comparison, compare
from gtpin.data import CartMeasurements
from gtpin.errors import GtpinWarning

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "examples" / "dressler2010"
SEEDS = (0, 1, 2, 2010)

if not EXAMPLE.is_dir():
    pytest.skip("the examples are not here", allow_module_level=True)
pytest.importorskip("matplotlib")
held_out, residuals = load("dressler2010/paper_closures").held_out, load("dressler2010/paper_figures").residuals


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Dataset, CartMeasurements]]:
    """Sets 1 and 2, and set 3, of four draws of the twin's errors, the examples' own among them."""
    found = []
    for seed in SEEDS:
        folder = tmp_path_factory.mktemp("twin") / "twin"
        command = [sys.executable, str(EXAMPLE / "measure.py"), str(folder), str(seed)]
        subprocess.run(command, check=True, timeout=60)
        set3 = CartMeasurements.read(folder.with_name("twin-set3.csv"), 3)
        found.append((Dataset.read(folder), set3))
    return found


def test_its_sets_are_as_large_as_the_papers(twins):
    for dataset, set3 in twins:
        assert len(dataset) == 176
        assert [(dataset.carts.cart == c).sum() for c in (1, 2, 3)] == [28] * 3
        assert [(set3.cart == c).sum() for c in (1, 2, 3)] == [150] * 3
        assert (dataset.carts.q.min(), dataset.carts.q.max()) == (-0.65, 0.70)


def test_the_grid_is_six_layers_each_walked_back(twins):
    (dataset, _), *_ = twins
    layer = np.arange(176) // 30
    x = np.array([dataset.position[layer == k, 0].mean() for k in range(6)])
    assert np.ptp(np.diff(x)) < 1e-3  # evenly spaced
    across = dataset.position[:, 1:]
    assert np.abs(across[30:60] - across[:30][::-1]).max() < 5e-3
    assert np.linalg.norm(np.diff(dataset.position, axis=0), axis=1).max() < 0.3  # no way back through the workspace


def test_the_plate_turns_by_a_tenth_to_half_a_degree(twins):
    for dataset, _ in twins:
        angles = Rotation.from_quat(dataset.orientation.copy(), scalar_first=True).as_euler("ZYZ", degrees=True)
        alpha, beta, gamma = np.ptp(np.unwrap(angles, period=360, axis=0), axis=0)
        assert alpha == pytest.approx(0.1, abs=0.1)
        assert beta == pytest.approx(0.5, abs=0.1)
        assert alpha < gamma < beta


def test_cart_2_is_the_least_linear_by_some_tens_to_about_140_micrometres(twins):
    largest = np.array([[np.hypot(*residuals(dataset.carts, c)[1:]).max() for c in (1, 2, 3)] for dataset, _ in twins])
    assert (largest[:, 1] > 1.5 * largest[:, [0, 2]].max(axis=1)).all()
    assert 100e-6 < largest[:, 1].mean() < 180e-6


def test_elsewhere_the_carts_are_elsewhere_more_across_than_along_and_cart_2_most(twins):
    along, across = (
        np.mean([[_beyond(dataset, set3, c, way) for c in (1, 2, 3)] for dataset, set3 in twins], axis=0)
        for way in (1, 2)
    )
    assert (across > along).all()
    assert np.argmax(along) == np.argmax(across) == 1
    assert along[2] > along[0]


def _beyond(dataset: Dataset, set3: CartMeasurements, cart: int, way: int) -> float:
    """Size, m, by which residuals of set 3 exceed those of set 2, whose carts are moved together."""
    squares = [(residuals(carts, cart)[way] ** 2).mean() for carts in (set3, dataset.carts)]
    return float(np.sqrt(max(squares[0] - squares[1], 0.0)))


@pytest.fixture(scope="module")
def compared(twins) -> list[Comparison]:
    """On each twin; no model takes what it lacks for gross errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", GtpinWarning)
        return [compare(dataset) for dataset, _ in twins]


@pytest.fixture(scope="module")
def by_closures(twins) -> list[tuple[np.ndarray, np.ndarray]]:
    """On each twin, the errors and costs of the paper's own procedure."""
    return [held_out(dataset) for dataset, _ in twins]


def test_compared_on_it_the_models_gain_as_the_paper_says(compared):
    tables = [found.table().set_index("model") for found in compared]
    mean, largest = (np.mean([table[name] for table in tables], axis=0) for name in ("mean_um", "max_um"))
    one, two, three, four, five = mean
    assert one == mean.max()
    assert two < one  # cart 2's measured track helps the reduced arm
    assert four < three  # and the full one
    assert five < three
    assert five < four
    # The paper has 140, 120, 110, 100, 90 and 410, 440, 260, 340, 240 um: docs/paper.md says why the twin's are others. These
    # four draws are always the same, so that only a change of the fits moves their means.
    np.testing.assert_allclose(mean, [134.9, 131.0, 129.7, 124.7, 121.5], rtol=0.02)
    np.testing.assert_allclose(largest, [361.9, 335.7, 344.6, 336.1, 345.6], rtol=0.05)  # one pose decides each


def test_pose_residuals_predict_no_worse_than_the_papers_cost(compared, by_closures):
    """Another estimator on the same poses. With misfit taken for scatter of the drives, a largest error was twice its."""
    for ours, (theirs, _) in zip(compared, by_closures, strict=True):
        table = ours.table()
        assert (table["mean_um"] < 1.06e6 * theirs.mean(axis=1)).all()
        assert (table["max_um"] < 1.4e6 * theirs.max(axis=1)).all()  # one pose decides it


def test_the_measured_track_helps_on_cart_2_and_hurts_on_cart_3(by_closures):
    ratio = [costs[3] / costs[2] for _, costs in by_closures]
    link1, link2a, link2b, link3a, link3b, _ = np.mean(ratio, axis=0)
    assert 0.9 < link1 < 1.15  # linear as it is, cart 1 neither gains nor loses
    assert max(link2a, link2b) < 0.7
    assert min(link3a, link3b) > 1.3
