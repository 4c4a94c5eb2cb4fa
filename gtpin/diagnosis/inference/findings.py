"""What is found, as values without behaviour: causes with their classes, candidates, questions, what is left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gtpin.effects.untestable import Untestable
from gtpin.estimate import Estimate

Verdict = Literal["none", "explained", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Member:
    """An effect at a site that could be the cause; ``recorded`` is false where only a proxy of its covariate shows it."""

    effect: str
    site: str
    probability: float
    recorded: bool = True


@dataclass(frozen=True)
class Cause:
    """A cause, and everything that could be the cause in its place.

    Parameters
    ----------
    effect, site, probability
        The leader of its class.
    members
        Its class: itself and what has at least 5 % of its probability; also what can't be tested for lack of a covariate, as
        far as a proxy of it shows.
    parameters
        By name.
    shrinkage
        Explained fraction of the gap's power, given the other causes.
    """

    effect: str
    site: str
    probability: float
    members: tuple[Member, ...]
    parameters: dict[str, Estimate]
    shrinkage: float


@dataclass(frozen=True)
class Considered:
    """A hypothesis that was considered, and its evidence; what can't be tested has a probability where a proxy shows it.

    ``reason`` says why it can't be tested or, of what can be, why it could be the cause all the same; None where nothing
    does.
    """

    effect: str
    site: str
    log_evidence: float
    probability: float
    testable: bool
    reason: Untestable | None


@dataclass(frozen=True)
class Question:
    """A parameter outside what its effect calls plausible or usual.

    Parameters
    ----------
    effect, site, parameter, value, sigma, unit
        What it is, and what was found.
    low, high, why
        What was expected.
    believed
        Whether the cause is named all the same.
    """

    effect: str
    site: str
    parameter: str
    value: float
    sigma: float
    unit: str
    low: float
    high: float
    why: str
    believed: bool


@dataclass(frozen=True)
class Unexplained:
    """What is left after the causes.

    Parameters
    ----------
    share
        Of the excess of chi-square that geometry alone leaves.
    p_value
        Chance of a larger chi-square from noise alone.
    correlates
        Site, coordinates and p-value of smooth terms that correlate with it.
    could_be
        Effect and site of what can't be tested for lack of a covariate, and would account for what is unknown all the same.
    """

    share: float
    p_value: float
    correlates: tuple[tuple[str, str, float], ...]
    could_be: tuple[tuple[str, str], ...] = ()


Reason = Literal[
    "smooth_term", "restless", "impossible", "held_out", "two_groups", "two_valued", "scatter", "chi_square"
]
"""Why something unknown is inferred:

``smooth_term``
    Smooth nonparametric terms are likelier than the named causes alone (``named_causes.py``).
``restless``
    An actuator errs from pose to pose more than repeated visits let it scatter (``reestimate_noise.py``).
``impossible``
    A cause would need a parameter that physics does not allow (``questions.py``).
``held_out``
    Left-out poses are much farther off than noise (``held_out.py``), or no nearer with causes than without
    (``predictive.py``).
``two_groups``
    What passes for noise are two groups of rows (``two_groups.py``).
``two_valued``
    What passes for scatter of a drive takes two values (``two_valued.py``).
``scatter``
    Visits scatter, and the columns that would tell why contradict each other (``scatter.py``).
``chi_square``
    Poses of a check are farther from the earlier model than noise and its uncertainty allow (``gtpin/health/check.py``).
"""


@dataclass(frozen=True)
class Doubt:
    """A reason for which something unknown is inferred; ``site`` and ``over``, its coordinates, where they are known."""

    reason: Reason
    site: str = ""
    over: tuple[str, ...] = ()
