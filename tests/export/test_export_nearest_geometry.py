"""Where a file has a geometry alone, the advice names the nearer of two: that of the causes, or that calibrated without them.

Pinocchio's forward kinematics moves the arms, and its gravity bends their joints.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed, torques
from circle_machines import HIGH, LOW, TOLERANCE, Floats, off
from drawn_machines import told

import gtpin
from gtpin.report.steps import steps

SIGMA, POSES, NEW = 1.5e-5, 120, 400
PLAIN = pin.buildModelFromXML(gtpin.load_robot("ur10").description.xml)


def bent(q: Floats) -> Floats:
    """Shoulder and elbow give way under gravity, rad: 0.8 mm at the tool, of which a geometry can imitate much."""
    return -torques(PLAIN, q) * np.array([0.0, 5e-6, 5e-6, 0.0, 0.0, 0.0])


def wavy(q: Floats) -> Floats:
    """A periodic error of the pan, rad, which no geometry can imitate."""
    return 2e-4 * np.sin(30.0 * q + 0.3) * np.eye(6)[0]


@pytest.mark.filterwarnings("ignore:set aside as gross errors")
@pytest.mark.parametrize(("error", "nearer"), [(bent, "DIR/baseline"), (wavy, "DIR")])
def test_the_geometry_that_is_advised_is_the_nearer_one(
    error: Callable[[Floats], Floats], nearer: str, tmp_path: Path
) -> None:
    rng = np.random.default_rng(3)
    real = PLAIN.copy()
    for joint in range(1, real.njoints):
        real.jointPlacements[joint] *= pin.exp6(pin.Motion(rng.normal(0.0, TOLERANCE, 6)))
    q = np.round(rng.uniform(LOW, HIGH, (POSES, 6)), 6)
    seen = placed(real, q + error(q))[0] + np.array([2.0, 1.0, 0.5]) + SIGMA * rng.standard_normal((POSES, 3))
    instrument = {"position_sigma": SIGMA, "frame": "free"}
    found = gtpin.diagnose(gtpin.Dataset("ur10", [f"p{n}" for n in range(POSES)], q, seen, None, {}, instrument))
    new = rng.uniform(LOW, HIGH, (NEW, 6))
    true = placed(real, new + error(new))[0]
    left = {}
    for folder, model in (("DIR", found.model), ("DIR/baseline", found.baseline.model)):
        told(model, tmp_path / "robot.urdf")
        left[folder] = off(placed(pin.buildModelFromUrdf(str(tmp_path / "robot.urdf")), new)[0], true)
    (step,) = (one for one in steps(found) if one.command.endswith("corrected.urdf"))
    assert step.command == f"gtpin export {nearer} -o corrected.urdf"
    assert left[nearer] < 1.05 * min(left.values())
    size, unit = re.findall(r"\(([\d.]+)\s(\S+) at left-out poses", step.words)[0]
    said = float(size) * {"mm": 1e-3, "µm": 1e-6}[unit]
    assert said == pytest.approx(np.hypot(left[nearer], np.sqrt(3.0) * SIGMA), rel=0.25)
