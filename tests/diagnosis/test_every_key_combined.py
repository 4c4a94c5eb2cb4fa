"""Keys of the dataset format, kinds of noise and covariates, in pairs, with repeats, gross errors and a free frame."""

import json
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from pairwise import all_pairs
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator.simulate import Simulation, simulate
from gtpin.data import CartMeasurements, Conditions, Dataset
from gtpin.robot.library import urdf_path

Row = Mapping[str, str]

COVARIATE = ("missing", "constant", "varies")
FACTORS: dict[str, Sequence[str]] = {
    "declared": ("both", "position", "orientation", "neither"),
    "station": ("named", "unknown"),
    "frame": ("robot", "free"),
    "measured": ("poses", "positions"),
    "visits": ("once", "some twice", "all twice"),
    "repeatability": ("none", "drives scatter"),
    "wrong": ("none", "gross errors", "out of reach"),
    "robot": ("name", "path"),
    "reference_temperature": ("left out", "22.5"),
    "tolerance": ("left out", "given"),
    "carts": ("none", "measured"),
    "table": ("csv", "parquet"),
    **dict.fromkeys(
        ("time", "session", "temp_frame", "temp_link", "payload", "approach", "speed", "force", "other"), COVARIATE
    ),
}
"""A dataset's choices: keys of dataset.toml, what the noise is, which columns there are and whether they vary."""
POSES, TWICE, GROSS = 36, 9, 4
SCATTER = 2e-5
"""Repeatability of the drives, m."""
TABLE = all_pairs(FACTORS)
PER_LINK = ("thermal_links", "joint_clearance", "joint_runout", "link_compliance")
ALIKE = [f"{effect}@{link}" for effect in PER_LINK for link in ("link2a", "link2b", "link3a", "link3b", "link3c")]
SLOW = ("rack_periodic", "rack_step", *ALIKE)
"""What takes longer than all else: effects that are scanned for, and links that are as others."""


@pytest.fixture(scope="module")
def measured() -> Simulation:
    """A Gantry-Tau without hidden effects, each pose visited once."""
    return simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=POSES, seed=7)


def dataset_of(row: Row, simulation: Simulation, folder: Path) -> Dataset:
    """The dataset that a row of the table describes, written and read again."""
    rng = np.random.default_rng(3)
    q = simulation.dataset.q[np.unique(simulation.dataset.pose, return_index=True)[1]]
    again = {"once": 0, "some twice": TWICE, "all twice": len(q)}[row["visits"]]
    visit = np.concatenate([np.arange(len(q)), np.arange(again)])
    q = q[visit]
    scatter = SCATTER * rng.standard_normal(q.shape) if row["repeatability"] == "drives scatter" else 0.0
    true = simulation.machine.predict(q + scatter)
    T = true.T + 1.5e-5 * rng.standard_normal(true.T.shape)
    R = Rotation.from_rotvec(5e-5 * rng.standard_normal(true.T.shape)) * Rotation.from_matrix(true.R)
    if row["wrong"] == "gross errors":
        T[rng.permutation(len(T))[:GROSS]] += 0.02
    if row["wrong"] == "out of reach":
        visit, q = np.append(visit, 900), np.vstack([q, [1.9, -1.9, 0.0]])
        T, R = np.vstack([T, T[:1]]), Rotation.concatenate([R, R[:1]])
    station = np.array([1.5, -7.0, 0.3])
    if row["frame"] == "free":
        turn, shift = Rotation.from_euler("xyz", [0.4, -0.2, 2.0]), np.array([3.0, -1.0, 0.5])
        T, R, station = turn.apply(T) + shift, turn * R, turn.apply(station) + shift
    sigmas = {"position_sigma": 1.5e-5, "orientation_sigma": 5e-5}
    left_out = {"both": [], "position": ["orientation_sigma"], "orientation": ["position_sigma"]}.get(
        row["declared"], [*sigmas]
    )
    instrument = gtpin.data.InstrumentSection(
        **{name: value for name, value in sigmas.items() if name not in left_out},
        frame=row["frame"],
        station=tuple(station) if row["station"] == "named" else None,
    )
    (folder / "machine.urdf").write_bytes(urdf_path("gantry_tau").read_bytes())
    dataset = Dataset(
        robot="../machine.urdf" if row["robot"] == "path" else "gantry_tau",
        pose=np.array([f"p{i}" for i in visit], dtype=object),
        q=q,
        position=T,
        orientation=R.as_quat(canonical=True, scalar_first=True) if row["measured"] == "poses" else None,
        covariates=covariates(row, len(q), rng),
        instrument=instrument,
        conditions=Conditions(reference_temperature=22.5) if row["reference_temperature"] == "22.5" else Conditions(),
        tolerance={"link_length": 4e-4, "track_direction": 4e-4} if row["tolerance"] == "given" else {},
        carts=carts() if row["carts"] == "measured" else None,
        path=folder / "set",
    )
    dataset.write(folder / "set", table=row["table"])
    return Dataset.read(folder / "set")


