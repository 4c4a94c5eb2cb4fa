"""New measurements of a case's machine, at commands and conditions of the user's choice."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.build import as_dataset, assemble
from gtpin.bench.simulator.conditions import Conditions
from gtpin.bench.simulator.response import Plant
from gtpin.bench.simulator.truth import Case
from gtpin.bench.simulator.visits import BACK_OFF, Visits
from gtpin.data import Commands, Dataset
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.typing import Floats

LATER = 600.0
"""Time from the day's last visit to the first new one, where the commands have no column ``time``, s."""


def measure_at(case: Case, commands: Commands, seed: int = 0) -> Dataset:
    """Measure the machine of a case again, after its day, with the same instrument at the same place.

    These covariates of the commands are applied: ``approach1..n`` and ``speed1..n`` (with equal signs), ``payload``,
    ``fx fy fz``, ``session``, ``time`` (after the day's last visit), ``temp_frame`` and ``temp_link``. Covariates that are not
    given have their values at the end of the day; directions of approach are then random, speeds and forces zero. Effects that
    depend on earlier loads and moves start without this history.

    Parameters
    ----------
    commands
        Commands, and covariates by name, in the order in which they are measured.
    seed
        Seed of the instrument's noise and the repeatability. The same seed gives the same bytes.

    Returns
    -------
    Dataset
        One row for each command, with the covariates of the case's dataset and those of the commands.

    Raises
    ------
    GtpinError
        If conditions contradict each other, or a pose can't be reached.
    """
    made = assemble(case.recipe)
    rng = np.random.default_rng(np.random.SeedSequence([case.recipe.seed, 5, seed]))
    visits = _visits(made.plant.visits, commands, case.recipe.conditions, rng)
    plant = Plant(made.plant.machine, visits, made.plant.station)
    jitter = plant.machine.jitter(made.repeatability, len(visits), rng)
    true = made.in_frame(plant.seen(made.active, jitter))
    columns = {**visits.columns(case.recipe.conditions), **commands.covariates}
    return as_dataset(case.recipe, commands.pose, commands.q, columns, case.recipe.noise.measured(true, rng))


def _visits(day: Visits, commands: Commands, conditions: Conditions, rng: np.random.Generator) -> Visits:
    """The commands as visits after those of a day."""
    given, q, total = commands.covariates, commands.q, len(commands)

    def wanted(name: str, otherwise: Column | float) -> Floats:
        return np.asarray(np.broadcast_to(np.asarray(given.get(name, otherwise), dtype=float), total))

    def each(name: str, otherwise: Floats) -> Floats:
        return np.column_stack([wanted(f"{name}{i + 1}", otherwise[:, i]) for i in range(q.shape[1])])

    last = float(day.time[-1])
    time = wanted("time", last + LATER + conditions.interval * np.arange(total))
    if not total or time[0] <= last or (np.diff(time) < 0.0).any():
        raise GtpinError("times that do not go on from the day", hint=f"give ascending times after {last:.0f} s")
    speed = each("speed", np.zeros_like(q))
    approach = each("approach", np.where(speed != 0.0, np.sign(speed), rng.choice([-1.0, 1.0], q.shape)))
    if (np.abs(approach) != 1.0).any() or (speed * approach < 0.0).any():
        raise GtpinError(
            "an actuator that moves one way and comes from the other", hint="give speed the approach's sign"
        )
    session = np.full(total, day.session[-1])
    if "session" in given:
        session = np.array([_number(str(s)) for s in given["session"]])
    temperatures = (wanted("temp_frame", day.day.frame[-1]), wanted("temp_link", day.day.link[-1]))
    return Visits(
        pose=np.arange(total),
        held=np.zeros(total, dtype=bool),
        q=q,
        before=q - approach * rng.uniform(*BACK_OFF, q.shape),
        time=time,
        session=session,
        payload=wanted("payload", day.payload[-1]),
        force=np.column_stack([wanted(f"f{axis}", 0.0) for axis in "xyz"]),
        speed=speed,
        acceleration=np.abs(speed) * approach * 0.4 * rng.standard_normal((total, 1)),
        day=day.day.continued(time, *temperatures),
    )


def _number(session: str) -> int:
    if not session.isdecimal() or int(session) >= 20:
        raise GtpinError(f"session {session!r}", hint="number the plant's sessions from 0 to 19")
    return int(session)
