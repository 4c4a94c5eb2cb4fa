"""Usual mistakes are named with a declared target too, and all of those that fit alike: data of the tests' own closures."""

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


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [[0, 2, 1], [1, 0, 2]])
def test_where_a_machine_is_symmetric_all_columns_that_may_be_swapped_are_named(swapped: list[int]) -> None:
    """Three towers 120 degrees apart, and a free frame: which two were swapped does not show, nor whether the frame is."""
    machine, rng = closures.nominal("linear_delta"), np.random.default_rng(6)
    q = machine.in_range(rng, 60)
    read = machine.follow(q, 0.02)[0] + SIGMA * rng.standard_normal((60, 3))
    section = InstrumentSection(position_sigma=SIGMA, frame="free")
    dataset = gtpin.Dataset("linear_delta", [str(i) for i in range(60)], q[:, swapped], read, instrument=section)
    with pytest.raises(DatasetError) as told:
        gtpin.calibrate(dataset)
    assert all(f"{one} look swapped" in told.value.what for one in ("q1 and q2", "q1 and q3", "q2 and q3"))
    assert "left-handed" in told.value.what
    assert "equally well with each" in str(told.value)
