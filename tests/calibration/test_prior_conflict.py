"""A machine that contradicts its tolerances is admitted, and said, whatever instrument measured it."""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import tomli_w
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from virtual_gantry import GANTRY, ORIENTATION_SIGMA, POSITION_SIGMA, Machine, commands, draw, measured
from virtual_instruments import Seen, read

import gtpin
from gtpin.export.export import export
from gtpin.extras.controllers.program import corrected_commands
from gtpin.output.shown import present

LONG_ROD = {"length[2b]": 0.012}
TARGET = (0.02, -0.03, 0.06)
"""Where the reflector sits, TCP frame, m."""
VIEW = (Rotation.from_rotvec([0.1, -0.05, 0.8]), np.array([4.0, 2.0, 0.5]))
pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
Measure = Callable[[Machine, np.random.Generator, Path], gtpin.Dataset]


def by_schema_1(machine: Machine, rng: np.random.Generator, _: Path) -> gtpin.Dataset:
    """Poses of the TCP."""
    return measured(machine, commands(rng, 110), rng)


def turning(rng: np.random.Generator) -> np.ndarray:
    """Commands at which the platform turns by tenths of a radian, so that they tell a target off the TCP from a moved frame."""
    q = rng.uniform(-0.55, 0.6, (600, 3))
    return q[np.ptp(q, axis=1) < 0.7][:150]


def by_schema_2(
    machine: Machine, rng: np.random.Generator, folder: Path, q: np.ndarray | None = None, **said: object
) -> gtpin.Dataset:
    """Poses of a reflector off the TCP, whose place is declared, unless ``said`` otherwise."""
    q = commands(rng, 110) if q is None else q
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
    return read(folder, Seen(section, q, columns).saying(**said))


def off(rng: np.random.Generator, more: dict[str, float], *, free: bool) -> Machine:
    """A machine within half its tolerances, but for some parameters that are off by so much more."""
    deviations = {name: 0.5 * value for name, value in draw(rng).deviations.items()}
    deviations |= {name: deviations[name] + value for name, value in more.items()}
    return Machine(GANTRY.off(deviations), deviations, VIEW if free else None)


def error(found: gtpin.Calibration, machine: Machine, name: str) -> float:
    """Of a parameter, in units of its own sigma."""
    nominal = next(p.nominal for p in found.model.geometry.parameters if p.name == name)
    return float((found[name].value - nominal - machine.deviations[name]) / found[name].sigma)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 8))
@pytest.mark.parametrize("measure", [by_schema_1, by_schema_2])
def test_a_rod_twelve_millimetres_too_long_is_geometry_alone(measure: Measure, seed: int, tmp_path: Path):
    rng = np.random.default_rng(seed)
    machine = off(rng, LONG_ROD, free=True)
    found = gtpin.diagnose(measure(machine, rng, tmp_path))
    assert found.verdict == "none"
    assert any("tolerances are widened" in text for text in found.warnings)
    assert found.baseline.model.doubt == ""
    assert abs(error(found.baseline, machine, "length[2b]")) < 4.0


@pytest.mark.parametrize("measure", [by_schema_1, by_schema_2])
def test_a_zero_that_is_off_is_admitted_in_all_joints_of_its_cart(measure: Measure, tmp_path: Path):
    rng = np.random.default_rng(5)
    axis = GANTRY.axis[3]
    zero = {f"cart_joint[{rod}].{x}": 0.02 * axis[i] for rod in ("3a", "3b", "3c") for i, x in enumerate("xyz")}
    machine = off(rng, zero, free=False)
    found = gtpin.calibrate(measure(machine, rng, tmp_path))
    assert any("zero of cart3" in text and "widened" in text for text in found.warnings)
    assert found.model.doubt == ""
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


def in_schema_1(folder: Path, target: tuple[float, ...] | None) -> gtpin.Dataset:
    """The same readings as the poses of a dataset of schema 1, with or without the place of the reflector."""
    toml = tomllib.loads((folder / "dataset.toml").read_text())
    section = {key: value for key, value in toml["instrument"][0].items() if key not in ("name", "kind", "target")}
    section |= {} if target is None else {"target": list(target)}
    (folder / "dataset.toml").write_text(tomli_w.dumps(toml | {"schema": "gtpin-dataset/1", "instrument": section}))
    (folder / "tracker.csv").rename(folder / "poses.csv")
    return gtpin.Dataset.read(folder)


