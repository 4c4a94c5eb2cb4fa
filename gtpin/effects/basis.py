"""Displacements that are linear in an effect's coefficients, and what they do to the TCP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.effects.situation import Situation

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Basis:
    """Displacements that unit coefficients cause: m columns, one per coefficient, for N poses and k rods.

    Parameters
    ----------
    sigma
        (m,) size that a coefficient has where the effect is of its typical size: the prior's standard deviation.
    command
        Index of an actuator and (N, m) displacements of its travel, m or rad.
    carrier_joints
        (N, k, 3, m) displacements of the rods' joints on their carriers, base frame, m.
    length
        (N, k, m) changes of the rods' lengths, m.
    twist
        (N, 6, m) motion of the measured pose, where the robot itself does not move (an error of the instrument or the
        target): position, m, and rotation vector, rad, base frame.
    placements
        Of a robot without rods: indices as in :class:`~gtpin.kinematics.bodies.Bodies`, and (N, 6, m) twists, m and rad, of
        each placement frame in its own axes.
    """

    sigma: Floats
    command: tuple[int, Floats] | None = None
    carrier_joints: Floats | None = None
    length: Floats | None = None
    twist: Floats | None = None
    placements: tuple[tuple[int, Floats], ...] = ()

    def __len__(self) -> int:
        return len(self.sigma)

    def displacement(self, at: Situation) -> Floats:
        """(N, 6, m) first-order motion of the TCP for unit coefficients, base frame, m and rad."""
        total = np.zeros((len(at), 6, len(self)))
        if self.command is not None:
            actuator, travel = self.command
            total += at.command_jacobian[:, :, actuator, None] * travel[:, None, :]
        if self.carrier_joints is not None:
            total += at.response @ np.einsum("nki,nkim->nkm", at.along, self.carrier_joints)
        if self.length is not None:
            total += at.response @ self.length
        for index, twist in self.placements:
            total += at.bodies.by_twist(index, twist)
        if self.twist is not None:
            total += self.twist
        return total


def side_by_side(bases: Sequence[Basis]) -> Basis:
    """The columns of several bases of one actuator's travel.

    Raises
    ------
    ValueError
        If one displaces something else.
    """
    commands = [basis.command for basis in bases if basis.command is not None]
    if len(commands) < len(bases) or len({actuator for actuator, _ in commands}) > 1:
        raise ValueError("only displacements of one actuator's travel stand side by side")
    columns = np.hstack([travel for _, travel in commands])
    return Basis(np.concatenate([basis.sigma for basis in bases]), command=(commands[0][0], columns))


def along_track(at: Situation, site: str, columns: Floats, sigma: Floats) -> Basis:
    """Displacements (N, m) of a cart along its track."""
    return Basis(sigma, command=(at.robot.sites.index(site), columns))


def rods_of(at: Situation, site: str) -> list[int]:
    """The rods that a site moves: those of a cart, a link, or all for ``arm``."""
    rods = at.robot.rods
    if site == "arm":
        return list(range(len(rods)))
    if site in at.robot.sites:
        actuator = at.robot.sites.index(site)
        return [i for i, rod in enumerate(rods) if actuator in (rod.carrier, rod.extension)]
    return [i for i, rod in enumerate(rods) if rod.site == site]


def of_lengths(at: Situation, rods: list[int], columns: Floats, sigma: Floats) -> Basis:
    """Changes (N, len(rods), m) of some rods' lengths, m."""
    length = np.zeros((len(at), len(at.robot.rods), columns.shape[2]))
    length[:, rods] = columns
    return Basis(sigma, length=length)
