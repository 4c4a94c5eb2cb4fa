"""A wrong place of the target on a machine whose platform hardly turns: data of the tests' own closures."""

import re
import warnings

import closures
import numpy as np
import pytest

import gtpin
from gtpin.data import InstrumentSection

TRUE, SIGMA = np.array([0.06, 0.0, 0.0]), 1.2e-5


def calibrated(declared: tuple[float, float, float] | str) -> gtpin.Calibration:
    """Positions of a target beside the TCP, by an instrument anywhere."""
    machine, rng = closures.nominal("gantry_tau"), np.random.default_rng(8)
    off = {name: 0.5 * size * rng.standard_normal() for name, size in machine.parameters().items()}
    q = machine.commands(150, 3)
    T, R = machine.off(off).follow(q, 0.1)
    read = T + R @ TRUE + SIGMA * rng.standard_normal(T.shape)
    section = InstrumentSection(position_sigma=SIGMA, frame="free", target=declared)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gtpin.calibrate(gtpin.Dataset("gantry_tau", [str(i) for i in range(150)], q, read, instrument=section))


@pytest.mark.slow
@pytest.mark.parametrize("declared", [(-0.06, 0.0, 0.0), (0.0, 0.0, 0.06), "tcp"])
def test_a_target_that_is_declared_elsewhere_is_found_where_it_sits(declared) -> None:
    """Neither the sign nor the axis of the offset, nor that there is one, may be taken up by joints and lengths in silence."""
    doubt = calibrated(declared).model.doubt
    told = re.search(r"at \[([^\]]+)\] m in the frame of the TCP \(\+- ([0-9.]+) mm\)", doubt)
    assert told is not None
    off = np.array([float(v) for v in told[1].split(",")]) - TRUE
    assert np.abs(off).max() < 4.0 * 1e-3 * float(told[2])


@pytest.mark.slow
def test_a_target_that_sits_where_it_is_declared_is_not_doubted() -> None:
    assert not calibrated((0.06, 0.0, 0.0)).model.doubt
