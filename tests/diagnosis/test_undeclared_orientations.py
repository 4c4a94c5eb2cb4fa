"""A declared noise of positions is the noise of a verdict, whether that of orientations is declared or not."""

from dataclasses import replace

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, nominal
from diagnosed import quietly

import gtpin
from gtpin.data import Dataset

POSES = 120


def seen(scatter: float, declared: bool) -> Dataset:
    """A Gantry-Tau's poses with further errors of the positions, m per axis, that differ from pose to pose."""
    rng, plain = np.random.default_rng(8), nominal("gantry_tau")
    real = plain.off({name: rng.normal(0.0, sigma) for name, sigma in plain.parameters().items()})
    data = real.measured(plain.commands(POSES, 8), rng)
    sigmas = {} if declared else {"orientation_sigma": None}
    return replace(
        data,
        position=data.position + rng.normal(0.0, scatter, (POSES, 3)),
        instrument=data.instrument.model_copy(update=sigmas),
    )


@pytest.mark.parametrize(("scatter", "verdict"), [(4e-5, "unknown"), (0.0, "none")])
def test_the_verdict_is_the_same(scatter: float, verdict: str) -> None:
    found = [quietly(gtpin.diagnose, seen(scatter, declared)) for declared in (True, False)]
    assert [one.verdict for one in found] == [verdict] * 2
    assert [one.noise_source for one in found] == ["declared"] * 2
    assert [[doubt.reason for doubt in one.doubts] for one in found] == [["excess"] if scatter else []] * 2
    assert found[1].gap.floor == pytest.approx(found[0].gap.floor, rel=0.01)
    told = [[text for text in one.warnings if "orientation_sigma is not declared" in text] for one in found]
    assert [len(texts) for texts in told] == [
        0,
        0 if scatter else 1,
    ]  # else the noise of the positions is contradicted too


def test_a_calibration_says_which_noise_of_orientations_it_assumes() -> None:
    with pytest.warns(gtpin.GtpinWarning, match="orientation_sigma is not declared"):
        found = gtpin.calibrate(seen(0.0, False))
    assert found.assumed_turn == pytest.approx(ORIENTATION_SIGMA, rel=0.15)
    assert found.explained
    assert found.noise_known
    told = found.to_json()
    assert told["position_noise_floor"] is not None
    assert told["orientation_noise_floor"] is None  # it is what was left
    assert found.model.unexplained is not None
    assert found.model.unexplained.none


def test_without_a_noise_of_positions_that_of_orientations_does_not_make_it_known() -> None:
    data = seen(0.0, True)
    data = replace(data, instrument=data.instrument.model_copy(update={"position_sigma": None}))
    found = gtpin.calibrate(data)
    assert not found.noise_known
    assert found.assumed_turn is None
