"""What an instrument of a model would read at given commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gtpin.data.commands import Commands
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.table import Column
from gtpin.errors import DatasetError, ModelError
from gtpin.instruments import BUILT_IN
from gtpin.instruments.instrument import Instrument, Read, RowError
from gtpin.instruments.tracker import Tracker
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import to_quaternions
from gtpin.model.model import FittedInstrument, Model
from gtpin.typing import Floats


def instrument_of(model: Model, name: str) -> FittedInstrument:
    """An instrument of a model, by its name.

    Raises `ModelError` if the model has no such instrument.
    """
    for one in model.instruments:
        if one.name == name:
            return one
    known = ", ".join(one.name for one in model.instruments)
    hint = f"it has {known}" if known else "a model of a dataset of one tracker has none: leave --instrument out"
    raise ModelError(f"the model has no instrument {name!r}", hint=hint)


def predicted_readings(
    model: Model, poses: Poses, name: str, ids: Mapping[str, Column], given: Commands | None = None
) -> dict[str, Floats]:
    """Columns that an instrument would read, without noise.

    ``model``: a model that was fitted to readings. ``poses``: (N) poses of the TCP that the model predicts, base frame.
    ``name``: name of the instrument. ``ids``: by name of a column of ids (``station``, ``plane``, ``socket``, ``target``):
    (N,) ids. ``given``: the commands, whose file and line an error names; None where they were not read from a file.

    Returns by name, (N,) numbers, m or rad; quaternions without unit. Raises `ModelError` if there is no such instrument,
    or an id is missing or unknown.
    """
    fitted = instrument_of(model, name)
    kind = BUILT_IN.get(fitted.table.kind)
    if kind is None:
        raise ModelError(
            f"instruments of kind {fitted.table.kind} can't be predicted", hint=f"{', '.join(BUILT_IN)} can"
        )
    # The class needs its columns of readings, as of identity rotations; what was read has no meaning here.
    blank = {
        column: np.full(len(poses), 0.0 if column in ("qx", "qy", "qz") else 1.0)
        for column in (*fitted.table.numbers, *fitted.columns)
    }
    read = Read(blank, dict(ids), np.full(len(poses), -1), fitted.known)
    try:
        one: Instrument = kind(fitted.table, read, model.robot)
    except DatasetError as error:
        file, row = (None, error.row) if given is None else (given.file, error.row)
        if isinstance(error, RowError) and given is not None:
            file, row = given.place(error.index)
        raise ModelError(error.what, file=file, row=row, column=error.column, hint=error.hint) from None
    u = np.array([fitted.unknowns.get(unknown.name, 0.0) for unknown in one.unknowns])
    values = one.predicted(poses, u)
    if isinstance(one, Tracker):
        found = dict(zip(POSITION, values[:, :3].T, strict=True))
        if one.turned:
            found |= dict(zip(ORIENTATION, to_quaternions(one.orientations(poses, u)).T, strict=True))
        return found
    return {c.name: values[:, i] for i, c in enumerate(one.components) if c.shown}


def as_seen(model: Model) -> tuple[Model, str | None]:
    """The model whose poses ``gtpin predict`` writes, and the name of the tracker that reads them.

    The name is None where the model has one tracker that was not named (schema 1), or none. A model with other instruments but
    no tracker predicts the TCP in the base frame, without effects at the site ``frame``.
    """
    trackers = [one.name for one in model.instruments if one.table.kind == "tracker"]
    if not model.instruments or trackers:
        return model, next(iter(trackers), None)
    return replace(model, effects=tuple(e for e in model.effects if e.site != "frame")), None
