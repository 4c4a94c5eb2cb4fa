"""Poses of a machine with all its errors: the closed chain is solved with them, and the forces are those at the solved
poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.arm_situation import ArmSituation
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.deviation import Deviation
from gtpin.bench.simulator.poses import Poses, exp
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.situation import RodSituation
from gtpin.bench.simulator.visits import Visits
from gtpin.errors import ConvergenceError
from gtpin.typing import Floats

Active = Sequence[tuple[Cause, float]]
"""Causes with their amplitudes, in multiples of their typical sizes."""

ROUNDS = 8
SETTLED = 1e-10
"""Change of a pose, m or rad, below which the iteration of forces and deflections ends."""


@dataclass(frozen=True)
class Response:
    """A machine, its visits of a day, and the instrument that measures them."""

    # `machine`, `visits`: The machine, and all its visits. They are solved together, because effects can depend on
    # earlier visits.
    machine: RodMachine | ArmMachine
    visits: Visits
    station: Floats  # (3,) position of the instrument, base frame, m
    read: tuple[str, ...] = ()  # Names of the joints that encoders read

    @cached_property
    def ideal(self) -> RodSituation | ArmSituation:
        """The machine with errors of its geometry alone."""
        if isinstance(self.machine, ArmMachine):
            return ArmSituation.of(self.machine, self.visits)
        return RodSituation.of(self.machine, self.visits)

    @cached_property
    def there(self) -> Poses:
        """(N) poses of this machine without effects, base frame, with the coordinates of the joints ``read``."""
        return self.ideal.seen(self.read)

    def by_command(self) -> Floats:
        """(N, 6 + k, n) derivative by commands of these poses, position and rotation vector, and of the k joints."""
        return self.machine.command_jacobian(self.visits.q, self.there)

    def settled(self, active: Active, jitter: Deviation | None = None) -> tuple[Any, Deviation]:
        """The situation with some causes and with ``jitter``, random deviations by the repeatability; and the total deviation.

        Raises ConvergenceError if the iteration of forces and deflections does not converge.
        """
        now = self.ideal
        for _ in range(ROUNDS):
            deviation = now.unbent() if jitter is None else jitter
            for cause, amplitude in active:
                deviation = deviation + cause(now) * amplitude
            before, now = now, now.settled_by(deviation)
            if np.abs(now.poses.minus(before.poses)).max() < SETTLED:
                return now, deviation
        raise ConvergenceError("the machine does not come to rest", hint="make the effects smaller")

    def seen(self, active: Active, jitter: Deviation | None = None) -> Poses:
        """(N) poses that the instrument reads without noise, base frame, with the coordinates of the joints ``read``."""
        now, deviation = self.settled(active, jitter)
        T = now.poses.T + np.einsum("nij,nj->ni", now.poses.R, deviation.target) - self.station
        turn = exp(deviation.frame[:, 3:])
        T = (1.0 + deviation.scale)[:, None] * np.einsum("nij,nj->ni", turn, T) + deviation.frame[:, :3]
        return Poses(T + self.station, turn @ now.poses.R, now.seen(self.read).joints)

    def displacement(self, active: Active) -> Floats:
        """(N, 6 + k) displacement by the causes alone of the measured poses, m and rad, base frame, and of the k joints
        ``read``."""
        return self.seen(active).change(self.there)
