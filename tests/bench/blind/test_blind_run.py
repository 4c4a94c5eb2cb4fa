"""Checks of cases made by hand: seals, failures, and going on after a stop."""

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import joblib
import pytest
from handmade import Quiet, canned, cause, diagnosis, write_case

import gtpin.bench.blind.run
from gtpin.bench.blind.draw import Draft
from gtpin.bench.blind.run import check, check_given
from gtpin.bench.blind.score import score
from gtpin.bench.blind.truth import given, take_in
from gtpin.bench.blind.worker import Outcome
from gtpin.bench.simulator.case import Case, drawn_recipe
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.data import Dataset
from gtpin.errors import GtpinError, GtpinWarning


@pytest.mark.usefixtures("here")
def test_a_folder_of_cases_is_scored_by_hand(cases: Path, tmp_path: Path) -> None:
    watch = Quiet()
    checked = check_given(tmp_path / "out", cases, watch)
    assert [c.name for c in checked.cases] == list("abcdefg")
    assert [c.kind for c in checked.cases] == ["one", "one", "none", "none", "unlisted", "two", "one"]
    told = score(checked.cases, checked.about)
    assert told["cases"] == 7
    assert told["strict"] == 1 / 3  # a; b is called backlash, g failed
    assert told["in_class"] == 2 / 3
    assert told["class_size"] == 1.5
    assert told["site"] == 1 / 3
    assert told["false_alarm"] == 0.5
    assert told["unknown_recognised"] == 1.0
    assert told["unknown_misnamed"] == 0.0
    assert told["set_f1"] == 0.5  # linearity of linearity and zero_shift, and a false rack_step
    assert told["shrinkage_error"] == pytest.approx(0.05)  # said 0.7; 4 um become 2 um, three quarters of the power
    assert told["interval_coverage"] == 1.0
    assert told["failed"] == 1 / 7
    assert told["by_effect"]["linearity"]["cases"] == 1
    assert told["by_effect"]["servo_lag"]["in_class"] == 1.0
    manifest = (tmp_path / "out" / "cases" / "manifest.json").read_bytes()
    assert told["check"]["manifest"] == hashlib.sha256(manifest).hexdigest()


