"""What passive encoders alone tell of a machine's causes: of five-bars of the tests' own, with an effect at a drive or none."""

from __future__ import annotations

import functools
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from virtual_five_bar import SIGMA, ZERO, FiveBar, commands, drawn, encoder, table, written

import gtpin
from gtpin.data import Commands
from gtpin.instruments.predicted import predicted_readings
from gtpin.model.predict import predict

Floats = np.ndarray

COUNT = 150
BACKLASH, SCALE = 1e-4, 1e-3
"""Half the backlash, rad, and how far a scale is off: five times the readings' noise, and more."""
JOINTS = ("elbow1", "elbow2")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:the links of five_bar have no masses"),
    pytest.mark.filterwarnings("ignore:set aside as gross errors"),  # which a large cause makes of good rows
]


@dataclass(frozen=True)
class Machine:
    """A five-bar with a cause at one drive, and the true zeros of its encoders."""

    cause: str
    bar: FiveBar
    zeros: Floats

    def readings(self, q: Floats, approach: Floats) -> Floats:
        """(N, 2) without noise."""
        real = q.copy()
        if self.cause == "backlash":
            real[:, 0] += BACKLASH * approach[:, 0]
        elif self.cause == "encoder_scale":
            real[:, 1] *= 1.0 + SCALE
        return self.bar.elbows(real) + self.zeros


SITE = {"backlash": "drive1", "encoder_scale": "drive2"}


@functools.cache
def diagnosed(cause: str) -> tuple[Machine, gtpin.Diagnosis, Commands, Floats]:
    """A machine's diagnosis, commands that were not measured, and what its encoders read there without noise."""
    rng = np.random.default_rng([17, 0])
    machine = Machine(cause, FiveBar.off(drawn(rng)), rng.normal(0.0, ZERO, 2))
    q, approach = commands(rng, COUNT), rng.choice([-1.0, 1.0], (COUNT, 2))
    read = machine.readings(q, approach) + rng.normal(0.0, SIGMA, (COUNT, 2))
    ways = {"approach1": approach[:, 0].astype(int), "approach2": approach[:, 1].astype(int)}
    tables = {joint: table(q, reading=read[:, i], **ways) for i, joint in enumerate(JOINTS)}
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder) / "set", [encoder(joint) for joint in JOINTS], tables)
        found = gtpin.diagnose(gtpin.Dataset.read(path))
    there, from_ = commands(rng, 40), rng.choice([-1.0, 1.0], (40, 2))
    names = np.array([str(i) for i in range(40)], dtype=object)
    held = Commands(names, there, {"approach1": from_[:, 0], "approach2": from_[:, 1]})
    return machine, found, held, machine.readings(there, from_)


def test_nothing_is_said_of_nothing() -> None:
    _, found, _, _ = diagnosed("none")
    assert found.verdict == "none"
    assert not found.causes


@pytest.mark.parametrize("cause", SITE)
def test_a_cause_at_a_drive_is_named(cause: str) -> None:
    _, found, _, _ = diagnosed(cause)
    (first,) = found.causes
    # Without a column of speeds a lag may be the backlash, and a scale a smooth deviation: the class says so.
    assert (first.effect, first.site) == (cause, SITE[cause])
    assert found.gap.explained_fraction is not None
    assert found.gap.explained_fraction > 0.95


@pytest.mark.parametrize("cause", SITE)
def test_its_model_predicts_readings_that_were_left_out(cause: str) -> None:
    _, found, held, true = diagnosed(cause)
    for model, most in ((found.baseline.model, None), (found.model, SIGMA)):
        poses = predict(model, held)
        off = np.stack([predicted_readings(model, poses, joint, {})["reading"] for joint in JOINTS], axis=1) - true
        rms = float(np.sqrt((off**2).mean()))
        assert rms > 2.0 * SIGMA if most is None else rms < most, rms


@pytest.mark.parametrize("cause", ["none", "backlash"])
def test_no_experiment_is_offered_for_effects_that_no_encoder_sees(cause: str) -> None:
    _, found, _, _ = diagnosed(cause)
    untestable = {(c.effect, c.site) for c in found.candidates if not c.testable}
    unseen = {pair for pair in untestable if pair[1] == "frame"} | {("target_offset", "platform")}
    assert {("frame_shift", "frame"), ("tracker_drift", "frame"), ("target_offset", "platform")} <= untestable
    offered = {pair for experiment in found.next_experiment for pair in experiment.effects}
    assert not offered & unseen
    assert ("zero_shift", "drive1") in offered  # lacks the same column as frame_shift, and encoders see it


def test_the_gap_is_that_of_the_readings() -> None:
    _, found, _, _ = diagnosed("backlash")
    first, second = found.gap.by_instrument
    assert (first.name, first.kind, first.unit) == ("elbow1", "encoder", "rad")
    assert max(first.before, second.before) > 3.0 * SIGMA
    for one in (first, second):
        assert one.after == pytest.approx(SIGMA, rel=0.2)  # of some 150 left-out readings: 6 % each


def test_a_saved_diagnosis_reads_the_same(tmp_path: Path) -> None:
    _, found, held, _ = diagnosed("backlash")
    found.save(tmp_path / "out")
    again = gtpin.read_model(tmp_path / "out")
    for joint in JOINTS:
        one, other = (predicted_readings(m, predict(m, held), joint, {})["reading"] for m in (found.model, again))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
    assert "elbow1" in (tmp_path / "out" / "report.html").read_text()
