"""Commands that were rounded or truncated: all are multiples of a step, and residuals have the size of this step."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.problem import Measured
from gtpin.data.rounding import STEPS, coarsest_step
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model

COARSE = (0.1, 0.05, *STEPS)
"""Steps that commands are rounded to, m or rad, the coarsest first."""
LEAST, MOST = 0.1, 1.5
"""Error of the commands over the step: at least in the median, at most in nine tenths of the rows. Assumed:
rounding makes up to a half, truncation up to one, and the geometry's own errors come on top."""
NINE_TENTHS = 0.9


def coarse_commands(model: Model, measured: Measured, poses: Poses) -> str | None:
    """A message, if commands that were rounded or truncated explain the residuals; else None.

    ``model``: the nominal model. ``measured``, ``poses``: the N measured poses, and those that the model predicts at their
    commands, base frame.
    """
    step = coarsest_step(measured.q, COARSE)
    if step is None:
        return None
    some = np.linspace(0, len(poses) - 1, min(len(poses), 300)).astype(int)
    q, near, frame = measured.q[some], poses[some], model.frame
    off = measured.T[some] - near.moved(frame.T, frame.R).T
    J = model.kinematics.command_jacobian(q, near)[:, :3]
    wrong = np.abs(np.einsum("nij,nj->ni", np.linalg.pinv(J), off @ frame.R)).max(axis=1)
    if not LEAST * step <= np.median(wrong) or np.quantile(wrong, NINE_TENTHS) > MOST * step:
        return None
    turning = [actuator.revolute for actuator in model.robot.actuators]
    unit = "rad" if all(turning) else "m or rad" if any(turning) else "m"
    size = 1e3 * np.median(np.linalg.norm(off, axis=1))
    return (
        f"all commands are multiples of {step:g} {unit}, and poses are off by {size:.2g} mm, as such a step makes them"
    )
