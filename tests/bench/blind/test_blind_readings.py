"""D and the realised explained fraction of cases that instruments read."""

import json
import shutil
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from handmade import Quiet, cause, diagnosis, left_by_definition
from scipy.stats import chi2

import gtpin.bench.blind.draw
import gtpin.bench.blind.run
from gtpin.bench.blind.difficulty import Difficulty
from gtpin.bench.blind.draw import Draft, made, recipe, truth_of
from gtpin.bench.blind.judged import Judged, judge
from gtpin.bench.blind.run import check, check_given
from gtpin.bench.blind.truth import Truth, digest_of, seal
from gtpin.bench.blind.worker import Outcome, readings_at
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.truth import InstrumentCase
from gtpin.calibration.calibrate import calibrate
from gtpin.data import Commands, Dataset
from gtpin.effects.catalogue import effects_by_id
from gtpin.instruments.readings import Readings, single

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # of calibrations of few readings

FIVE_BAR = Path(__file__).parents[3] / "examples" / "loops" / "five_bar.urdf"
ON_FIVE_BAR = {"robot": str(FIVE_BAR)}


def a_case(
    folder: Path, instruments: Sequence[str], effect: str = "backlash", seed: int = 7, poses: int = 60, **more: Any
) -> tuple[InstrumentCase, Truth]:
    """A case as a check makes it, written into a folder, and its truth."""
    draft = Draft("x", "one", seed, (effect,), poses, instruments=tuple(instruments), **more)
    case = made(draft)
    assert isinstance(case, InstrumentCase)
    case.write_dataset(folder)
    return case, truth_of(case, "one")


def graded(folder: Path, truth: Truth) -> tuple[Difficulty, gtpin.Calibration]:
    dataset = Dataset.read(folder)
    baseline = calibrate(dataset)
    return Difficulty.of_readings(dataset, {n.name: np.array(n.sigma) for n in truth.noise}, baseline), baseline


def diagnosed_by_geometry(folder: Path) -> Outcome:
    """The outcome of a diagnosis that names nothing."""
    dataset = Dataset.read(folder)
    read = readings_at(calibrate(dataset).model, folder, Commands.read(folder / "commands.csv", dataset.n_actuators))
    return Outcome(diagnosis=diagnosis("none"), baseline_readings=read, model_readings=read)


def opened_by(folder: Path, truth: Truth, outcome: Outcome) -> Judged:
    file = folder.with_name(f"{folder.name}.sealed.json")
    seal(truth, folder, file)
    return judge(folder, file, digest_of(file.read_bytes()), outcome)


@pytest.mark.slow
@pytest.mark.parametrize(
    "instruments",
    [["range"], ["plane"], ["socket"], ["tilt"], ["ballbar"], ["camera"], ["range", "plane"], ["socket", "tilt"]],
    ids="+".join,
)
@pytest.mark.parametrize("effect", ["backlash", "frame_shift"])
def test_energy_of_readings_is_the_plants(tmp_path: Path, instruments: list[str], effect: str) -> None:
    """The plant has derivatives about the true machine, the judge about the calibrated one: they agree to some per cent."""
    _, truth = a_case(tmp_path, instruments, effect)
    (true,) = truth.effects
    assert graded(tmp_path, truth)[0].noncentrality(np.array(true.displacement)) == pytest.approx(true.energy, rel=0.06)


@pytest.fixture(scope="module")
def wire_and_bed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Truth, Difficulty]:
    folder = tmp_path_factory.mktemp("mixed") / "x"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _, truth = a_case(folder, ["range", "plane"], "linearity", 3)
        return truth, graded(folder, truth)[0]


@pytest.mark.parametrize("name", ["backlash@cart1", "link_compliance@arm", "tracker_scale@frame"])
def test_what_an_effect_leaves_of_readings_is_by_the_definition(
    wire_and_bed: tuple[Truth, Difficulty], name: str
) -> None:
    truth, difficulty = wire_and_bed
    at, displacement = difficulty.operating_points, np.array(truth.effects[0].displacement)
    effect, _, site = name.partition("@")
    basis = effects_by_id()[effect].basis(at, site)
    assert difficulty.row is not None
    assert difficulty.unknowns is not None
    geometry = at.kinematics.geometry
    by_geometry = difficulty.whitened(at.kinematics.geometry_jacobian(at.q, at.poses) * geometry.tolerance)
    B = np.hstack([by_geometry, difficulty.unknowns.reshape(len(by_geometry), -1)])
    X = difficulty.whitened(basis.displacement(at) * basis.sigma)
    d = difficulty.whitened(displacement[difficulty.row][:, :, None])[:, 0]
    scale, left = left_by_definition(B, X, d)
    found = difficulty.left(displacement)[name]
    assert found.scale == scale
    assert found.left == pytest.approx(left, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "told"), [("range", ("range",)), ("tracker", None)])
