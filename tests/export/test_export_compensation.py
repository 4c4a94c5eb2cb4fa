"""Corrections: commanded as a table or the solver says, the machine goes where it was wanted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from drawn_machines import Drawn
from with_effects import active

import gtpin
from gtpin.compensation import compensate
from gtpin.errors import ConvergenceError, GtpinWarning, ModelError, UnreachableError
from gtpin.export import export
from gtpin.extras.controllers.corrections import corrections

DIRECTIONS = {f"approach{k}": 1.0 for k in (1, 2, 3)}


@pytest.fixture
def gantry(drawn_of: Callable[[str], Drawn]) -> Drawn:
    return drawn_of("gantry_tau")


def columns(count: int, **told: float) -> dict[str, np.ndarray]:
    return {name: np.full(count, value) for name, value in told.items()}


@pytest.fixture
def erring(gantry: Drawn) -> gtpin.Model:
    """Errors of drives, links, temperature and load at once."""
    q, count = gantry.q, len(gantry.q)
    rng = np.random.default_rng(5)
    around = columns(count, **DIRECTIONS) | {
        "payload": rng.choice([0.0, 20.0], count),
        "temp_link": rng.uniform(18.0, 25.0, count),
    }
    model = gantry.model
    return replace(
        model,
        effects=(
            active(model, q, "linearity", "cart1", first=8e-5),
            active(model, q, "rack_periodic", "cart2", 0.12, first=3e-5),
            active(model, q, "backlash", "cart3", covariates=around, first=2e-5),
            active(model, q, "encoder_scale", "cart3", covariates=around, first=2e-4),
            active(model, q, "link_compliance", "arm", covariates=around, first=6e-8),
            active(model, q, "thermal_links", "arm", covariates=around, first=1.2e-5),
        ),
    )


def test_compensated_commands_bring_the_tcp_where_it_was_wanted(gantry: Drawn, erring: gtpin.Model) -> None:
    wanted = gantry.poses.T
    around = columns(len(wanted), payload=10.0, temp_link=23.0, **DIRECTIONS)
    assert np.abs(erring.predict(gantry.q, around).T - wanted).max() > 1e-4
    q = compensate(erring, wanted, around)
    assert np.abs(erring.predict(q, around).T - wanted).max() < 2e-9
    assert np.abs(q - gantry.q).max() < 2e-3


def test_six_actuators_correct_the_orientation_too(drawn_of: Callable[[str], Drawn]) -> None:
    drawn = drawn_of("stewart")
    model = replace(drawn.model, effects=(active(drawn.model, drawn.q, "encoder_scale", "leg2", first=1e-3),))
    q = compensate(model, drawn.poses.T, rotations=drawn.poses.R)
    assert np.abs(model.predict(q).minus(drawn.poses)).max() < 2e-9
    assert np.abs(model.predict(drawn.q).minus(drawn.poses)).max() > 1e-5


def test_nobody_corrects_the_machine_for_its_instrument(gantry: Drawn) -> None:
    model = gantry.model
    shifted = replace(
        model,
        frame=gtpin.Frame(np.array([1.0, 2.0, 3.0])),
        effects=(active(model, gantry.q, "tracker_scale", "frame", first=1e-4),),
    )
    with pytest.warns(GtpinWarning, match="tracker_scale@frame"):
        q = compensate(shifted, gantry.poses.T)
    np.testing.assert_allclose(q, gantry.q, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_what_can_not_be_reached_or_met_is_said(gantry: Drawn) -> None:
    wanted = gantry.poses.T[:3].copy()
    wanted[1] += 50.0
    with pytest.raises(UnreachableError, match="position 2"):
        compensate(gantry.model, wanted)
    with pytest.raises(ModelError, match="3 actuators"):
        compensate(gantry.model, gantry.poses.T, rotations=gantry.poses.R)
    # A step upwards leaves a gap that no command reaches.
    place = float(gantry.q[0, 1])
    step = active(gantry.model, gantry.q, "rack_step", "cart2", place, first=1e-4)
    stepped = replace(gantry.model, effects=(step,))
    inside = gantry.model.predict(gantry.q[:1] + np.array([0.0, 5e-5, 0.0])).T
    with pytest.raises(ConvergenceError, match="number 1"):
        compensate(stepped, inside)


def travel(model: gtpin.Model, actuator: int, q: np.ndarray, approach: float) -> np.ndarray:
    """Where an actuator is, by where the TCP of the model goes: the command of the machine without errors that goes there."""
    commands = np.zeros((len(q), 3))
    commands[:, actuator] = q
    around = columns(len(q), payload=0.0, temp_link=20.0, **(DIRECTIONS | {f"approach{actuator + 1}": approach}))
    plain = replace(model, effects=())
    found, _ = gtpin.commands_for(plain.kinematics, model.predict(commands, around).T)
    return found[:, actuator]


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["forward", "reverse"])
def test_a_table_brings_each_actuator_where_it_was_wanted(
    gantry: Drawn, erring: gtpin.Model, direction: str, tmp_path: Path
) -> None:
    drives = replace(erring, effects=erring.effects[:4])
    export(drives, tmp_path / "corrections.csv")
    table = pd.read_csv(tmp_path / "corrections.csv")
    assert set(table.actuator) == {"cart1", "cart2", "cart3"}
    wanted = np.linspace(-0.5, 0.55, 40)
    for k, (site, rows) in enumerate(table.groupby("actuator")):
        asked = np.interp(wanted, rows.nominal, rows[direction])
        assert np.abs(asked - wanted).max() > 1e-5, site
        there = travel(drives, k, asked, 1.0 if direction == "forward" else -1.0)
        # Backlash was tabled at the load of the other carts at home, as here.
        np.testing.assert_allclose(there, wanted, rtol=0, atol=3e-7)


def test_a_table_follows_a_step(gantry: Drawn) -> None:
    stepped = replace(gantry.model, effects=(active(gantry.model, gantry.q, "rack_step", "cart2", 0.1, first=8e-5),))
    (table,) = corrections(stepped)
    assert len(table.nominal) < 40
    for wanted, command in ((0.05, 0.05), (0.0999, 0.0999), (0.1002, 0.1002 - 8e-5), (0.3, 0.3 - 8e-5)):
        assert np.interp(wanted, table.nominal, table.forward) == pytest.approx(command, abs=1e-7)


def test_drive_scales_are_corrected(gantry: Drawn) -> None:
    geometry = gtpin.Geometry.nominal(gantry.model.robot, scale="actuator")
    place = geometry.names.index("scale[cart3]")
    values = geometry.values.copy()
    values[place] += 2e-3
    (table,) = corrections(gtpin.Model(geometry.with_values(values)))
    assert table.site == "cart3"
    np.testing.assert_allclose(1.002 * table.forward, table.nominal, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_linuxcnc_takes_256_lines_of_trims_in_millimetres(gantry: Drawn, erring: gtpin.Model, tmp_path: Path) -> None:
    """As usrmotLoadComp of LinuxCNC reads them: three numbers a line, nominals ascending."""
    drives = replace(erring, effects=erring.effects[:4])
    export(drives, tmp_path / "drives.comp")
    exact = {table.site: table for table in corrections(drives)}
    assert {file.name for file in tmp_path.glob("*.comp")} == {f"drives_cart{k}.comp" for k in (1, 2, 3)}
    for site, table in exact.items():
        triplets = np.loadtxt(tmp_path / f"drives_{site}.comp")
        assert triplets.shape[1] == 3
        assert len(triplets) <= 256
        assert (np.diff(triplets[:, 0]) > 0.0).all()
        motor = 1e-3 * (table.nominal * 1e3 + np.interp(table.nominal * 1e3, triplets[:, 0], triplets[:, 1]))
        np.testing.assert_allclose(motor, table.forward, rtol=0, atol=5e-7)


def test_a_period_that_256_lines_can_not_follow_is_said(gantry: Drawn, tmp_path: Path) -> None:
    fine = active(gantry.model, gantry.q, "rack_periodic", "cart2", 0.012, first=3e-5)
    with pytest.warns(GtpinWarning, match="256 lines can't follow cart2"):
        export(replace(gantry.model, effects=(fine,)), tmp_path / "fine.comp")


def test_zero_shifts_are_those_of_the_session_that_is_told(gantry: Drawn, tmp_path: Path) -> None:
    sessions = np.array([str(k % 2) for k in range(len(gantry.q))], dtype=object)
    shift = active(gantry.model, gantry.q, "zero_shift", "cart1", covariates={"session": sessions}, first=6e-5)
    model = replace(gantry.model, effects=(shift,))
    (table,) = corrections(model, session="0")
    np.testing.assert_allclose(table.forward, table.nominal - 6e-5, rtol=0, atol=1e-12)
    with pytest.raises(ModelError, match="no session 'tuesday'"):
        corrections(model, session="tuesday")
    with pytest.raises(ModelError, match="no session 'tuesday'"):
        export(model, tmp_path / "robot.xml", session="tuesday")
    with pytest.raises(ModelError, match="nothing that a controller's tables can correct"):
        export(model, tmp_path / "table.csv")
    assert not list(tmp_path.iterdir())


def test_a_shift_since_an_earlier_model_is_of_no_session(gantry: Drawn, tmp_path: Path) -> None:
    shift = active(gantry.model, gantry.q, "zero_shift", "cart1", first=6e-5)
    assert shift.references.sessions == ()
    model = replace(gantry.model, effects=(shift,))
    with pytest.warns(GtpinWarning, match=r"does not hold zero_shift@cart1 \(\S+ um\)"):
        export(model, tmp_path / "robot.urdf")
    with pytest.raises(ModelError, match="no session 'monday'"):
        corrections(model, session="monday")


@pytest.mark.slow
def test_what_a_table_does_not_hold_is_named(erring: gtpin.Model, tmp_path: Path) -> None:
    with pytest.warns(GtpinWarning, match=r"link_compliance@arm \(.* um\), thermal_links@arm \("):
        export(erring, tmp_path / "table.csv")