@pytest.mark.parametrize("schema", quick_first([2, 1]))
@pytest.mark.parametrize(("free", "more"), quick_first([(False, {}), (False, LONG_ROD), (True, LONG_ROD)], 2))
@pytest.mark.parametrize("seed", quick_first([11, 12]))
def test_a_reflector_off_the_tcp_that_nobody_declared_is_said_first(
    schema: int, free: bool, more: dict[str, float], seed: int, tmp_path: Path
):
    rng = np.random.default_rng(seed)
    data = by_schema_2(off(rng, more, free=free), rng, tmp_path, turning(rng), target=None)
    found = gtpin.calibrate(data if schema == 2 else in_schema_1(tmp_path, None))
    told = re.search(r"write target = \[(.*?)\] under", found.warnings[0])
    assert told is not None
    assert np.abs(np.array(told[1].split(","), dtype=float) - TARGET).max() < 5e-3
    first = present(found).lead
    assert (first.badge, first.tone) == ("geometry in doubt", "warn")
    assert first.content == []
    assert not any("gtpin export" in step.command for step in first.steps)
    assert not any("zero of" in text or "tolerances from nominal" in text for text in found.warnings)


@pytest.fixture(scope="module")
def undeclared(tmp_path_factory: pytest.TempPathFactory) -> gtpin.Diagnosis:
    """Of a machine with a reflector off the TCP that nobody declared."""
    rng, folder = np.random.default_rng(11), tmp_path_factory.mktemp("undeclared") / "set"
    by_schema_2(off(rng, {}, free=False), rng, folder, turning(rng))
    return gtpin.diagnose(in_schema_1(folder, None))


def test_a_diagnosis_of_an_undeclared_reflector_lists_no_parameters_as_found(undeclared: gtpin.Diagnosis):
    found = undeclared
    assert "write target" in found.warnings[0]
    assert found.model.doubt == found.baseline.model.doubt != ""
    first = present(found).lead
    assert first.headline.startswith("The geometry is in doubt")
    assert "write target" in first.advice[0]
    assert not any("change from nominal" in table.head for table in first.content)


def test_schema_1_takes_the_place_of_the_reflector(tmp_path: Path):
    rng = np.random.default_rng(14)
    machine = off(rng, {}, free=True)
    second = gtpin.calibrate(by_schema_2(machine, rng, tmp_path))
    first = gtpin.calibrate(in_schema_1(tmp_path, TARGET))
    assert first.values == pytest.approx(second.values, abs=1e-12)
    assert first.warnings == second.warnings
    first.dataset.write(tmp_path / "again")
    assert gtpin.calibrate(gtpin.Dataset.read(tmp_path / "again")).values == pytest.approx(second.values, abs=1e-12)


def test_what_is_made_from_a_geometry_in_doubt_says_so_first(undeclared: gtpin.Diagnosis, tmp_path: Path):
    found = undeclared.baseline
    found.save(tmp_path / "calibrated")
    pd.DataFrame({"pose": ["a"], "q1": [0.1], "q2": [0.0], "q3": [0.1]}).to_csv(tmp_path / "commands.csv", index=False)
    model = gtpin.read_model(tmp_path / "calibrated")

    def said(write: Callable[[Path], object], name: str) -> str:
        """The first warning, and the head of the file."""
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            write(tmp_path / name)
        assert str(told[0].message).startswith(f"{name} has a geometry in doubt: the target does not look")
        return "".join((tmp_path / name).read_text(encoding="utf-8").splitlines()[:2])

    for name in ("r.urdf", "r.sdf", "r.xml"):
        assert "in doubt" in said(partial(export, model), name)
        ElementTree.parse(tmp_path / name)
    said(partial(export, model), "r.yaml")
    said(partial(export, model), "r.diff")
    said(lambda file: corrected_commands(model, tmp_path / "commands.csv", None, file, force=False), "corrected.csv")
    assert (
        "in doubt" in (tmp_path / "calibrated" / "model" / "robot.urdf").read_text(encoding="utf-8").split("<robot")[0]
    )
    with pytest.raises(gtpin.GtpinError, match="in doubt, so it can't be certified"):
        gtpin.certify(found.dataset, model)
    words = undeclared.summary()
    assert "in doubt" in words
    assert "is enough" not in words