def test_a_case_is_judged_with_d_that_is_at_most_e_a_tracker_of_schema_2_as_one_of_schema_1(
    kind: str, told: tuple[str, ...] | None, tmp_path: Path
) -> None:
    _, truth = a_case(tmp_path / "x", [kind], "linearity")
    case = opened_by(tmp_path / "x", truth, Outcome(diagnosis=diagnosis("explained", cause("linearity@cart1"))))
    assert case.error is None
    assert case.instruments == told
    assert 0.0 <= case.leaves <= 1.02 * case.noncentrality
    assert case.rival != case.single.name
    assert bool(truth.readings) == (kind == "range")


@pytest.mark.slow
def test_d_stays_open_where_an_encoder_reads_and_the_rest_is_judged(tmp_path: Path) -> None:
    case, truth = a_case(tmp_path / "x", ["encoder"], **ON_FIVE_BAR)
    true = np.array(case.held["encoder"][0])
    outcome = Outcome(
        diagnosis=diagnosis("none"),
        baseline_readings={"encoder": (true + 4e-5).tolist()},
        model_readings={"encoder": (true + 2e-5).tolist()},
    )
    found = opened_by(tmp_path / "x", truth, outcome)
    assert found.error is None
    assert found.instruments == ("encoder",)
    assert found.noncentrality > 0.0
    assert np.isnan(found.leaves)
    assert found.shrunk is not None


# ------------------------------------------------------------------------------------------------- realised explained fraction


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), [("plane", "bed"), ("socket", "cup")])
@pytest.mark.study
def test_shrinkage_of_what_is_touched_is_realised_at_touches_that_were_not_in_the_data(
    tmp_path: Path, kind: str, name: str
) -> None:
    case, truth = a_case(tmp_path / "x", [kind])
    (read,) = truth.readings
    asked = Commands.read(tmp_path / "x" / f"commands-{name}.csv", 3, ids=("plane", "socket", "target"))
    assert read.name == name
    assert len(read.values) == len(asked) == 12
    assert len(case.dataset) == 60
    assert not set(asked.pose) & set(Dataset.read(tmp_path / "x").pose)
    true, sigma = np.array(read.values), np.array(read.sigma)
    assert np.abs(true).max() < 6.0 * sigma.max()  # it touches there, as exactly as it can
    outcome = Outcome(
        diagnosis=diagnosis("none"),
        baseline_readings={name: (true + 3.0 * sigma).tolist()},
        model_readings={name: (true - sigma).tolist()},
    )
    shrunk = opened_by(tmp_path / "x", truth, outcome).shrunk
    assert shrunk is not None
    assert (shrunk.before, shrunk.after) == pytest.approx((3.0, 1.0))
    assert shrunk.share == pytest.approx(1.0 - 1.0 / 9.0)


@pytest.mark.slow
@pytest.mark.parametrize("instruments", [["plane"], ["socket"], ["range", "socket"]], ids="+".join)
@pytest.mark.study
def test_what_is_predicted_of_touches_is_what_a_calibration_would_miss(tmp_path: Path, instruments: list[str]) -> None:
    """With the touches of the data as its own commands, an instrument is predicted as the calibration's residuals are."""
    a_case(tmp_path, instruments)
    dataset = Dataset.read(tmp_path)
    for table in ("bed", "cup"):
        if (tmp_path / f"{table}.csv").exists():
            shutil.copy(tmp_path / f"{table}.csv", tmp_path / f"commands-{table}.csv")
    baseline = calibrate(dataset)
    commands = Commands.read(tmp_path / "commands.csv", dataset.n_actuators)
    found = readings_at(baseline.model, tmp_path, commands)
    split = single(dataset, baseline.model.robot)
    readings = Readings.of(split, baseline.model.robot, baseline.u)
    missed = -readings.residual_at(baseline.model.kinematics.forward(split.q))[:, 0]
    for index, table in enumerate(split.readings.tables):
        values = np.array(found[table.name])
        if table.kind == "range":
            assert len(values) == len(commands)
            continue
        own = (split.readings.of == index) & (split.readings.component < values.shape[1])
        np.testing.assert_allclose(values.ravel(), missed[own], atol=1e-9)


@pytest.mark.slow
def test_a_sixth_of_the_touches_is_left_out_and_nothing_that_reads() -> None:
    draft = Draft("x", "two", 7, ("backlash", "linearity"), 60, instruments=("range", "plane"))
    case, whole = made(draft), build_measured(recipe(draft), draft.instruments)
    (wire, bed), (touches,) = case.gauges, case.left_out
    assert len(wire.stop) == len(whole.gauges[0].stop)
    assert len(bed.stop) + len(touches.stop) == len(whole.gauges[1].stop)
    assert len(touches.stop) == len(whole.gauges[1].stop) // 6
    assert set(touches.columns["plane"]) == {"low", "high", "tilted"}
    assert all(len(effect.displacement) == len(case.dataset) for effect in case.effects)
    before = {effect.effect: effect.noncentrality for effect in whole.effects}
    assert all(0.7 * before[e.effect] < e.noncentrality < 1.02 * before[e.effect] for e in case.effects)
    assert [e.noncentrality for e in case.effects] == sorted((e.noncentrality for e in case.effects), reverse=True)


