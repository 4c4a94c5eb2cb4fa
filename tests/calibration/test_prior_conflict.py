"""A machine that contradicts its tolerances is admitted, and said, whatever instrument measured it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from virtual_gantry import ORIENTATION_SIGMA, POSITION_SIGMA, Gantry, Machine, commands, draw, measured
from virtual_instruments import Seen, read

import gtpin

TARGET = (0.02, -0.03, 0.06)
"""Where the reflector sits, TCP frame, m."""
VIEW = (Rotation.from_rotvec([0.1, -0.05, 0.8]), np.array([4.0, 2.0, 0.5]))
pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
Measure = Callable[[Machine, np.random.Generator, Path], gtpin.Dataset]


def by_schema_1(machine: Machine, rng: np.random.Generator, _: Path) -> gtpin.Dataset:
    """Poses of the TCP."""
    return measured(machine, commands(rng, 110), rng)


def by_schema_2(machine: Machine, rng: np.random.Generator, folder: Path, **said: object) -> gtpin.Dataset:
    """Poses of a reflector off the TCP, whose place is declared."""
    q = commands(rng, 110)
    T, turn = machine.seen(q)
    T = T + turn.apply(TARGET) + POSITION_SIGMA * rng.standard_normal(T.shape)
    turn = Rotation.from_rotvec(ORIENTATION_SIGMA * rng.standard_normal(T.shape)) * turn
    columns = dict(zip("xyz", T.T, strict=True)) | dict(
        zip(("qw", "qx", "qy", "qz"), turn.as_quat(scalar_first=True).T, strict=True)
    )
    section = {"name": "tracker", "kind": "tracker", "target": list(TARGET)} | {
        "position_sigma": POSITION_SIGMA,
        "orientation_sigma": ORIENTATION_SIGMA,
        "frame": "robot" if machine.view is None else "free",
    }
    return read(folder, Seen(section | said, q, columns))


def off(rng: np.random.Generator, more: dict[str, float], *, free: bool) -> Machine:
    """A machine within half its tolerances, but for some parameters that are off by so much more."""
    deviations = {name: 0.5 * value for name, value in draw(rng).deviations.items()}
    deviations |= {name: deviations[name] + value for name, value in more.items()}
    return Machine(Gantry.nominal().off(deviations), deviations, VIEW if free else None)


def error(found: gtpin.Calibration, machine: Machine, name: str) -> float:
    """Of a parameter, in units of its own sigma."""
    nominal = next(p.nominal for p in found.model.geometry.parameters if p.name == name)
    return float((found[name].value - nominal - machine.deviations[name]) / found[name].sigma)


@pytest.mark.parametrize("seed", [3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 8))])
@pytest.mark.parametrize("measure", [by_schema_1, by_schema_2])
def test_a_rod_twelve_millimetres_too_long_is_geometry_alone(measure: Measure, seed: int, tmp_path: Path):
    rng = np.random.default_rng(seed)
    machine = off(rng, {"length[2b]": 0.012}, free=True)
    found = gtpin.diagnose(measure(machine, rng, tmp_path))
    assert found.verdict == "none"
    assert any("tolerances are widened" in text for text in found.warnings)
    assert abs(error(found.baseline, machine, "length[2b]")) < 4.0


@pytest.mark.parametrize("measure", [by_schema_1, by_schema_2])
def test_a_zero_that_is_off_is_admitted_in_all_joints_of_its_cart(measure: Measure, tmp_path: Path):
    rng = np.random.default_rng(5)
    axis = Gantry.nominal().v[3]
    zero = {f"cart_joint[{rod}].{x}": 0.02 * axis[i] for rod in ("3a", "3b", "3c") for i, x in enumerate("xyz")}
    machine = off(rng, zero, free=False)
    found = gtpin.calibrate(measure(machine, rng, tmp_path))
    assert any("zero of cart3" in text and "widened" in text for text in found.warnings)
    assert max(abs(error(found, machine, name)) for name in zero) < 4.0


def test_a_tracker_that_stands_elsewhere_than_declared_is_fitted_as_free_in_schema_2_too(tmp_path: Path):
    rng = np.random.default_rng(6)
    machine = off(rng, {}, free=True)
    machine = Machine(machine.gantry, machine.deviations, (Rotation.identity(), np.array([0.0, 0.008, 0.0])))
    found = gtpin.calibrate(by_schema_2(machine, rng, tmp_path, frame="robot"))
    assert any('write frame = "free"' in text for text in found.warnings)
    assert found.unknown("tracker.frame.y").value == pytest.approx(0.008, abs=0.003)
    assert found.by_instrument[0].after < 1.1 * found.by_instrument[0].floor
    errors = [error(found, machine, name) for name in machine.deviations]
    assert np.abs(errors).max() < 4.5
