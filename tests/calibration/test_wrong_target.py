"""A wrong place of the target, on a machine whose platform hardly turns (the tests' own closures) and an arm (Pinocchio)."""

import contextlib
import re
import warnings

import closures
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from virtual_arm import Arm

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


@pytest.mark.parametrize("along", range(3))
@pytest.mark.parametrize("wide", [0.3, 1.5])
def test_an_arm_whose_target_is_declared_at_the_tcp_is_told_of_the_target(wide: float, along: int) -> None:
    """Along an axis of the TCP frame the place of the target is a parameter of the tool: neither is hidden by the other."""
    rng = np.random.default_rng(1)
    arm, q = Arm.drawn(rng, 4e-4), rng.uniform(-wide, wide, (80, 6))
    plain = arm.measured(q, rng, (2e-5, 5e-5), free=False)
    off = Rotation.from_quat(plain.orientation, scalar_first=True).apply(0.06 * np.eye(3)[along])
    section = InstrumentSection(position_sigma=2e-5, frame="robot", target=(0.0, 0.0, 0.0))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with contextlib.suppress(gtpin.GtpinError):  # where it hardly turns, the data are refused
            gtpin.calibrate(gtpin.Dataset("ur5", plain.pose, q, plain.position + off, instrument=section))
    assert re.search(
        "the target (is not|looks to sit|does not look to be) ", " ".join(str(one.message) for one in said)
    )