@pytest.mark.slow
def test_a_touch_that_is_left_out_misses_by_what_the_machine_scattered() -> None:
    """No model predicts the scatter: the truth has it, so that a model's error does not."""
    draft = Draft("x", "none", 11, (), 90, instruments=("plane",))
    usual = recipe(draft)
    noise = usual.noise.model_copy(update={"repeatability": (5e-5, 5e-5)})
    loose = replace(usual, noise=noise)
    case = build_measured(loose, draft.instruments, leave_out=True)
    (own,), poses = case.left_out, case.true
    jitter = case.machine.command_jacobian(case.dataset.q, poses) * case.repeatability
    moved = own.by_motion(poses[own.stop]) @ jitter[own.stop]
    sigma = np.sqrt(own.sigma**2 + (moved**2).sum(axis=2))
    assert np.median(sigma / own.sigma) > 2.0
    values = case.held["bed"][0]
    squares, count = float(((values / sigma) ** 2).sum()), values.size
    assert chi2.ppf(1e-4, count) < squares < chi2.isf(1e-4, count)


@pytest.mark.slow
def test_all_touches_stay_where_an_encoder_reads_too() -> None:
    draft = Draft("x", "one", 7, ("backlash",), 20, instruments=("encoder", "plane"))
    case = made(draft)
    assert len(case.gauges[1].stop) == len(build_measured(recipe(draft), draft.instruments).gauges[1].stop)
    assert case.left_out == ()


@pytest.mark.slow
def test_one_diagnosis_of_instruments_is_judged_by_all_of_their_readings(tmp_path: Path) -> None:
    _, truth = a_case(tmp_path / "x", ["range", "plane"])
    wire, bed = truth.readings
    assert (wire.name, bed.name) == ("wire", "bed")
    off = {r.name: (np.array(r.values) + np.array(r.sigma)).tolist() for r in truth.readings}
    right = {r.name: [list(row) for row in r.values] for r in truth.readings}
    outcome = Outcome(diagnosis=diagnosis("none"), baseline_readings=off, model_readings={**off, "bed": right["bed"]})
    shrunk = opened_by(tmp_path / "x", truth, outcome).shrunk
    assert shrunk is not None
    assert shrunk.share == pytest.approx(len(bed.values) / (len(bed.values) + len(wire.values)))


# -------------------------------------------------------------------------------------------------- what is sealed


def test_the_truth_of_a_tracker_is_sealed_as_before() -> None:
    draft = Draft("x", "one", 7, ("backlash",), 60)
    truth = truth_of(made(draft), "one")
    assert set(json.loads(truth.model_dump_json())) == {"kind", "effects", "poses", "readings", "sigma"}
    assert Truth.model_validate_json(truth.model_dump_json()) == truth


@pytest.mark.slow
def test_noise_is_at_least_the_instruments_own(tmp_path: Path) -> None:
    case, truth = a_case(tmp_path, ["ballbar", "plane"])
    for gauge, noise in zip(case.gauges, truth.noise, strict=True):
        assert noise.name == gauge.name
        assert (np.array(noise.sigma) >= gauge.sigma).all()
    assert Truth.model_validate_json(truth.model_dump_json()) == truth


@pytest.mark.slow
def test_cases_of_instruments_that_are_scored_again_have_the_same_d_and_shrinkage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: None
) -> None:
    drafts = [Draft("a", "one", 5, ("backlash",), 40, instruments=("range", "socket"))]
    monkeypatch.setattr(gtpin.bench.blind.run, "drafts", lambda *_: drafts)

    def baseline_twice(files: dict[str, bytes], _: tuple[str, ...] = ()) -> tuple[Outcome, float]:
        folder = tmp_path / "in"
        folder.mkdir(exist_ok=True)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        return diagnosed_by_geometry(folder), 0.1

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", baseline_twice)
    (first,) = check(tmp_path / "out", 1, 0, Quiet(), instruments=["range", "socket"]).cases
    (again,) = check_given(tmp_path / "again", tmp_path / "out" / "cases", Quiet()).cases
    assert first.error is None
    assert first.shrunk is not None
    assert first.shrunk.share == 0.0
    assert np.isfinite(first.leaves)
    assert again == first


def test_no_effect_leaves_more_of_readings_than_there_is(wire_and_bed: tuple[Truth, Difficulty]) -> None:
    truth, difficulty = wire_and_bed
    displacement = np.array(truth.effects[0].displacement)
    whole = difficulty.noncentrality(displacement)
    assert all(-1e-6 * whole <= best.left <= whole * (1.0 + 1e-9) for best in difficulty.left(displacement).values())


@pytest.mark.slow
def test_energy_is_the_plants_where_nothing_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gtpin.bench.simulator.instruments.build.ONE_IN", 10_000)
    draft = Draft("x", "one", 7, ("backlash",), 60, instruments=("range", "socket"))
    case, whole = made(draft), build_measured(recipe(draft), draft.instruments)
    assert case.effects[0].noncentrality == pytest.approx(whole.effects[0].noncentrality, rel=0.01)
