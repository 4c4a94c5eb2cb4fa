"""Targets: points on the platform, declared in the TCP frame, that an instrument looks at or that touch something."""

from __future__ import annotations

import numpy as np

from gtpin.data.instrument_tables import InstrumentTable
from gtpin.errors import DatasetError
from gtpin.instruments.frame_and_target import AWAY
from gtpin.instruments.instrument import Instrument, Read, RowError, Unknown
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import skew
from gtpin.typing import Floats, Indices

AXES = ("x", "y", "z")


def indices(read: Read, column: str, known: dict[str, object], what: str) -> Indices:
    """(M,) index of each row's id among the ids ``known``; 0 if the column is missing and there is one id only.

    ``what``: what the ids are of, for messages (``station``).

    Raises `DatasetError` for an id that is not in ``known``, or if the column is missing and there are several ids.
    """
    if not read.count:
        return np.zeros(0, dtype=np.intp)
    names = list(known)
    ids = read.ids.get(column)
    if ids is None or (ids == "").all():
        if len(names) > 1:
            hint = f"add the column, with one of {', '.join(names)} in each row"
            raise DatasetError(f"which {what}?", row=1, column=column, hint=hint)
        return np.zeros(read.count, dtype=np.intp)
    if names == [""]:
        others = np.flatnonzero(ids != ids[0])
        if len(others):
            hint = f"write {column}s = {{{ids[0]} = ..., {ids[others[0]]} = ...}}"
            raise RowError(int(others[0]), f"dataset.toml has no {what}s, so all rows are of one", column, hint)
        return np.zeros(read.count, dtype=np.intp)
    place = {name: i for i, name in enumerate(names)}
    unknown = [i for i, value in enumerate(ids) if str(value) not in place]
    if unknown:
        hint = f"it has {', '.join(names)}"
        raise RowError(unknown[0], f"dataset.toml has no {what} {str(ids[unknown[0]])!r}", column, hint)
    return np.array([place[str(value)] for value in ids], dtype=np.intp)


def placed(blocks: Floats, of: Indices, count: int) -> Floats:
    """(M, c, count w) derivatives by the w unknowns of each of some ids, from those (M, c, w) by the unknowns of each row's own
    id ``of`` (M,)."""
    found = np.zeros((*blocks.shape[:2], count, blocks.shape[2]))
    found[np.arange(len(of)), :, of] = blocks
    return found.reshape(*blocks.shape[:2], count * blocks.shape[2])


class Targets:
    """The targets of an instrument's M rows.

    ``table``, ``read``: the instrument's table in dataset.toml, and its rows. ``free``: True: the standard deviation of the
    priors of the targets' coordinates is `AWAY`. False: it is ``table.target_sigma``. ``unknowns``: the three coordinates of
    each target, also where they are exact; ``count``: their number.
    """

    def __init__(self, table: InstrumentTable, read: Read, *, free: bool = False) -> None:
        named = table.fixed_targets
        self.of: Indices = indices(read, "target", dict(named), "target")
        self.declared = np.array(list(named.values()), dtype=float)
        sigma = AWAY if free else table.target_sigma
        self.unknowns: tuple[Unknown, ...] = tuple(
            Unknown(f"{table.name}.target{f'[{name}]' if name else ''}.{axis}", "m", float(at[i]), sigma)
            for name, at in zip(named, self.declared, strict=True)
            for i, axis in enumerate(AXES)
        )
        self.count = len(self.unknowns)

    def lever(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) vectors from the TCP to the targets, base frame, m; u (count,): the targets less what is declared, m."""
        at = self.declared + u.reshape(-1, 3)
        return np.asarray(np.einsum("nij,nj->ni", poses.R, at[self.of]))

    def positions(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3) positions of the targets, base frame, m; u as for :meth:`lever`."""
        return poses.T + self.lever(poses, u) if u.any() or self.declared.any() else poses.T

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3, 6) derivative of the positions by the TCP's position (m) and rotation vector (rad), base frame."""
        moved = np.zeros((len(poses), 3, 6))
        moved[:, :, :3] = np.eye(3)
        moved[:, :, 3:] = -skew(self.lever(poses, u))
        return moved

    def by_unknown(self, poses: Poses) -> Floats:
        """(M, 3, count) derivative of the positions by the deviations u of the targets."""
        return placed(poses.R, self.of, len(self.declared))


class OfTargets(Instrument):
    """An instrument that observes targets on the platform, or whose targets touch something."""

    targets: Targets

    def looked_at(self, poses: Poses, u: Floats) -> Floats:
        return self.targets.positions(poses, self._whole(u)[: self.targets.count])
