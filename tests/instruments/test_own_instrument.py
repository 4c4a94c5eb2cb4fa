"""A user's own instrument is one class: it is read, calibrates and diagnoses as the built-in ones, without derivatives."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
import pytest
from virtual_five_bar import FiveBar, commands, drawn, table, written

import gtpin
from gtpin.instruments import Instrument, Plane

ROBOT = "gantry_tau"
STATION = np.array([0.5, -3.5, 1.5])


class SumTable(gtpin.InstrumentTable):
    """Keys and columns of :class:`Sum`."""

    numbers: ClassVar = ("reading",)
    kind: Literal["sum"]
    scale_sigma: float = 1e-3


class Sum(gtpin.Instrument):
    """A string over two pulleys: the distances from two points to the TCP together, plus its own length, which is unknown."""

    kind, Table = "sum", SumTable
    components = (gtpin.Component("reading", "m"),)

    def _unknowns(self):
        return [gtpin.Unknown(f"{self.name}.length", "m", 0.0, 1e-2)]

    def predicted(self, poses, u):
        """(M, 1) what would be read."""
        return (read_string(poses.T) + u[0])[:, None]


def read_string(T):
    return np.linalg.norm(T - STATION, axis=1) + np.linalg.norm(T - STATION * [-4.0, 1.2, 0.5], axis=1)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A machine with backlash, read by the string and a dial gauge over a plane; its geometry and the string's length."""
    rng = np.random.default_rng(4)
    robot = gtpin.load_robot(ROBOT)
    nominal = gtpin.Geometry.nominal(robot)
    geometry = nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))
    q = rng.uniform(-0.3, 0.3, (160, 1)) + rng.uniform(-0.25, 0.25, (160, 3))
    approach = rng.choice([-1.0, 1.0], (160, 3))
    play = np.zeros((160, 3))
    play[:, 1] = 1e-4 * approach[:, 1]
    T = gtpin.Model(geometry).predict(q + play).T
    length = 3.5e-3
    folder = tmp_path_factory.mktemp("own")
    (folder / "dataset.toml").write_text(
        f'schema = "gtpin-dataset/2"\nrobot = "{ROBOT}"\n'
        '[[instrument]]\nname = "string"\nkind = "sum"\nsigma = 2e-5\n'
        '[[instrument]]\nname = "dial"\nkind = "plane"\nsigma = 1e-5\n'
        "planes = {P = {point = [-1.3, -4.2, 0.0], normal = [0.0, 0.0, 1.0]}}\n"
    )
    for name, column, values in (
        ("string", "reading", read_string(T) + length + rng.normal(0.0, 2e-5, 160)),
        ("dial", "height", T[:, 2] + rng.normal(0.0, 1e-5, 160)),
    ):
        rows = [f"pose,q1,q2,q3,approach1,approach2,approach3,{column}"]
        rows += [",".join(map(repr, [i, *map(float, (*q[i], *approach[i], values[i]))])) for i in range(len(q))]
        (folder / f"{name}.csv").write_text("\n".join(rows))
    return folder, geometry, length


def test_a_class_of_one_s_own_is_asked_for_by_its_kind(case):
    with pytest.raises(gtpin.GtpinError, match="no instrument is of kind 'sum'"):
        gtpin.Dataset.read(case[0])
    dataset = gtpin.Dataset.read(case[0], instruments=[Sum])
    assert [table.kind for table in dataset.readings.tables] == ["sum", "plane"]
    assert isinstance(dataset.readings.tables[0], SumTable)


def test_a_column_that_it_needs_is_asked_for(case, tmp_path):
    for file in case[0].iterdir():
        (tmp_path / file.name).write_text(file.read_text().replace("reading", "rding"))
    with pytest.raises(gtpin.GtpinError, match=r"string\.csv, row 1, column reading: the column is missing"):
        gtpin.Dataset.read(tmp_path, instruments=[Sum])


def test_numerical_derivatives_are_those_that_a_built_in_instrument_has():
    """The base class's differences, of a plane, against the plane's own derivatives."""
    from test_derivatives import instrument

    one, poses, u = instrument("plane")
    assert np.abs(Instrument.by_pose(one, poses, u) - Plane.by_pose(one, poses, u)).max() < 1e-8
    assert np.abs(Instrument.by_unknown(one, poses, u) - Plane.by_unknown(one, poses, u)).max() < 1e-8


def test_it_calibrates_and_its_unknown_is_found(case):
    folder, geometry, length = case
    found = gtpin.calibrate(gtpin.Dataset.read(folder, instruments=[Sum]))
    estimate = found.unknown("string.length")
    assert abs(estimate.value - length) < 5.0 * estimate.sigma
    assert estimate.sigma < 1e-2
    string = next(one for one in found.by_instrument if one.name == "string")
    assert string.after < 0.3 * string.before
    assert np.abs((found.model.geometry.values - geometry.values) / found.sigma).max() < 5.0


@pytest.mark.slow
def test_it_diagnoses(case):
    found = gtpin.diagnose(gtpin.Dataset.read(case[0], instruments=[Sum]))
    assert [(cause.effect, cause.site) for cause in found.causes] == [("backlash", "cart2")]


def test_the_names_that_it_needs_are_gtpin_s():
    assert {"Component", "Instrument", "InstrumentTable", "Unknown"} <= set(dir(gtpin))
    assert gtpin.Instrument is Instrument


class GearedTable(gtpin.InstrumentTable):
    """Keys and columns of :class:`Geared`."""

    numbers: ClassVar = ("reading",)
    kind: Literal["geared"]
    first: str
    second: str

    @property
    def measured_joints(self):
        """The passive joints that it reads."""
        return self.first, self.second


class Geared(gtpin.Instrument):
    """A differential: the sine of the sum of two passive joints' coordinates."""

    kind, Table = "geared", GearedTable
    components = (gtpin.Component("reading", "rad"),)

    def measured(self):
        """(M, 1) what was read."""
        return self.read.numbers["reading"][:, None]

    def predicted(self, poses, u):
        """(M, 1) what would be read."""
        return np.sin(sum(poses.joints[joint] for joint in self.table.measured_joints))[:, None]


@pytest.mark.slow
def test_an_instrument_of_one_s_own_reads_passive_joints(tmp_path):
    rng = np.random.default_rng(8)
    bar, q = FiveBar.off(drawn(rng)), commands(rng, 80, 0.4)
    read = np.sin(bar.elbows(q).sum(axis=1)) + rng.normal(0.0, 2e-5, 80)
    said = {"name": "sum", "kind": "geared", "first": "elbow1", "second": "elbow2", "sigma": 2e-5}
    path = written(tmp_path / "set", [said], {"sum": table(q, reading=read)})
    found = gtpin.calibrate(gtpin.Dataset.read(path, instruments=[Geared]))
    # Chi-square of some 75 freedoms lies within 0.5 of 1 but for one draw in a thousand (sd sqrt(2 / 75) = 0.16).
    assert abs(found.chi2_per_dof - 1.0) < 0.5
    assert found.by_instrument[0].after < found.by_instrument[0].before / 5.0
