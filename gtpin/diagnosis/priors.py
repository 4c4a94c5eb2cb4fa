"""Numbers that influence a verdict, with their sources; limits of a search or of a test are beside it.

A source is one of three. *Derived*: from a formula that is given. *Measured*: a script of ``examples/`` measures it again.
*Assumed*: a stated assumption. ``examples/diagnosis/priors.py`` halves and doubles the most important numbers, and measures
how the scores of sealed cases change; docs/statistics.md has the table. The sizes of modulations belong to the effects:
``gtpin/effects/modulation.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

SURE = 0.95
"""Probability from which a cause is reported as sure. It is fixed, because it defines the verdicts."""
LIKELY = 0.5
"""Probability from which the leader of a class is likely: it can stand beside something unknown, and a weak cause is listed
with the others. It is fixed for the same reason."""
UNLIKELY = 0.49
"""Largest probability of a cause without which the errors of left-out poses are no larger. Assumed: such a cause is not likely,
so that it is any number a little below ``LIKELY``; a number equal to it would pass or fail by rounding."""
CLASS_SHARE = 0.05
"""Share of the leader's probability from which a hypothesis belongs to its class. It is fixed for the same reason."""


@dataclass(frozen=True)
class Priors:
    """Priors, thresholds and assumptions of a diagnosis: ``gtpin.diagnose(data, priors=Priors(third=8.0))``."""

    # The size of an effect.
    scale_spread: float = 1.3
    """Standard deviation of the natural logarithm of the scale s (size of an effect over its typical size). Assumed: on most
    machines s is between a quarter and four."""
    least_core: float = 0.5
    """Smallest root mean square of the core's coefficients, in units of sigma, over the scale s. Below it, the scale s is not
    admitted, because it serves the modulation alone. Its square is also the smallest share of a core in the energy of the
    whole effect, where the data determine the core. Assumed."""

    # Prior odds against terms, natural logarithms in nats, and penalties by the data's own evidence.
    unnamed: float = 5.0
    """Log prior odds against a smooth term, in addition to those of a named effect: the catalogue lists the common effects.
    Assumed, odds of 1 to 150."""
    same_clock: float = 1.1
    """Log prior odds of an effect over time or session alone to a motion of another part over the same. Assumed, odds of 3 to
    1: instruments and floors move more often than targets, links and carts."""
    third: float = 4.0
    """Additional log prior odds against a third cause, and against each further one. Assumed, odds of 1 to 55: three causes at
    once are rare."""
    most_coefficients: float = 0.5
    """Number of coefficients that a model of a robot without rods has at most when a term is added, over that of the measured
    numbers. Assumed: with more of them, several terms of all links explain any data."""
    line: float = 4.0
    """Additional log prior odds against each further period of one periodic error. Assumed, odds of 1 to 55: a gear with one
    period often has others."""
    same: float = 0.08
    """Penalty, a share of a stronger cause's evidence: what a hypothesis at the same site with the same coordinates must gain
    in addition to its log prior odds. Reason: a cause never follows its equation exactly. Measured: docs/statistics.md."""
    related: float = 0.05
    """The same share, for a hypothesis that could imitate a difference between the stronger cause and its equation. Measured:
    docs/statistics.md."""
    other: float = 0.01
    """The same share, for all other hypotheses. Measured: docs/statistics.md."""
    imitation: float = 2.9
    """Most that these shares take off the logarithm of a hypothesis's odds to a cause in its class. Derived: just below -ln of
    ``CLASS_SHARE``, 3.0; what explains as much as the cause is in its class though it could also imitate another one."""
    departure: float = 0.025
    """Share of the evidence of the smooth terms by which the log posterior of a model with them must be larger than that of a
    model with named causes. Measured: docs/statistics.md."""
    modulation: float = 0.06
    """The same share, where the smooth terms could be the modulation of a named cause. Measured: docs/statistics.md."""

    # From evidence to probability.
    temperature: float = 3.0
    """Smallest temperature: gains in log evidence are divided by it to compute probabilities. Measured: docs/statistics.md,
    with a false cause that costs as much as five missed ones."""
    warming: float = 0.004
    """Increase of the temperature for each nat of evidence: the larger an effect is, the more its difference from its equation
    shows. Assumed; the probabilities that result are measured: docs/blind.md."""

    # Proxies of covariates that were not recorded.
    not_recorded: float = 0.2
    """Prior odds of an effect whose covariate was not recorded, relative to those of an effect that can be tested. Assumed."""
    not_varied: float = 0.05
    """The same for sessions without a pause between them, and for the payload. A column whose value does not vary is often not
    recorded. Assumed."""
    likely_speed: float = 0.1
    """Speed, m/s or rad/s, that is assumed where none was recorded. Assumed."""
    pause: float = 10.0
    """Smallest ratio of an interval between visits to the usual interval for which it is a pause. A session may begin after a
    pause. Assumed."""
    warmer: float = 5.0
    """Rise of a machine's temperature in use, K. Assumed."""
    payload: float = 10.0
    """A usual payload, kg. Assumed."""

    # Smooth nonparametric terms.
    smooth_shift: float = 4e-5
    """Typical size of shifts, m. Assumed: two to three times the errors of good drives and guideways."""
    smooth_turn: float = 4e-5
    """Typical size of turns, rad. Assumed."""
    smooth_strain: float = 2e-5
    """Typical size of strains of all links, and of the scale of what is measured. Assumed: smooth shifts over two metres."""
    smooth_distance: float = 2.0
    """Typical distance from home to the instrument along each axis, m: its scale times this shifts home. Assumed."""
    smooth_change: float = 0.4
    """Typical size of the slow change of a smooth function along a track, relative to the function. Assumed."""

    smooth_reach: float = 1.7
    """Half wavelength of smooth functions of the TCP position, relative to half the range of the measured positions along the
    base axis with the largest range. Assumed."""

    # What can be tested.
    large: float = 28.5
    """Multiple of an effect's typical size at which it is checked whether geometry absorbs the effect. If so, it can't be
    tested. Derived: exp(2.576 ``scale_spread``), the size that one effect of 200 exceeds."""
    shows: float = 15.8
    """Smallest whitened energy that an effect must have after geometry has absorbed what it can. Derived: a matched filter with
    95 % detections at 1 % false alarms, (z_0.95 + z_0.99)^2, z the quantile of the normal distribution."""

    leaves: float = 0.01
    """Share of an effect's whitened energy that geometry leaves, up to which geometry absorbs an effect that does not show.
    Above it, the effect is small. The share does not depend on the typical size. Assumed; it changes only words."""

    # Noise and outliers.
    disbelieved: float = 10.8
    """Twice the loss in log likelihood, relative to the best repeatability, from which a repeatability is rejected. Derived:
    chi-square with one degree of freedom at a chance of 1 in 1,000."""
    drive_excess: float = 6.0
    """Standard deviations by which the scatter of an actuator must exceed the noise before it is not attributed to noise.
    Assumed."""
    weak: float = 0.1
    """Share of the chi-square beyond noise below which an undecided cause is listed apart from the causes, and a flexible
    family without a mechanism's form makes no doubt. Assumed."""
    core_leaves: float = 0.15
    """Largest share that may remain beside named causes: of the gap (squared errors of left-out positions beyond noise), or of
    all that was measured (chi-square beyond noise); and of the explained energy, because real causes differ from the equations
    of their cores. Above it, the verdict becomes ``unknown``. Assumed; examples/diagnosis/noise_floor.py measures how many
    right verdicts it costs."""
    chance_line: float = 0.01
    """Probability above which the lines of a periodic error are attributed to scatter: that the best period of scatter alone
    takes a share of its power as large as the most significant line. Assumed: the usual probability of a false alarm."""
    lines_hold: float = 0.5
    """Smallest ratio of the share of a drive's errors that several lines explain at commands that did not choose their periods
    to that at all commands. Between scatter, 0 or less, and a function of the command, 1: half. Study:
    tests/diagnosis/test_periodic_lines.py."""
    absurd: float = 15.0
    """Residual, in standard deviations of most poses (robust scale), beyond which a pose is an outlier even with heavy-tailed
    noise. Assumed."""
    least_cluster: int = 3
    """Smallest number of outliers in a cluster. Assumed: one or two can by chance."""
    cluster_chance: float = 1e-3
    """Probability that so many gross errors are in one interval by chance, below which they are used. Assumed: with four
    outliers in a hundred poses, four in an interval without another pose."""
    misfit: float = 1.8
    """Chi-square per degree of freedom below which the declared noise is accepted without a further check. Assumed: it only
    saves computing time."""
    understated: float = 1.5
    """Ratio of the noise that the data show to the declared noise, from which the declared value is not used. Assumed."""
    understated_once: float = 2.0
    """The same ratio, where there are too few repeated visits to measure the noise. Assumed."""

    # What must hold on left-out poses.
    silent: float = 1.25
    """Ratio of the error on left-out poses to the noise floor, above which the verdict becomes ``unknown``. Measured:
    examples/diagnosis/noise_floor.py."""
    excess: float = 1.2
    """Ratio of the residuals to the declared or repeated noise, above which the verdict becomes ``unknown``.
    Assumed: data sheets and calibrations state a sigma to some 20 %."""
    chance: float = 1e-3
    """P-value of the chi-square of the residuals. The limits above count only where it is not larger. Assumed: 1 in 1,000."""
    scatters: float = 0.5
    """Ratio of the repeatability to the instrument's sigma, from which part of the repeatability may be an effect. Assumed."""
    two_groups: float = 5.0
    """Ratio of the power of the residual with one instrument frame to that with two, from which the rows are taken for two
    measurements. Derived for the worst noise: 1 / (1 - 2/pi) = 2.75; assumed beyond that."""
    least_group: float = 0.1
    """Smallest share of the rows in the smaller of the two groups. Assumed."""
    implausible: float = 3.0
    """Standard deviations by which a parameter must be outside its plausible range before the cause is dropped. Derived: a
    chance of 1.3 in 1,000."""

    determined: float = 2.0
    """Ratio to its sigma that one root mean square of a cause must exceed: else its size is open, and the cause is not likely.
    Assumed: the usual two sigmas."""

    # What the unknown could be.
    seen: float = 1e-3
    """P-value below which a covariate that correlates with the unexplained gap is reported. Assumed."""
    accounts: float = 0.8
    """Share of the best smooth term's evidence from which an effect without its covariate could be the unknown effect.
    Assumed."""
    surely: float = 10.0
    """Smallest gain in log evidence, nats, of such an effect. Derived: odds of 20,000, more than there are hypotheses."""

    # Columns that can't be right.
    agree: float = 0.95
    """Share of the rows in motion in which direction of approach and speed agree where both are right. Assumed."""
    interleaved: int = 4
    """Ratio of the number of changes of session to the smallest possible number, above which the column ``session`` is not
    used. Assumed."""
    most_sessions: int = 30
    """Largest number of sessions with which the column ``session`` is used. Every site has separate coefficients for each
    session, so that the computing time increases with the third power of their number. Measured on an arm of six joints: 30
    sessions take 1.3 times as long as none, 110 take 25 times as long."""
    session_rows: float = 2.0
    """Smallest mean number of rows of a session. Derived: the shift of a session with one row is any error of that row."""
    fewest_moving: int = 8
    """Smallest number of rows for a comparison of two columns. Derived: by chance, eight signs all agree or all disagree in 1
    of 128 cases."""
    frozen: float = 0.2
    """Share of the rows, in a run of consecutive rows, for which a constant temperature is taken for a failed reading.
    Assumed."""
    distinct: float = 0.9
    """Smallest share of distinct values among the other rows for this check. With fewer, the constant value can come from the
    sensor's resolution. Assumed."""
    few_steps: float = 3.0
    """Ratio of the position error to the last digit of the commands, up to which rounding of the commands may cause the error.
    Assumed: rounding of three drives causes less."""

    # Checks against an earlier model.
    named_alarms: float = 0.8
    """Share of a check's permitted probability of a false alarm that is for named changes. The rest is for the chi-square of
    what they do not explain. Assumed: most changes are in the catalogue."""
    least_scatter: float = 3e-6
    """Smallest scatter of each drive that a check assumes, m; for a robot with turning joints and no rods, this over 0.1 m,
    rad. Assumed: a fit of 100 poses can't show a smaller one, and drives repeat to a few micrometres at best (the Gantry-Tau as
    a whole to 13 um)."""
    gross: float = 1e-4
    """P-value, over all poses of a check, below which a single pose is a gross error. Assumed: a hundredth of the usual chance
    of a false alarm."""
    gross_alone: float = 9.0
    """Ratio of such a pose's chi-square to the median of all poses, above which the pose is set aside: its residual is then
    three times as large as that of the others. Assumed: what all poses show is no gross error."""
    gross_share: float = 0.2
    """Largest share of a check's poses that are set aside. Assumed: with more, the measurement has to be repeated."""

    def temperature_of(self, evidence: float) -> float:
        """The temperature by which gains in log evidence are divided, for a term that gains ``evidence``, nats."""
        return self.temperature + self.warming * max(evidence, 0.0)


PRIORS = Priors()
"""The default values."""