@pytest.mark.usefixtures("here")
def test_truths_are_sealed_and_out_of_sight_while_cases_are_diagnosed(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, seen = tmp_path / "out", []

    def watched(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        digests = json.loads((output / "cases" / "manifest.json").read_text())["truths"]
        assert files["truth.sha256"].decode().strip() in digests.values()
        seen.append(sorted(files))
        assert not [f for f in (output / "cases").rglob("*") if "truth" in f.name and f.name != "truth.sha256"]
        return canned(files, exclude)

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", watched)
    monkeypatch.setattr(gtpin.bench.blind.run, "_taken_out", lambda truths: {})  # what follows the opening
    check_given(output, cases, Quiet())
    own = ["canned.json", "commands.csv", "dataset.toml", "poses.csv", "truth.sha256"]
    assert seen == [own] * 7
    digests = json.loads((output / "cases" / "manifest.json").read_text())["truths"]
    for name, digest in digests.items():
        sealed = (output / "sealed" / f"{name}.json").read_bytes()
        assert hashlib.sha256(sealed).hexdigest() == digest
        published = json.loads((output / "cases" / f"{name}.truth.json").read_text())
        first, second = ([(e["effect"], e["site"]) for e in t["effects"]] for t in (published, json.loads(sealed)))
        assert first == second


@pytest.mark.usefixtures("here")
def test_a_tampered_truth_is_a_failed_case(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output = tmp_path / "out"

    def tampering(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        sealed = output / "sealed" / "c.json"
        sealed.write_text(sealed.read_text().replace("none", "many"))
        return canned(files, exclude)

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", tampering)
    checked = check_given(output, cases, Quiet())
    broken = checked.cases[2]
    assert "seal is broken" in str(broken.error)
    assert broken.kind is None
    assert score(checked.cases)["failures"] == ["c", "g"]
    assert score(checked.cases)["false_alarm"] == 1.0  # of d alone
    assert not (output / "cases" / "c.truth.json").exists()


def _truth_with_its_digests(out: Path) -> None:
    """Another truth of e, with which its digest and the manifest agree."""
    sealed, manifest = out / "sealed" / "e.json", out / "cases" / "manifest.json"
    old = hashlib.sha256(sealed.read_bytes()).hexdigest()
    sealed.write_text(sealed.read_text().replace('"unlisted"', '"many"'))
    new = hashlib.sha256(sealed.read_bytes()).hexdigest()
    for file in (manifest, out / "cases" / "e" / "truth.sha256"):
        file.write_text(file.read_text().replace(old, new))


def _dataset(out: Path) -> None:
    poses = out / "cases" / "c" / "poses.csv"
    poses.write_text(poses.read_text() + "\n")


def _diagnosis(out: Path, name: str = "c") -> None:
    file = out / "diagnoses" / f"{name}.json"
    file.write_text(file.read_text().replace('"verdict":"', '"verdict":"un'))


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("edit", "told"),
    [
        (_truth_with_its_digests, "truth of e"),
        (_dataset, "dataset of c"),
        (_diagnosis, "diagnosis of c"),
        (partial(_diagnosis, name="a.without"), "diagnosis without its effect of a"),
    ],
)
def test_what_is_edited_after_the_seals_were_opened_is_reported(
    cases: Path, tmp_path: Path, edit: Callable[[Path], None], told: str
) -> None:
    out = tmp_path / "out"
    first = check_given(out, cases, Quiet())
    assert "changed" not in check_given(out, cases, Quiet()).about
    edit(out)
    for _ in range(2):  # the first digests stay
        with pytest.warns(GtpinWarning, match=f"changed since they were first sealed or diagnosed.*{told}"):
            again = check_given(out, cases, Quiet())
        assert again.about["changed"] == [told]
        assert score(again.cases, again.about)["check"]["changed"] == [told]
    assert "changed" not in first.about


@pytest.mark.usefixtures("here")
def test_every_other_case_of_an_effect_is_diagnosed_without_it(
    tmp_path: Path, small: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, asked = tmp_path / "given", []
    folder.mkdir()
    told = {"said": diagnosis("explained", cause("backlash@cart1")), "without": diagnosis("unknown")}
    for name in "abc":
        write_case(folder, name, small, [("backlash", "cart1")], told)

    def noted(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        asked.append(exclude)
        return canned(files, exclude)

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", noted)
    checked = check_given(tmp_path / "out", folder, Quiet())
    assert asked == [()] * 3 + [("backlash",)] * 2
    assert [c.without and c.without.verdict for c in checked.cases] == ["unknown", None, "unknown"]
    assert [c.said and c.said.verdict for c in checked.cases] == ["explained"] * 3


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_stopped_check_goes_on_where_it_was(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = score(check_given(tmp_path / "whole", cases, Quiet()).cases)
    count = 0

    def stopping(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        nonlocal count
        count += 1
        if count == 4:
            raise KeyboardInterrupt
        return canned(files, exclude)

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", stopping)
    with pytest.raises(KeyboardInterrupt):
        check_given(tmp_path / "out", cases, Quiet())
    assert len(list((tmp_path / "out" / "diagnoses").iterdir())) == 3
    watch = Quiet()
    again = check_given(tmp_path / "out", cases, watch)
    assert watch.begun[0] == ("diagnosing", 7, 3)
    assert score(again.cases) == whole


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_folder_is_that_of_one_check(cases: Path, tmp_path: Path) -> None:
    check_given(tmp_path / "out", cases, Quiet())
    (cases / "c.truth.json").write_text('{"effects": [{"effect": "backlash", "site": "cart1"}]}')
    with pytest.raises(GtpinError, match="another check: other cases"):
        check_given(tmp_path / "out", cases, Quiet())
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("x")
    with pytest.raises(GtpinError, match="not the folder of a check"):
        check_given(tmp_path / "full", cases, Quiet())
    assert [f.name for f in (tmp_path / "full").iterdir()] == ["mine.txt"]


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_opened_cases_can_be_scored_again(cases: Path, tmp_path: Path) -> None:
    first = check_given(tmp_path / "out", cases, Quiet())
    second = check_given(tmp_path / "again", tmp_path / "out" / "cases", Quiet())
    assert score(second.cases) == score(first.cases)


@pytest.mark.usefixtures("here")
def test_a_diagnosis_that_can_not_be_judged_is_a_failed_case(cases: Path, tmp_path: Path) -> None:
    told = json.loads((cases / "c" / "canned.json").read_text())
    del told["said"]["where"]
    (cases / "c" / "canned.json").write_text(json.dumps(told))
    result = score(check_given(tmp_path / "out", cases, Quiet()).cases)
    assert result["failures"] == ["c", "g"]
    assert result["false_alarm"] == 0.5
    assert result["kinds"]["none"] == 2


@pytest.mark.usefixtures("here")
def test_sources_that_change_meanwhile_are_told(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digests = iter(["before", "after"])
    monkeypatch.setattr(gtpin.bench.blind.run, "diagnosis_digest", lambda: next(digests))
    with pytest.warns(GtpinWarning, match="have changed while the check ran"):
        check_given(tmp_path / "out", cases, Quiet())


@pytest.mark.slow
def test_a_case_of_the_plant_goes_all_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Made and judged here, diagnosed by the real thing in processes of its own."""
    real = gtpin.bench.blind.run.workers

    @contextlib.contextmanager
    def workers(cluster: str | None = None) -> Iterator[None]:
        with real(None) if cluster else joblib.parallel_config(backend="sequential"):
            yield

    monkeypatch.setattr(gtpin.bench.blind.run, "workers", workers)
    monkeypatch.setattr(gtpin.bench.blind.run, "check_cluster", lambda address: None)
    monkeypatch.setattr(gtpin.bench.blind.run, "_taken_out", lambda truths: {})
    draft = Draft("only", "one", 5, ("encoder_scale",), 60)
    monkeypatch.setattr(gtpin.bench.blind.run, "drafts", lambda cases, seed, robot, instruments: [draft])
    (case,) = check(tmp_path / "out", 1, 0, Quiet(), "processes").cases
    assert case.error is None
    assert case.said is not None
    assert case.single.effect == "encoder_scale"
    assert 30.0 < case.noncentrality < 4000.0
    assert case.leaves < case.noncentrality
    assert case.shrunk is not None
    assert 0.0 < case.shrunk.after < case.shrunk.before
    assert score([case])["cases"] == 1


@pytest.fixture
def machines(here: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases of the plant are two of 20 stops, and nothing is known of any."""
    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", lambda *_: (Outcome(error="nobody looked"), 0.1))

    def drafts(cases: int, seed: int, robot: str, instruments: tuple[str, ...]) -> list[Draft]:
        return [Draft(name, "one", 5, ("backlash",), 20, robot, instruments) for name in ("a", "b")]

    monkeypatch.setattr(gtpin.bench.blind.run, "drafts", drafts)


@pytest.mark.slow
@pytest.mark.usefixtures("machines")
@pytest.mark.study
def test_a_check_of_other_instruments_is_a_check_of_its_own_and_can_be_scored_again(tmp_path: Path) -> None:
    first = check(tmp_path / "out", 2, 0, Quiet(), instruments=["tilt", "range"])
    assert [case.single.effect for case in first.cases] == ["backlash", "backlash"]
    assert all(case.error == "nobody looked" and case.noncentrality > 0.0 for case in first.cases)
    assert first.about["instruments"] == "range,tilt"
    names = {file.name for file in (tmp_path / "out" / "cases" / "a").iterdir()} - {".gtpin.json"}
    assert names == {"commands.csv", "dataset.toml", "level.csv", "truth.sha256", "wire.csv"}
    again = check(tmp_path / "out", 2, 0, Quiet(), instruments=["range", "tilt"])
    assert score(again.cases) == score(first.cases)
    with pytest.raises(GtpinError, match="another check: other instruments"):
        check(tmp_path / "out", 2, 0, Quiet(), instruments=["range"])
    with pytest.raises(GtpinError, match="no instrument is called"):
        check(tmp_path / "new", 2, 0, Quiet(), instruments=["laser"])
    assert not (tmp_path / "new").exists()
    given = check_given(tmp_path / "given", tmp_path / "out" / "cases", Quiet())
    assert [case.noncentrality for case in given.cases] == [case.noncentrality for case in first.cases]


def test_a_dataset_of_schema_2_is_taken_in_with_the_urdf_that_it_names(tmp_path: Path) -> None:
    urdf = tmp_path / "robots" / "mine.urdf"
    urdf.parent.mkdir()
    urdf.write_text(gtpin.load_robot("gantry_tau").description.xml)
    recipe = drawn_recipe(1, effects=[], poses=8, held_out=2, robot=str(urdf), conditions=SimulatedConditions())
    made = build_measured(recipe, ["range"])
    made.write_dataset(tmp_path / "cases" / "a")
    made.write_truth(tmp_path / "cases", "a")
    (case,) = given(tmp_path / "cases")
    take_in(case, tmp_path / "taken")
    urdf.unlink()
    taken = Dataset.read(tmp_path / "taken")
    assert taken.robot == "robot.urdf"
    assert len(taken) == len(made.dataset)


# ------------------------------------------------------------------------------------- crashes, bad input, other people


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("diagnoses/b.json", b""),
        ("diagnoses/b.json", b'{"diagnosis": {"sch'),
        ("diagnoses/b.json", b"\x00" * 100),
        ("cases/manifest.json", b""),
    ],
)
def test_a_file_that_a_crash_has_cut_short_is_made_again(cases: Path, tmp_path: Path, name: str, left: bytes) -> None:
    output, watch = tmp_path / "out", Quiet()
    whole = score(check_given(output, cases, Quiet()).cases)
    before = (output / name).read_bytes()
    (output / name).write_bytes(left)
    (output / "diagnoses" / ".gtpin-0123.json").write_bytes(left)
    (output / "seconds.txt").write_text("a 0.1")
    assert score(check_given(output, cases, watch).cases) == whole
    assert (output / name).read_bytes() == before
    assert ("diagnosing", 7, 6 if "diagnoses" in name else 7) in watch.begun
    assert not list((output / "diagnoses").glob(".*"))


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_full_disk_leaves_no_claim_and_does_not_touch_that_of_a_check_that_goes_on(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, real = tmp_path / "out", Path.write_text

    def check_with_full_disk(word: str) -> None:
        def full(path: Path, *rest: object, **more: object) -> int:
            if word in str(rest[0]):
                raise OSError(28, "No space left on device")
            return real(path, *rest, **more)  # type: ignore[arg-type]

        with monkeypatch.context() as patch:
            patch.setattr(Path, "write_text", full)
            with pytest.raises(GtpinError, match="No space left"):
                check_given(out, cases, Quiet())

    check_with_full_disk("schema")
    assert not out.exists()
    assert len(check_given(out, cases, Quiet()).cases) == 7
    (out / "diagnoses" / "b.json").unlink()
    claim = (out / "check.json").read_bytes()
    check_with_full_disk("")
    assert (out / "check.json").read_bytes() == claim
    assert len(check_given(out, cases, Quiet()).cases) == 7


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_bad_input_leaves_no_folder_that_refuses_the_right_one(
    cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "out"
    with pytest.raises(GtpinError, match="no robot is called"):
        check(output, 2, 0, Quiet(), robot="gremlin")
    assert not output.exists()

    def broken(*_: object) -> None:
        raise GtpinError("it can't be copied")

    with monkeypatch.context() as patch:  # the last of seven can't be taken in
        seen: list[object] = []
        real = gtpin.bench.blind.run.take_in
        patch.setattr(
            gtpin.bench.blind.run, "take_in", lambda *a: broken() if len(seen) == 6 else (seen.append(a), real(*a))[1]
        )
        with pytest.raises(GtpinError, match="copied"):
            check_given(output, cases, Quiet())
    assert not output.exists()
    assert len(check_given(output, cases, Quiet()).cases) == 7


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_check_of_cases_that_were_corrected_since_replaces_one_that_had_not_begun(
    cases: Path, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    check_given(output, cases, Quiet())
    (output / "cases" / "manifest.json").unlink()  # as if killed while the cases were taken in
    (cases / "c.truth.json").write_text('{"effects": [{"effect": "backlash", "site": "cart1"}]}')
    assert check_given(output, cases, Quiet()).cases[2].kind == "one"


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_force_moves_another_check_and_foreign_files_aside(cases: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    check_given(output, cases, Quiet())
    first = {file.name: file.read_bytes() for file in (output / "diagnoses").iterdir()}
    (cases / "c.truth.json").write_text('{"effects": [{"effect": "backlash", "site": "cart1"}]}')
    with pytest.raises(GtpinError, match="--force"):
        check_given(output, cases, Quiet())
    check_given(output, cases, Quiet(), force=True)
    assert {file.name: file.read_bytes() for file in (output / "diagnoses.old-1").iterdir()} == first
    assert (output / "check.json.old-1").is_file()
    (tmp_path / "mine" / "cases").mkdir(parents=True)
    (tmp_path / "mine" / "cases" / "thesis.tex").write_text("mine")
    check_given(tmp_path / "mine", cases, Quiet(), force=True)
    assert (tmp_path / "mine" / "cases.old-1" / "thesis.tex").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_of_two_checks_in_one_folder_one_stops(cases: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = []

    def second(files: dict[str, bytes], exclude: tuple[str, ...] = ()) -> object:
        if not said:
            with pytest.raises(GtpinError, match="another run of gtpin is writing here") as refused:
                check_given(tmp_path / "out", cases, Quiet())
            said.append(str(refused.value))
        return canned(files, exclude)

    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", second)
    assert len(check_given(tmp_path / "out", cases, Quiet()).cases) == 7
    assert said