def covariates(row: Row, count: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    varied = {
        "time": {"time": 30.0 * rng.permutation(count)},
        "session": {"session": np.array(["a", "b"], dtype=object)[rng.integers(0, 2, count)]},
        "temp_frame": {"temp_frame": rng.uniform(20.0, 24.0, count)},
        "temp_link": {"temp_link": rng.uniform(20.0, 24.0, count)},
        "payload": {"payload": rng.choice([0.0, 5.0], count)},
        "approach": {"approach1": rng.choice([-1.0, 1.0], count)},
        "speed": {"speed2": rng.choice([0.0, 0.1, -0.1], count)},
        "force": {f"f{axis}": rng.choice([0.0, 40.0, -40.0], count) for axis in "xyz"},
        "other": {"tilt": rng.normal(size=count)},
    }
    columns = {}
    for kind, some in varied.items():
        if row[kind] != "missing":
            columns |= {
                name: np.full(count, values[0], values.dtype) if row[kind] == "constant" else values
                for name, values in some.items()
            }
    return columns


def carts() -> CartMeasurements:
    cart, q = np.repeat([1, 2, 3], 12), np.tile(np.linspace(-0.8, 0.8, 12), 3)
    return CartMeasurements(cart, q, np.column_stack([q, 0.1 * cart, np.zeros(36)]))


def diagnosed(dataset: Dataset, exclude: Sequence[str]) -> tuple[gtpin.Diagnosis, object]:
    """A diagnosis, and its JSON, in which every number is finite."""
    found = gtpin.diagnose(dataset, exclude=exclude)
    return found, json.loads(json.dumps(found.to_json(), allow_nan=False))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("number", range(len(TABLE)))
def test_any_two_choices_together_are_diagnosed(number: int, measured: Simulation, tmp_path: Path) -> None:
    dataset = dataset_of(TABLE[number], measured, tmp_path)
    found, told = diagnosed(dataset, SLOW)
    assert found.verdict in ("none", "explained", "ambiguous", "unknown")
    aside = {"none": 0, "gross errors": GROSS, "out of reach": 1}[TABLE[number]["wrong"]]
    assert len(found.set_aside) >= (aside > 0)
    if TABLE[number]["wrong"] == "out of reach":
        assert "p900" in found.set_aside
    if number % 7 == 0:  # row order means nothing
        shuffled = dataset.take(np.random.default_rng(number).permutation(len(dataset)))
        again, other = diagnosed(shuffled, SLOW)
        said, said_again = (sorted(sorted(text.split()) for text in one.pop("warnings")) for one in (told, other))
        assert [w.strip(",") for text in said for w in text] == [w.strip(",") for text in said_again for w in text]
        alike(told, other, "diagnosis")
        assert set(found.set_aside) == set(again.set_aside)


def alike(one: object, other: object, where: str) -> None:
    """Two results that differ by no more than rounding does."""
    assert type(one) is type(other), where
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for key in one:
            alike(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            alike(a, b, f"{where}.{i}")
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=1e-4, abs=1e-6), where
    else:
        assert one == other, where


def test_the_table_holds_every_pair_of_values() -> None:
    wanted = {
        frozenset({(a, x), (b, y)}) for a in FACTORS for b in FACTORS if a < b for x in FACTORS[a] for y in FACTORS[b]
    }
    assert {frozenset(pair) for row in TABLE for pair in combinations(row.items(), 2)} == wanted
