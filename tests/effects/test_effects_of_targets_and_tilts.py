"""Motions of the target are Pinocchio's, and a load that only a tilt within tolerances makes is none."""

import numpy as np
import pinocchio as pin
import pytest
from effect_places import EFFECTS, FIT, arm_points, basis, nominal_at, some
from urdfs import joint, own, robot_of

import gtpin
from gtpin.effects.active import ActiveEffect
from gtpin.effects.untestable import Untestable
from gtpin.report.effect_motions import motions


def test_the_target_sits_where_pinocchio_places_it_by_the_parameters():
    """In session k by its shift and turn; at the last time of the fit, from its place at the first, by those of the drift."""
    names = [f"{kind}_{axis}" for kind in ("shift", "turn") for axis in "xyz"]
    for effect, column, values in (
        ("target_shift", "session", ["day0", "day2"]),
        ("target_drift", "time", [FIT.references.time[0], sum(FIT.references.time)]),
    ):
        c = some(effect, "platform", FIT)
        told = {name: value for name, (value, _) in EFFECTS[effect].parameters(c, None).items()}
        ways = []
        for value in values:
            at = arm_points(12, seed=3, fixed=FIT.references, **{column: np.full(12, value, dtype=object)})
            twist = basis(effect, "platform", at).twist @ c
            where = [pin.SE3(R, T) for R, T in zip(at.poses.R, at.poses.T, strict=True)]
            moved = [
                pin.SE3(pin.exp3(t[3:]) @ x.rotation, x.translation + t[:3]) for x, t in zip(where, twist, strict=True)
            ]
            inside = [x.actInv(y) for x, y in zip(where, moved, strict=True)]
            ways.append(np.array([[*y.translation, *pin.log3(y.rotation)] for y in inside]))
            np.testing.assert_allclose(ways[-1], np.tile(ways[-1][:1], (12, 1)), atol=1e-15)
        last = {
            name: told[f"{name}[3]"] - told[f"{name}[1]"] if effect == "target_shift" else told[name] for name in names
        }
        np.testing.assert_allclose((ways[1] - ways[0])[0], list(last.values()), atol=1e-15)


def test_a_drift_of_the_tool_along_its_own_axis_is_shown_along_this_axis():
    """Whatever way the tool points: in the axes of its parameters, not in those of the base."""
    effect, names = EFFECTS["target_drift"], [f"{kind}_{axis}" for kind in ("shift", "turn") for axis in "xyz"]
    count = len(some("target_drift", "platform", FIT))
    told = [effect.parameters(one, None) for one in np.eye(count)]
    table = np.array([[one[name][0] for name in names] for one in told]).T
    c = np.linalg.lstsq(table, np.array([0.0, 0.0, 1e-4, 0.0, 0.0, 0.0]), rcond=None)[0]
    active = ActiveEffect(effect, "platform", None, c, np.zeros((count, count)), FIT.references)
    times = np.linspace(FIT.references.time[0], sum(FIT.references.time), 12)
    at = arm_points(12, seed=3, fixed=FIT.references, time=times)
    ranges = {motion.name: float(np.ptp(motion.columns @ c)) for motion in motions(active, at)}
    assert ranges.pop("shift along z of the TCP") == pytest.approx(1e-4)
    assert max(ranges.values(), default=0.0) < 1e-12


INERTIA = '<inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>'
HEAVY = f'<inertial><origin xyz="0.3 0 0"/><mass value="5"/>{INERTIA}</inertial>'


def tilted(angle: float) -> gtpin.Robot:
    """An arm whose first axis is vertical but for an angle, rad."""
    first = joint("turn", "base", "one", rpy=f"{angle} 0 0", body=HEAVY)
    return robot_of(
        "tilted", first, joint("lift", "one", "two", "0.5 0 0", "0 1 0", body=HEAVY), own(("turn", "lift"), "two")
    )


@pytest.mark.parametrize(("angle", "loaded"), [(0.0, False), (5e-4, False), (0.02, True)])
def test_a_joint_that_only_a_tilt_within_tolerances_loads_has_no_effect_of_load(angle, loaded):
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
    at = nominal_at(tilted(angle), q)
    assert EFFECTS["joint_compliance"].untestable(at, "lift") is None
    for name in ("joint_compliance", "joint_clearance"):
        assert (EFFECTS[name].untestable(at, "turn") == Untestable("no_load")) != loaded
