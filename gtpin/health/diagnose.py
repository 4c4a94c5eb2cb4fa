"""``gtpin.diagnose``: a diagnosis of data alone, or of what has changed since an earlier model."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import overload

from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.diagnose import diagnose as diagnose_alone
from gtpin.diagnosis.linear.hold_out import HoldOut
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.effect import Effect
from gtpin.errors import ModelError
from gtpin.health.check import check
from gtpin.health.result import HealthCheck
from gtpin.model.model import Model
from gtpin.robot.robot import Robot


@overload
def diagnose(
    dataset: Dataset,
    robot: Robot | Model | None = None,
    *,
    against: None = None,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    hold_out: HoldOut = "region",
    seed: int = 0,
    trust_data: bool = False,
    progress: Progress | None = None,
) -> Diagnosis: ...


@overload
def diagnose(
    dataset: Dataset,
    robot: None = None,
    *,
    against: Model,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    seed: int = 0,
    trust_data: bool = False,
    progress: Progress | None = None,
) -> HealthCheck: ...


def diagnose(
    dataset: Dataset,
    robot: Robot | Model | None = None,
    *,
    against: Model | None = None,
    effects: Iterable[Effect] | None = None,
    exclude: Collection[str] = (),
    false_alarm: float = FALSE_ALARM,
    priors: Priors = PRIORS,
    hold_out: HoldOut = "region",
    seed: int = 0,
    trust_data: bool = False,
    progress: Progress | None = None,
) -> Diagnosis | HealthCheck:
    """Find the causes of the error that remains after geometric calibration; or, with ``against``, of what has changed.

    Without ``against``, five steps: prepare the data and calibrate; propose hypotheses, and re-estimate noise and outliers;
    infer which hypotheses are causes; fit them together with the geometry; plan what to measure next. See docs/diagnosis.md.

    With ``against``, nothing is calibrated: the earlier model with its uncertainty is the prior, and the causes are changes
    since then. Ten poses are enough. See docs/health.md.

    Parameters
    ----------
    dataset
        Measured poses or readings, with all covariates that were recorded.
    robot
        The nominal robot, or a model whose ``robot`` is taken; by default the robot that the dataset names. Not allowed
        together with ``against``.
    against
        An earlier model of the machine; None: no earlier model.
    effects
        The effects to try; by default the whole catalogue. To add your own effects: ``[*gtpin.catalogue(), MyEffect()]``.
        The dataset's drivers (``[[driver]]`` in dataset.toml) are tried in addition, but not with ``against``.
    exclude
        Effects that are not tried, each as ``effect`` (at all its sites) or ``effect@site``.
    false_alarm
        Probability of naming a cause where there is none.
    priors
        The constants on which verdicts depend, each with its source: docs/priors.md.
    hold_out
        The poses that are left out together to compute the gap: ``region`` (neighbouring poses), ``session``, ``time``
        (neighbours in time) or ``random``. Only ``gap`` and the causes' ``shrinkage`` depend on it. With ``against`` it is not
        used: each pose is left out by itself.
    seed
        Seed of the random numbers: subsets of large datasets, and the draws from which intervals and thresholds are computed.
    trust_data
        Whether checks for usual mistakes (units, signs, orders of columns) only warn, and never refuse the data.
    progress
        Called at each stage with a message, the number of the iteration, and the RMS residual in units of the noise (NaN where
        there is none); None: no calls.

    Returns
    -------
    diagnosis
        A :class:`~gtpin.diagnosis.result.Diagnosis`; with ``against`` a :class:`~gtpin.health.result.HealthCheck`.

    Raises
    ------
    GtpinError
        If the dataset does not match this robot, an excluded effect is not known, or the data do not have the column or the
        number of poses that ``hold_out`` needs.

    Examples
    --------
    >>> import gtpin
    >>> diagnosis = gtpin.diagnose(gtpin.Dataset.read("measured"), exclude=["backlash@cart1"])
    >>> any((cause.effect, cause.site) == ("backlash", "cart1") for cause in diagnosis.causes)
    False
    """
    if against is None:
        return diagnose_alone(
            dataset,
            robot,
            effects=effects,
            exclude=exclude,
            false_alarm=false_alarm,
            priors=priors,
            hold_out=hold_out,
            seed=seed,
            trust_data=trust_data,
            progress=progress,
        )
    if robot is not None:
        raise ModelError("a robot and an earlier model of it", hint="give against alone: the model has its robot")
    return check(
        dataset,
        against,
        effects=effects,
        exclude=exclude,
        false_alarm=false_alarm,
        priors=priors,
        seed=seed,
        trust_data=trust_data,
        progress=progress,
    )
