"""Arms of which the model leaves out that their joints yield, measured without declared noise: no worse than least squares."""

import pytest
from elastic_arm import draw, errors

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


@pytest.mark.parametrize("seeds", [(0,), pytest.param(range(100), marks=pytest.mark.slow)], ids=["1", "100"])
@pytest.mark.study
def test_positions_are_predicted_as_well_as_by_plain_least_squares(seeds):
    """Also where errors of the model look like scatter of the drives, or like noise with heavy tails."""
    ratios = []
    for seed in seeds:
        mine, plain = errors(draw(seed))
        ratios.append(mine / plain)
    assert max(ratios) <= 1.15
