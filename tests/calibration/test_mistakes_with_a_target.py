"""Usual mistakes are named of a target with a declared place as they are of one at the TCP: data of the tests' own closures."""

import closures
import numpy as np
import pytest
from readable import check_as_they_stand

import gtpin
from gtpin.data import InstrumentSection
from gtpin.errors import DatasetError

TARGET, SIGMA = (0.06, -0.02, 0.03), 1.2e-5
SWAPPED, REVERSED, LEFT_HANDED = [1, 0, 2], [1.0, 1.0, -1.0], [0, 2, 1]


def measured(robot: str, rng: np.random.Generator, frame: str) -> tuple[np.ndarray, np.ndarray, InstrumentSection]:
    """Commands of a machine within a fifth of its tolerances, and positions of a target beside the TCP."""
    machine = closures.nominal(robot)
    off = {name: 0.2 * size * rng.standard_normal() for name, size in machine.parameters().items()}
    q = machine.commands(60, 3)
    T, R = machine.off(off).follow(q, 0.1)
    read = T + R @ TARGET + SIGMA * rng.standard_normal(T.shape)
    return q, read, InstrumentSection(position_sigma=SIGMA, frame=frame, target=TARGET)


def check(q: np.ndarray, read: np.ndarray, section: InstrumentSection) -> None:
    """The check before a fit."""
    check_as_they_stand(gtpin.Dataset("gantry_tau", [str(i) for i in range(len(q))], q, read, instrument=section))


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["free", "robot"])
def test_a_mistake_is_named_though_the_target_has_a_declared_place(frame: str) -> None:
    q, read, section = measured("gantry_tau", np.random.default_rng(5), frame)
    check(q, read, section)
    for wrong, said in (
        ((q[:, SWAPPED], read), "q1 and q2 look swapped"),
        ((q * REVERSED, read), "q3 looks reversed"),
        ((q, read[:, LEFT_HANDED]), "left-handed|y and z look swapped"),
    ):
        with pytest.raises(DatasetError, match=said):
            check(*wrong, section)
