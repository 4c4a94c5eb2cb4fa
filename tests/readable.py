"""The check of readings as they stand, where no fit explains them, and any fit does with the mistake corrected."""

from __future__ import annotations

import gtpin
from gtpin.calibration.checks.before_fit import reach_of, usable_rows
from gtpin.calibration.checks.instruments import Misfit, check_readable
from gtpin.calibration.problem import problem_of
from gtpin.model.measured_robot import measuring, robot_of


def check_as_they_stand(dataset: gtpin.Dataset) -> None:
    """As a calibration does before its fit, which takes seconds where readings do not fit."""
    nominal = gtpin.Model(gtpin.Geometry.nominal(measuring(robot_of(dataset), dataset)))
    _, _, kept, near = usable_rows(dataset, nominal, tracked=False)  # a distance is refused here
    given = problem_of(kept, near, nominal, free=False).measured

    def fitted(some, index, rough=False):
        return None if some is given else Misfit.of(some, near, index)

    check_readable(dataset, given, nominal, near, reach_of(nominal.geometry), fitted)
