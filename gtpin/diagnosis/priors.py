"""Every number that moves a verdict, with its source.

A source is one of three. *Derived*: from a formula that is given. *Measured*: a script of ``examples/`` measures it again.
*Assumed*: a stated assumption. ``examples/diagnosis/priors.py`` measures how scores of sealed cases move when those that matter
are halved and doubled; docs/priors.md has the table. How far effects depart from their cores is a property of the effects:
``gtpin/effects/modulation.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

SURE = 0.95
"""Probability from which a cause stands alone. Fixed by what the verdicts mean to users."""
CLASS_SHARE = 0.05
"""Share of the leader's probability from which a hypothesis belongs to its class. Fixed likewise."""


@dataclass(frozen=True)
class Priors:
    """What is believed before the data are seen: ``gtpin.diagnose(data, priors=Priors(third=8.0))``."""

    # The size of an effect.
    scale_spread: float = 1.3
    """Standard deviation of the logarithm of an effect's size over its typical size. Assumed: most machines are within a factor
    of four of it."""
    least_core: float = 0.5
    """Root mean square of the core's coefficients over the scale, below which a scale serves the modulation alone. Assumed."""

    # Prior odds of explanations: natural logarithms, in nats, against them.
    unnamed: float = 5.0
    """Further odds against a smooth term: the catalogue lists what is common. Assumed, 1 to 150."""
    third: float = 4.0
    """Further odds against a third cause, and each more. Assumed, 1 to 55: so many at once are rare."""
    line: float = 4.0
    """Further odds against each further line of one periodic error. Assumed, 1 to 55: a gear that has one often has others."""
    same: float = 0.08
    """Share of a stronger cause's evidence that another at its site over its coordinates must bring, because causes depart from
    their cores. Measured: docs/priors.md."""
    related: float = 0.05
    """The same where the other could pass for the stronger one's departure. Measured: docs/priors.md."""
    other: float = 0.01
    """The same elsewhere. Measured: docs/priors.md."""
    departure: float = 0.025
    """Share of what smooth terms explain by which they must be ahead of named causes. Measured: docs/priors.md."""
    modulation: float = 0.06
    """The same where they are a named cause's own modulation. Measured: docs/priors.md."""

    # From evidence to probability.
    temperature: float = 2.0
    """What gains in log evidence are divided by before they become probabilities. Measured: docs/priors.md."""
    warming: float = 0.004
    """By how much more for each nat of evidence: departures from the core show the more, the better it is seen. Measured."""
    warmest: float = 6.0
    """What they are divided by at most. Measured."""

    # Proxies of covariates that were not recorded.
    not_recorded: float = 0.2
    """Prior odds of an effect whose covariate nobody recorded, over those of one that can be tested. Assumed."""
    not_varied: float = 0.05
    """The same for sessions where there was no pause, and payloads: a column that does not vary is often left out. Assumed."""
    likely_speed: float = 0.1
    """Speed, m/s or rad/s, where none was recorded. Assumed."""
    pause: float = 10.0
    """Times the usual interval between visits from which one is a pause, after which a session may begin. Assumed."""
    warmer: float = 5.0
    """By how much a machine warms up in use, K. Assumed."""
    payload: float = 10.0
    """A usual payload, kg. Assumed."""

    # Smooth nonparametric terms.
    smooth_shift: float = 4e-5
    """Size of shifts, m. Assumed: two to three times what good drives and guideways leave."""
    smooth_turn: float = 4e-5
    """Size of turns, rad. Assumed."""
    smooth_change: float = 0.4
    """Size of a slow change along a track, relative to what changes. Assumed."""

    smooth_reach: float = 1.7
    """Distance over which functions of the position go through half a wave, in half extents of the measured positions along the
    axis of the largest. Assumed."""

    # What can be tested.
    large: float = 10.0
    """Times its typical size, at which an effect that geometry absorbs nearly whole can't be tested. Assumed."""
    shows: float = 15.8
    """Whitened energy that an effect must keep given geometry. Derived: a matched filter's for 95 % at 1 % false alarms,
    (z_0.95 + z_0.99)^2, z the quantile of the normal distribution."""

    # Noise and outliers.
    disbelieved: float = 10.8
    """Twice the loss in log likelihood from which a repeatability is not believed. Derived: chi-square with one degree of
    freedom at a chance of 1 in 1,000."""
    restless: float = 6.0
    """Standard deviations by which an actuator must err more than noise before that is no noise. Assumed."""
    core_leaves: float = 0.15
    """Share of what is explained that cores leave at most. Assumed."""
    absurd: float = 15.0
    """Standard deviations of the bulk, beyond which a pose is an outlier whatever the tails. Assumed."""
    readmitted: int = 3
    """Outliers that a cause must explain before they are readmitted. Assumed: one or two can be explained by chance."""
    readmitted_share: float = 0.5
    """Share of the outliers that it must explain. Assumed."""
    readmitted_left: float = 0.25
    """Share of an outlier's squared error that may be left. Assumed."""
    misfit: float = 1.8
    """Chi-square per degree of freedom below which declared noise is not doubted. Assumed: it only saves a second look."""
    understated: float = 1.5
    """Noise that the data show over the declared one from which the declared value is not used. Assumed."""
    understated_once: float = 2.0
    """The same where there are too few repeated visits to show it. Assumed."""

    # What must hold on left-out poses.
    predicted: float = 0.2
    """Gain in log density of left-out poses over that in log evidence, below which a cause predicts nothing. Measured: 1.1 to
    1.3 for weak causes of eight machines; 0.4 of 9.5, 0.7 of 62 and -0.5 of 325 nats for a target offset in the place of a
    moved base."""
    silent: float = 1.25
    """Held-out error over the noise floor, from which nothing named is not enough. Measured:
    examples/diagnosis/noise_floor.py."""
    named: float = 2.0
    """The same where causes are named. Measured likewise."""
    chance: float = 1e-6
    """Chance of so large a chi-square from noise that must be undercut as well. Assumed."""
    scatters: float = 0.5
    """Repeatability over the instrument's sigma from which an effect may hide in it. Assumed."""
    two_groups: float = 5.0
    """Power that one frame leaves over that left by two, from which rows are of two measurements. Derived for the worst noise:
    1 / (1 - 2/pi) = 2.75; assumed beyond that."""
    two_valued: float = 0.05
    """Gain in log likelihood for each pose, by two values of a drive's errors over one, from which they are no scatter; 10 nats
    at least. Derived: two values three standard deviations apart give 0.08, a uniform distribution 0.1. Assumed beyond that."""
    two_valued_left: float = 0.5
    """Share of a drive's errors beyond the instrument's noise that its causes may leave before two values are a doubt.
    Assumed."""
    least_group: float = 0.1
    """Share of the rows that the smaller group has at least. Assumed."""
    implausible: float = 3.0
    """Standard deviations by which a parameter must lie outside its range. Derived: a chance of 1.3 in 1,000."""

    # What the unknown could be.
    seen: float = 1e-3
    """P-value below which a correlate of the unknown is reported. Assumed."""
    accounts: float = 0.8
    """Share of the best smooth term's evidence from which an effect without its covariate could be the unknown. Assumed."""
    surely: float = 10.0
    """Gain in log evidence that it must bring. Derived: odds of 20,000, more than there are hypotheses."""

    # Columns that can't be right.
    agree: float = 0.95
    """Share of the rows in motion in which direction of approach and speed agree where both are right. Assumed."""
    interleaved: int = 4
    """Times the least changes of session from which sessions are no stretches of work. Assumed."""
    fewest_moving: int = 8
    """Rows below which columns are not compared. Derived: so many agree by chance in 1 of 128."""
    frozen: float = 0.2
    """Share of the rows, one after the other, in which a temperature that stands still was not read. Assumed."""
    distinct: float = 0.9
    """Share of different values among the others from which steps of the thermometer are no reason. Assumed."""
    few_steps: float = 3.0
    """Position error over the commands' last digit, up to which rounding may be its reason. Assumed: rounding of three drives
    makes less."""


PRIORS = Priors()
"""The default."""
