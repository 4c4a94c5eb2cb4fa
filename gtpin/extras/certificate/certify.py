"""``gtpin.certify``: accuracy and repeatability of a machine, and the uncertainty of its corrected positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.before_fit import known_noise, plausible_rows, prepared
from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset
from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.plausible import copies, sane_rows
from gtpin.diagnosis.diagnose import diagnose
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import DatasetError, ModelError, UnreachableError, check_kind, noted
from gtpin.extras.certificate.budget import budget
from gtpin.extras.certificate.evaluate import Evaluation
from gtpin.extras.certificate.held_against import HeldAgainst, ModelPosterior
from gtpin.extras.certificate.result import Basis, Certificate
from gtpin.model.measured_robot import check_same_robot
from gtpin.model.model import Model
from gtpin.noise.noise import Noise
from gtpin.read_only import gives_read_only
from gtpin.real import generator
from gtpin.robot.command_ranges import check_actuators
from gtpin.robot.geometry import Geometry
from gtpin.threads import in_one_thread

FEWEST = 10
"""Smallest number N of rows. With fewer, the relative standard deviation of a mean square error, sqrt(2 / (3 N)), is above
0.26."""
POSES = 200
"""Number of poses over which the budget is averaged."""
TRIES = 20
"""Number of pairs of measured commands that are tried for each of these poses."""


@in_one_thread
@gives_read_only
def certify(
    dataset: Dataset,
    model: Model | None = None,
    *,
    instrument: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Certificate:
    """Certify a machine: ISO 9283, ISO 230-2 as far as the data allow, and an uncertainty budget (GUM).

    Parameters
    ----------
    dataset
        Poses measured by one tracker.
    model
        The model that corrects the machine; it should be identified from other poses. By default, the model that a diagnosis of
        these data gives.
    instrument
        Standard uncertainty of the instrument's systematic error at the TCP, m, per axis, from the instrument's certificate.
        None: this row of the budget stays blank.
    seed
        Seed of the diagnosis, and of the poses and machines that are drawn for the budget.
    progress
        Called at each stage with a message, the number of the iteration, and the RMS residual in units of the noise (NaN where
        there is none).

    Raises
    ------
    GtpinError
        If the dataset has no measured positions, is too small or does not match the model, the model's geometry or noise is
        not known, or the data support none of the certificate's numbers.

    Examples
    --------
    >>> import gtpin
    >>> dataset = gtpin.Dataset.read("measured")
    >>> certificate = gtpin.certify(dataset, gtpin.calibrate(dataset).model)
    >>> certificate.basis
    'fitted'
    >>> certificate.budget.combined.shape
    (6,)
    """
    check_kind(dataset, Dataset)
    check_kind(model, Model, type(None))
    _check(dataset, model, instrument)
    with noted() as texts:
        found = _certify(dataset, model, instrument, seed, progress)
    return replace(found, warnings=dataset.all_warnings(texts))


def _certify(
    dataset: Dataset, model: Model | None, instrument: float | None, seed: int, progress: Progress | None
) -> Certificate:
    found = diagnose(dataset, seed=seed, progress=progress) if model is None else None
    used = found.model if found is not None else model
    assert used is not None
    if used.doubt:
        raise ModelError(
            f"the geometry is in doubt, so it can't be certified: {used.doubt}",
            file=dataset.toml,
            column="instrument.target",
        )
    rows = _rows(dataset, used, found)
    noise, free = _noise(dataset, used), dataset.instrument.frame == "free"
    held = HeldAgainst.of(used, rows, noise, align=free and found is None)
    posterior = ModelPosterior(held.model, held.frame() if free else None)
    basis: Basis = "left_out" if found is not None else "fitted" if held.fitted(posterior) else "new"
    known = dataset.instrument.target == "tcp"
    bare = Model(Geometry.nominal(used.robot)) if known else held.model.without([a.name for a in held.model.effects])
    nominal = HeldAgainst.of(bare, rows, noise, align=free and known)
    gap = None if found is None else found.gap
    unknown = found is not None and found.verdict == "unknown"
    evaluation = Evaluation(rows, nominal, known, held, posterior, gap, basis == "fitted", unknown)
    quantities = evaluation.quantities()
    if all(one.value is None for one in quantities):
        raise DatasetError(
            "these data support no number of a certificate: accuracy, repeatability and positioning are all blank",
            file=dataset.file,
            hint="measure poses that the model was not fitted to, or visit a tenth of the poses twice, and certify these",
        )
    if progress is not None:
        progress("propagating the uncertainty over the workspace", 0, float("nan"))
    at = between(rows, held.model, generator(seed))
    turned = held.errors.shape[1] == 6
    aside = ~np.isin(dataset.row, rows.row) & ~copies(dataset)
    return Certificate(
        model=held.model,
        quantities=quantities,
        budget=budget(posterior, at, *evaluation.spreads(), instrument, orientation=turned, seed=seed),
        noise=noise,
        basis=basis,
        one_way=evaluation.one_way,
        noise_known=evaluation.noise_known,
        verdict=None if found is None else found.verdict,
        poses=len(np.unique(rows.visits)),
        rows=len(rows),
        set_aside=tuple(dict.fromkeys(str(pose) for pose in dataset.pose[aside])),
        dataset=dataset,
        seed=seed,
    )


def _check(dataset: Dataset, model: Model | None, instrument: float | None) -> None:
    if any(dataset.readings.stations):
        raise DatasetError(
            "each session has a free frame (stations): one hides where the machine stands, several also how it moves between "
            "the sessions, so it can't be certified",
            file=dataset.toml,
            column="instrument.stations",
            hint="register the sessions to common marks, and give all poses in one frame",
        )
    what, hint = (
        "a certificate takes the positions of one tracker, and other instruments' readings are none",
        "measure poses with a tracker (gtpin-dataset/1), and give the model of these readings with --model",
    )
    if len(dataset.readings.tables) == 1 and isinstance(dataset.readings.tables[0], TrackerTable):
        what = "a certificate is of the measured point, and with target = [x, y, z] this is not the TCP"
        hint = (
            "to certify the target, give the robot's file a link there, write its name as tcp in dataset.toml, and leave "
            "target out"
        )
    dataset.refuse_readings(what, hint)
    if instrument is not None and not 0.0 < instrument < np.inf:
        raise ModelError(f"an instrument's uncertainty of {instrument:g} m", hint="give a positive number of metres")
    if model is None:
        return
    if model.covariance is None:
        raise ModelError(
            f"the geometry of this model of {model.robot.name} is nominal, so its uncertainty is not known",
            hint="give a model that gtpin calibrate or gtpin diagnose has written",
        )
    check_same_robot(model.robot, dataset)
    check_actuators(model.robot, dataset)
    if dataset.instrument.frame == "robot" and not model.frame.is_base:
        raise ModelError(
            'the model was measured in a frame of the instrument, and these poses in the base frame (frame = "robot")',
            file=dataset.file,
            column="instrument.frame",
            hint='set frame = "free" under [instrument]',
        )


def _rows(dataset: Dataset, model: Model, found: Diagnosis | None) -> Dataset:
    """The usable rows: those that a diagnosis did not set aside, or those that are plausible for a given model."""
    if found is not None:
        kept = prepared(dataset, Model(model.geometry))
        rows = kept.take(sane_rows(kept) & ~np.isin(kept.row, found.set_aside_rows))
    else:
        bare = Model(model.geometry)
        kept = prepared(dataset, bare)
        kept = kept.take(sane_rows(kept))
        rows = kept.take(plausible_rows(kept, bare, bare.kinematics.forward(kept.q)))
    if len(rows) < FEWEST:
        raise DatasetError(f"{len(rows)} usable poses", file=dataset.file, hint=f"a certificate needs {FEWEST}")
    return rows


def _noise(dataset: Dataset, model: Model) -> Noise:
    """The noise: declared sigmas, else those of the model's fit."""
    known, declared = model.fit, dataset.instrument
    position, turns = declared.position_sigma, declared.orientation_sigma
    if known is not None:
        position = known.position_sigma if position is None else position
        turns = known.orientation_sigma if turns is None else turns
    return known_noise(dataset, position, turns, 0.0 if known is None else known.drives)


def between(dataset: Dataset, model: Model, rng: np.random.Generator, count: int = POSES) -> OperatingPoints:
    """``count`` commands drawn on straight lines between two measured commands, each with the covariates of a measured row.

    They are in the convex hull of the measured commands, so that the certificate does not extrapolate.

    Raises `UnreachableError` if the model reaches none of them.
    """
    tried = count * TRIES
    one, two = rng.integers(0, len(dataset), (2, tried))
    w = rng.random((tried, 1))
    q = w * dataset.q[one] + (1.0 - w) * dataset.q[two]
    poses = model.kinematics.forward(q[:count])
    if not poses.reached.all():
        poses = model.kinematics.forward(q)
    kept = np.flatnonzero(poses.reached)[:count]
    if not len(kept):
        raise UnreachableError("no pose between the measured ones can be reached", hint="check the model")
    q = q[kept]
    rows = rng.integers(0, len(dataset), len(q))
    covariates = {name: values[rows] for name, values in dataset.covariates.items()}
    return OperatingPoints(model.kinematics, q, poses[kept], covariates)
