"""Displacements that are linear in an effect's coefficients, and the motion of the TCP that they cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.effects.operating_points import OperatingPoints
from gtpin.typing import Floats


@dataclass(frozen=True)
class Displacement:
    """Displacements that unit coefficients cause: m columns, one per coefficient, for N poses and k rods.

    Parameters
    ----------
    sigma
        (m,) typical size of each coefficient: the prior's standard deviation at scale s = 1.
    command
        Index of an actuator and (N, m) displacements of its travel, m or rad.
    length
        (N, k, m) changes of the rods' lengths, m.
    twist
        (N, 6, m) motion of the measured pose while the robot does not move (an error of the instrument or the target):
        position, m, and rotation vector, rad, base frame. Measured links and joints do not move then, unless there are rows
        for them, as of :meth:`displacement`.
    placements
        Pairs of the index of a frame (:mod:`~gtpin.robot.placement_frames`), and (N, 6, m) twists, m and rad, of that frame, in
        its own axes.
    carrier_joints
        (N, k, 3, m) displacements of the rods' joints on their carriers, base frame, m.
    """

    sigma: Floats
    command: tuple[int, Floats] | None = None
    length: Floats | None = None
    twist: Floats | None = None
    placements: tuple[tuple[int, Floats], ...] = ()
    carrier_joints: Floats | None = None

    def __len__(self) -> int:
        return len(self.sigma)

    @property
    def parts(self) -> dict[str, Floats]:
        """The arrays of displacements by the names of the parameters, each with the poses first and the coefficients last."""
        found = {"command": self.command[1] if self.command else None, "length": self.length, "twist": self.twist}
        found |= {f"placements[{i}]": twist for i, (_, twist) in enumerate(self.placements)}
        found["carrier_joints"] = self.carrier_joints
        return {name: part for name, part in found.items() if part is not None}

    def displacement(self, at: OperatingPoints) -> Floats:
        """(N, 6 + 3 l + k, m) first-order motion by unit coefficients: of the TCP, base frame, m and rad; of l measured links,
        rotation vectors, rad; of k measured joints."""
        total = np.zeros((len(at), at.robot.motion_size, len(self)))
        if self.command is not None:
            actuator, travel = self.command
            total += at.command_jacobian[:, :, actuator, None] * travel[:, None, :]
        if self.length is not None:
            total += at.response @ self.length
        for index, twist in self.placements:
            total += at.bodies.by_twist(index, twist)
        if self.carrier_joints is not None:
            for index, twist in at.on_carriers(self.carrier_joints).items():
                total += at.bodies.by_twist(index, twist)
        if self.twist is not None:
            total[:, : self.twist.shape[1]] += self.twist
        return total


def side_by_side(bases: Sequence[Displacement]) -> Displacement:
    """One basis with the columns of several bases. All must displace the travel of the same actuator.

    Raises `ValueError` if one displaces another quantity or another actuator.
    """
    commands = [basis.command for basis in bases if basis.command is not None]
    if len(commands) < len(bases) or len({actuator for actuator, _ in commands}) > 1:
        raise ValueError("only displacements of one actuator's travel stand side by side")
    columns = np.hstack([travel for _, travel in commands])
    return Displacement(np.concatenate([basis.sigma for basis in bases]), command=(commands[0][0], columns))


def along_track(at: OperatingPoints, site: str, columns: Floats, sigma: Floats) -> Displacement:
    """Basis of displacements (N, m) of an actuator's travel, m or rad: along the track of a cart, or about a joint's axis."""
    return Displacement(sigma, command=(at.robot.sites.index(site), columns))


def rods_of(at: OperatingPoints, site: str) -> list[int]:
    """Indices of the rods of a site: the rods on a cart, one rod, or all rods for ``arm``."""
    return at.robot.rods_at(site)


def of_lengths(at: OperatingPoints, rods: list[int], columns: Floats, sigma: Floats) -> Displacement:
    """Basis of changes (N, len(rods), m) of the lengths of some rods, m."""
    length = np.zeros((len(at), len(at.robot.rod_sites), columns.shape[2]))
    length[:, rods] = columns
    return Displacement(sigma, length=length)
