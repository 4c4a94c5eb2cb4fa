"""The check of readings as they stand, where no fit explains them, and any fit does with the mistake corrected."""

from __future__ import annotations

import gtpin
from gtpin.calibration.checks.before_fit import fittable, reach_of
from gtpin.calibration.checks.instruments import Misfit, check_readable
from gtpin.model.measured_robot import robot_of


def check_as_they_stand(dataset: gtpin.Dataset) -> None:
    """As a calibration does before its fit, which takes seconds where readings do not fit."""
    start = fittable(dataset, gtpin.Geometry.nominal(robot_of(dataset)))  # a distance is refused here
    given, nominal, near = start.problem.measured, start.problem.start, start.near

    def fitted(some, index, rough=False):
        return None if some is given else Misfit.of(some, near, index)

    check_readable(dataset, given, nominal, near, reach_of(nominal.geometry), fitted)
