"""How often a check of an unchanged machine raises an alarm where the earlier model left errors unexplained: docs/health.md.

The machines are those of ``examples/certificate/unseen_poses.py``: arms of three joints with smooth errors that no effect of
the catalogue describes, and, every second one, with an error of one joint that is a smooth function of its own angle, which the
catalogue has and a calibration leaves out. Each is calibrated, and checked with new poses a day later. Nothing has changed.
``python examples/pages/refresh.py --measure unlisted`` measures the table of the page again.
"""

from __future__ import annotations

import sys
import warnings
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

import gtpin

sys.path.insert(0, str(Path(__file__).parents[1] / "certificate"))

from power import bounds
from unseen_poses import Machine

Floats = npt.NDArray[np.float64]

SEEDS = 1795634981
"""The machines' first seed: the clock's seconds when the table was measured last."""
CHECKED = (10, 40)
"""Numbers of poses of a check."""
TURNED = 1.5e-4
"""Size of an error of one joint, rad."""


class OneJoint(Machine):
    """An arm whose only error beside its geometry is one joint's, a smooth function of its own angle."""

    def position(self, q: Floats) -> Floats:
        """(N, 3) true positions of the tool, m."""
        rng = np.random.default_rng([self.seed, 9])
        joint, frequencies, phases = rng.integers(3), rng.uniform(1.5, 4.0, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
        moved = q.copy()
        moved[:, joint] += TURNED * np.cos(np.outer(q[:, joint], frequencies) + phases).sum(axis=1) / np.sqrt(2.0)
        return super().position(moved)

    @cached_property
    def waves(self) -> tuple[Floats, Floats, Floats]:
        """No other errors."""
        frequencies, phases, sizes = super().waves
        return frequencies, phases, 0.0 * sizes


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are checked: half of them with errors of one joint, with one and three visits of a pose in turn."""
    return [
        {"machine": i, "error": ("smooth", "one joint")[i % 2], "visits": (1, 3)[i // 2 % 2]} for i in range(machines)
    ]


def measured(machine: int, error: str, visits: int) -> list[dict[str, object]]:
    """Checks of one machine; every second pair of machines declares the noise."""
    one = (OneJoint if error == "one joint" else Machine)(SEEDS + machine)
    declared, found = machine // 4 % 2 == 1, []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        model = gtpin.calibrate(one.measured(0, visits, declared)).model
        for kind, count in enumerate(CHECKED, 1):
            today = one.measured(kind, visits, declared).take(slice(0, count * visits))
            check = gtpin.diagnose(today, against=model)
            found.append({"poses": count, "alarm": check.verdict != "none"})
    return found


def table(records: pd.DataFrame) -> str:
    """How many checks raise an alarm."""
    alarms = int((records["alarm"].astype(str) == "True").sum())
    low, high = bounds(alarms, len(records))
    poses = " or ".join(map(str, CHECKED))
    return f"Alarms in {alarms} of {len(records)} checks of {poses} poses (95 %: {low:.1%} to {high:.1%})."


if __name__ == "__main__":
    print(table(pd.DataFrame([{**job, **row} for job in jobs(8) for row in measured(**job)])))  # type: ignore[arg-type]
