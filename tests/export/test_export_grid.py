"""A table over commands and temperatures, interpolated linearly, leaves as much as the command says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from drawn_machines import Drawn, told
from scipy.ndimage import map_coordinates
from with_effects import active

import gtpin
from gtpin.errors import GtpinError
from gtpin.export import Box, TablesFor, export
from gtpin.model.fit_conditions import FitConditions


@pytest.fixture
def warm(drawn_of: Callable[[str], Drawn]) -> gtpin.Model:
    """A Gantry-Tau with errors of geometry and of two temperatures."""
    drawn = drawn_of("gantry_tau")
    model, q, count = drawn.model, drawn.q, len(drawn.q)
    around = {"temp_link": np.linspace(18.0, 26.0, count), "temp_frame": np.linspace(26.0, 18.0, count)}
    return replace(
        model,
        effects=(
            active(model, q, "linearity", "cart1", first=8e-5),
            active(model, q, "thermal_links", "arm", covariates=around, first=1.2e-5),
            active(model, q, "thermal_track", "cart2", covariates=around, first=1e-5),
        ),
    )


def added(table: pd.DataFrame, q: np.ndarray, temperatures: dict[str, float]) -> np.ndarray:
    """(N, 3) what a controller adds that interpolates linearly between the rows of the file."""
    inputs = {
        **{f"q{k + 1}": q[:, k] for k in range(3)},
        **{name: np.full(len(q), t) for name, t in temperatures.items()},
    }
    nodes = {name: np.unique(table[name]) for name in inputs}
    place = [np.interp(inputs[name], x, np.arange(len(x))) for name, x in nodes.items()]
    ordered = table.sort_values(list(nodes))
    shape = [len(x) for x in nodes.values()]
    return np.column_stack(
        [map_coordinates(ordered[f"dq{k}"].to_numpy().reshape(shape), place, order=1) for k in (1, 2, 3)]
    )


@pytest.mark.slow
def test_commands_with_what_the_table_adds_bring_the_tcp_where_it_was_meant(warm: gtpin.Model, tmp_path: Path) -> None:
    words = told(warm, tmp_path / "table.csv", "grid", temperatures=(30.0, 20.0))
    said = re.search(r"leaves (\S+) of (\S+) um", words[0])
    assert said
    table = pd.read_csv(tmp_path / "table.csv")
    assert list(table.columns) == ["q1", "q2", "q3", "temp_frame", "temp_link", "dq1", "dq2", "dq3"]
    assert len(table) == 4 * 11**3
    robot = warm.robot
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (3000, 3))
    meant = gtpin.read_model("gantry_tau").predict(q)
    for temperatures in ({"temp_frame": 30.0, "temp_link": 30.0}, {"temp_frame": 24.0, "temp_link": 27.0}):
        around = {name: np.full(len(q), t) for name, t in temperatures.items()}
        new = q + added(table, q, temperatures)
        there = meant.reached & np.isfinite(new).all(axis=1)
        assert there.mean() > 0.5
        before, after = (
            np.sqrt(((warm.predict(some, around).T - meant.T)[there] ** 2).sum(axis=1).mean()) for some in (q, new)
        )
        assert 1e6 * after == pytest.approx(float(said[1]), rel=0.15)
        assert after < 0.05 * before
    assert 1e6 * before == pytest.approx(float(said[2]), rel=0.15)


def test_tables_of_actuators_name_the_temperature_that_their_error_is_for(warm: gtpin.Model, tmp_path: Path) -> None:
    known = replace(warm, covariance=np.diag((0.01 * warm.geometry.tolerance) ** 2))
    text = " ".join(told(known, tmp_path / "drives.csv"))
    assert "in the whole ranges of the drives at 20 degC" in text
    cold = " ".join(told(replace(known, effects=known.effects[:1]), tmp_path / "drives.csv"))
    assert "in the whole ranges of the drives, with" in cold


def test_what_remains_is_told_for_the_commands_of_the_fit(warm: gtpin.Model, tmp_path: Path) -> None:
    """In the middle of the ranges a table is nearer than at their ends."""
    robot, nominal = warm.robot, gtpin.read_model("gantry_tau")
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 8.0
    lower, upper = middle - half, middle + half
    fit = FitConditions(1e-5, 1e-5, 0.0, lower=tuple(lower), upper=tuple(upper))
    words = told(replace(warm, effects=(), fit=fit), tmp_path / "table.csv", "grid")
    said = re.search(r"leaves (\S+) of (\S+) um of the TCP's error in the ranges of the fit", words[0])
    whole = re.search(r"leaves (\S+) um in the whole ranges", words[1])
    assert said
    assert whole
    q = np.random.default_rng(0).uniform(lower, upper, (2000, 3))
    new = q + added(pd.read_csv(tmp_path / "table.csv"), q, {})
    left = [
        np.sqrt(
            ((warm.without([e.name for e in warm.effects]).predict(some).T - nominal.predict(q).T) ** 2).sum(1).mean()
        )
        for some in (new, q)
    ]
    assert [float(one) for one in said.groups()] == pytest.approx([1e6 * one for one in left], rel=0.1)
    assert float(said[1]) < 0.5 * float(whole[1])


@pytest.mark.slow
def test_without_temperatures_thermal_effects_are_named_as_left_out(warm: gtpin.Model, tmp_path: Path) -> None:
    lost = r"does not hold thermal_links@arm \(\S+ um for each K .*\), thermal_track@cart2 \(\S+ um for each K off .*\)"
    assert re.search(lost, told(warm, tmp_path / "table.csv", "grid")[0])
    table = pd.read_csv(tmp_path / "table.csv")
    assert list(table.columns) == ["q1", "q2", "q3", "dq1", "dq2", "dq3"]


@pytest.mark.slow
def test_an_effect_that_changes_between_the_nodes_is_left_out_and_named(warm: gtpin.Model, tmp_path: Path) -> None:
    q = np.random.default_rng(1).uniform(warm.robot.lower, warm.robot.upper, (200, 3))
    smooth = replace(warm, effects=warm.effects[:1])
    short = active(warm, q, "rack_periodic", "cart2", 0.031, first=1e-4)
    words = "\n".join(told(replace(smooth, effects=(*smooth.effects, short)), tmp_path / "with.csv", "grid"))
    assert "is without rack_periodic@cart2" in words
    told(smooth, tmp_path / "without.csv", "grid")
    assert (tmp_path / "with.csv").read_text() == (tmp_path / "without.csv").read_text()


@pytest.mark.parametrize(
    ("robot", "form", "tables", "message"),
    [
        ("ur5", "grid", None, "ur5 has 6 actuators"),
        ("gantry_tau", "grid", TablesFor(temperatures=(20.0,)), "no effect of the model depends on a temperature"),
        ("gantry_tau", "grid", TablesFor(box=Box.of((0, 1, 0, 1, 0, 1))), "takes no --box"),
        ("gantry_tau", "csv", TablesFor(temperatures=(20.0,)), "csv takes no box"),
        ("gantry_tau", "mjfc", None, "no format is called 'mjfc'"),
        ("gantry_tau", "grid", None, "nothing to correct: the model is what the controller has"),
    ],
)
def test_what_a_table_can_not_be_made_for_is_one_error(
    robot: str, form: str, tables: TablesFor | None, message: str, tmp_path: Path
) -> None:
    with pytest.raises(GtpinError, match=message):
        export(gtpin.read_model(robot), tmp_path / "table.csv", form, tables=tables)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
