"""Equal rows are copies where there are more of them than rounding and scatter allow; otherwise they are visits."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data.plausible import command_steps, copies

POSES, VISITS, SETS = 96, 3, 200
UM = 1e-6
Drawn = tuple[list[str], np.ndarray, np.ndarray]
Make = Callable[[np.random.Generator, float, float], gtpin.Dataset]

INSTRUMENTS = """schema = "gtpin-dataset/2"
robot = "gantry_tau"
[[instrument]]
name = "bench"
kind = "tilt"
"""


def rounded(rng: np.random.Generator, step: float, scatter: float, poses: int = POSES, visits: int = VISITS) -> Drawn:
    """Ids, commands and measured positions (N, 3), m, of a small arm whose readings have a step and scatter between visits."""
    of = np.repeat(np.arange(poses), visits)
    q = np.round(rng.uniform(-1.0, 1.0, (poses, 3)), 6)[of]
    position = rng.uniform(0.1, 0.3, (poses, 3))[of] + scatter * rng.standard_normal((len(of), 3))
    return [f"p{i}" for i in of], q, np.round(position / step) * step


def positions(rng: np.random.Generator, step: float, scatter: float, **shape: int) -> gtpin.Dataset:
    return gtpin.Dataset("meca500", *rounded(rng, step, scatter, **shape))


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> gtpin.Dataset:
    """A dataset of a level with as many rows as `positions` has, read from its files."""
    folder: Path = tmp_path_factory.mktemp("bench")
    pose, q, position = rounded(np.random.default_rng(0), UM, UM)
    lines = [
        f"{p},{','.join(map(repr, [*a, *x[:2]]))}" for p, a, x in zip(pose, q.tolist(), position.tolist(), strict=True)
    ]
    (folder / "dataset.toml").write_text(INSTRUMENTS)
    (folder / "bench.csv").write_text("\n".join(["pose,q1,q2,q3,tilt_x,tilt_y", *lines]) + "\n")
    return gtpin.Dataset.read(folder)


def of_instrument(bench: gtpin.Dataset) -> Make:
    """As `positions`, two numbers of each, read by an instrument of a dataset of instruments."""

    def make(rng: np.random.Generator, step: float, scatter: float) -> gtpin.Dataset:
        pose, q, position = rounded(rng, step, scatter)
        columns = {**bench.readings.columns, **dict(zip(("tilt_x", "tilt_y"), position.T[:2], strict=True))}
        return replace(bench, pose=pose, q=q, readings=replace(bench.readings, columns=columns))

    return make


@pytest.fixture(params=["positions", "instruments"])
def make(request: pytest.FixtureRequest, bench: gtpin.Dataset) -> Make:
    return positions if request.param == "positions" else of_instrument(bench)


def with_rows(data: gtpin.Dataset, rows: np.ndarray) -> gtpin.Dataset:
    return data.take(np.concatenate([np.arange(len(data)), rows]))


INCH = 0.0254
STEPS = [(UM, UM), (UM, 0.1 * UM), (10 * UM, UM), (UM, 0.3 * UM), (1e-4 * INCH, UM), (0.1 * UM, UM)]


@pytest.mark.slow
@pytest.mark.parametrize(("step", "scatter"), STEPS)
def test_readings_that_are_equal_by_chance_are_no_copies(make: Make, step: float, scatter: float) -> None:
    for seed in range(SETS):
        data = make(np.random.default_rng(seed), step, scatter)
        assert not copies(data).any(), seed


@pytest.mark.parametrize(("step", "scatter"), STEPS)
def test_a_whole_file_that_is_there_twice_is_recognised(make: Make, step: float, scatter: float) -> None:
    for seed in range(20):
        data = make(np.random.default_rng(seed), step, scatter)
        assert copies(with_rows(data, np.arange(len(data)))).sum() == len(data)


@pytest.mark.parametrize("visits", [1, 2])
def test_rows_that_were_pasted_twice_are_recognised(visits: int) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        data = positions(rng, 0.1 * UM, 10 * UM, poses=100 // visits, visits=visits)
        pasted = rng.choice(100, 20, replace=False)
        assert np.array_equal(np.flatnonzero(copies(with_rows(data, pasted))), np.arange(100, 120))


def test_pasted_rows_of_an_instrument_are_recognised(bench: gtpin.Dataset) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        data = of_instrument(bench)(rng, 0.1 * UM, 10 * UM)
        pasted = rng.choice(len(data), 20, replace=False)
        assert np.array_equal(np.flatnonzero(copies(with_rows(data, pasted))), len(data) + np.arange(20))


def test_one_row_with_all_digits_that_is_there_twice_is_a_copy() -> None:
    data = positions(np.random.default_rng(1), 1e-17, 1e-3)
    assert np.flatnonzero(copies(with_rows(data, np.array([7])))).tolist() == [len(data)]


def test_rows_of_different_times_are_different_measurements() -> None:
    data = positions(np.random.default_rng(1), 0.1 * UM, 10 * UM)
    again = with_rows(data, np.arange(40))
    at = np.arange(float(len(again)))
    assert copies(again).sum() == 40
    assert not copies(replace(again, covariates={"time": at})).any()
    assert copies(replace(again, covariates={"time": np.concatenate([at[: len(data)], at[:40]])})).sum() == 40


def test_visits_that_never_differ_in_one_column_are_no_copies() -> None:
    # An orientation that is computed from the commands is the same in all visits of a pose.
    data = positions(np.random.default_rng(2), UM, UM)
    angle = data.q[:, 0]
    turned = np.stack([np.cos(angle / 2.0), np.sin(angle / 2.0), 0.0 * angle, 0.0 * angle], axis=1)
    assert not copies(replace(data, orientation=turned)).any()


def test_the_scatter_of_a_drive_that_moves_all_columns_together_makes_no_copies() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        data = positions(rng, UM, 0.0)
        along = UM * rng.standard_normal((len(data), 1)) * np.array([1.0, 0.9, 0.8])
        assert not copies(replace(data, position=np.round((data.position + along) / UM) * UM)).any()


@pytest.mark.slow
def test_a_copy_is_never_set_aside_as_a_gross_error() -> None:
    data = simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=60, seed=4).dataset
    model = gtpin.calibrate(data).model
    twice = with_rows(data, np.arange(len(data)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        assert copies(twice).sum() == len(data)
        assert gtpin.certify(twice, model).set_aside == gtpin.certify(data, model).set_aside
        assert gtpin.diagnose(twice, against=model).set_aside == gtpin.diagnose(data, against=model).set_aside


def test_steps_of_commands_are_in_rad_or_degrees_or_metres_and_constant_commands_have_none():
    q = np.random.default_rng(5).uniform(-1.5, 1.5, (40, 3))
    turning = np.array([True, False, True])
    q[:, 1] = np.round(q[:, 1], 3)
    q[:, 2] = 0.7123456
    assert command_steps(q, turning) is None
    for unit, step, words in ((1.0, 0.01, "0.01 rad"), (np.pi / 180.0, 0.1, "0.1 degrees")):
        q[:, 0] = np.round(q[:, 0] / unit / step) * step * unit
        found = command_steps(q, turning)
        assert found is not None
        np.testing.assert_allclose(found.size, [step * unit, 1e-3, np.inf])
        assert found.words == f"{words} or 0.001 m"
