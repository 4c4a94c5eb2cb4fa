"""What can explain a gap: effects at their sites, smooth terms that belong to no effect, and proxies."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

import numpy as np

from gtpin.data.names import site_called
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.displacement import Displacement
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import Untestable
from gtpin.errors import GtpinError, ModelError
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

CLOCK = ("time", "session", "temp_frame", "temp_link")
"""Coordinates that change with time: an effect of one can look like an effect of another."""
LOAD = ("load", "force", "payload", "fx", "fy", "fz")
"""Coordinates that depend on forces."""


@dataclass(frozen=True)
class Hypothesis:
    """An effect at a site, with the value of its nonlinear parameter.

    ``effect``, ``site``: the effect, and the site at which it acts. ``shape_parameter``: value of the nonlinear parameter (a
    period, a place); None where the effect has none, or where it is not yet estimated. ``sigma``: standard deviation of
    ``shape_parameter``; hypotheses that differ only in it are equal. ``further``, ``further_sigma``: more values of the
    nonlinear parameter, each with separate coefficients, and their standard deviations: all periods (lines) of one gear are
    one hypothesis.
    """

    effect: Effect
    site: str
    shape_parameter: float | None = None
    sigma: float = field(default=0.0, compare=False)
    further: tuple[float, ...] = ()
    further_sigma: tuple[float, ...] = field(default=(), compare=False)

    @property
    def lines(self) -> tuple[tuple[float, float], ...]:
        """All values of its nonlinear parameter, each with its standard deviation."""
        return tuple(zip(self.values, (self.sigma, *self.further_sigma), strict=False))

    def with_lines(self, lines: Sequence[tuple[float, float]]) -> Hypothesis:
        """The hypothesis with other values, each with its standard deviation; of equal values the first counts."""
        kept: dict[float, float] = {}
        for value, sigma in lines:
            kept.setdefault(value, sigma)
        values, sigmas = tuple(kept), tuple(kept.values())
        return Hypothesis(self.effect, self.site, values[0], sigmas[0], values[1:], sigmas[1:])

    @property
    def values(self) -> tuple[float, ...]:
        """All values of its nonlinear parameter."""
        return () if self.shape_parameter is None else (self.shape_parameter, *self.further)

    @property
    def place(self) -> tuple[str, str]:
        """Id of the effect and site: the same for every value of the nonlinear parameter."""
        return self.effect.id, self.site

    @property
    def template(self) -> Hypothesis:
        """The hypothesis without a value of its nonlinear parameter."""
        return Hypothesis(self.effect, self.site)

    def __str__(self) -> str:
        """``effect@site``, as messages have it."""
        return f"{self.effect.id}@{self.site}"

    def basis(self, at: OperatingPoints) -> Displacement:
        """Displacements for unit coefficients."""
        return self.effect.basis_of(at, self.site, self.values)

    def checked(self, at: OperatingPoints) -> Displacement:
        """Displacements for unit coefficients, for the first value of its nonlinear parameter, checked.

        Raises `ModelError` if they can't be computed, are not finite, or do not have one size for each column.
        """
        try:
            basis = self.effect.basis(at, self.site, *list(self.effect.nonlinear_values(at, self.site))[:1])
            count, sizes, parts = len(basis), np.asarray(basis.sigma, dtype=float), basis.parts
        except GtpinError:
            raise
        except Exception as error:  # the code of a user may fail in any way
            what = f"the displacements of {self} can't be computed ({type(error).__name__}: {error})"
            raise ModelError(what, hint="correct its method basis") from error
        for name, part in parts.items():
            rows = (len(at), count) if name == "command" else (len(at), *part.shape[1:2], count)
            if part.shape != rows:
                what = f"{name} of {self} has the shape {part.shape}, not {rows}"
                raise ModelError(what, hint="a row for each pose, and a column for each typical size in sigma")
        if not (all(np.isfinite(part).all() for part in (sizes, *parts.values())) and (sizes >= 0.0).all()):
            what = f"{self} has displacements that are no finite numbers, or negative sizes"
            raise ModelError(what, hint="correct its method basis")
        return basis

    def covariates(self, robot: Chain) -> tuple[str, ...]:
        """Covariates that the effect needs at the site."""
        return self.effect.covariates(robot, self.site)

    def coordinates(self, robot: Chain) -> frozenset[str]:
        """Names of the covariates and commands that the effect depends on."""
        return frozenset(self.effect.coordinates(robot, self.site))

    def drivers(self, robot: Chain) -> frozenset[str]:
        """Covariates that the effect needs; where it needs none, its coordinates."""
        return frozenset(self.covariates(robot)) or self.coordinates(robot)

    def clock(self, robot: Chain) -> frozenset[str] | None:
        """What it depends on, where that is time alone or session alone: it then has no form of its own."""
        drivers = self.drivers(robot)
        return drivers if drivers in ({"time"}, {"session"}) else None


@dataclass(frozen=True)
class SmoothTerm:
    """A smooth nonparametric motion at a site, a function of some coordinates, that belongs to no effect.

    ``site``, ``over``: the site at which it acts, and the names of its coordinates. ``motion``: name of the kind of motion:
    ``along`` or across (``aside``) a track or a joint's axis, the ``length`` of a rod, the ``tip`` of a link, the pose
    (``twist``), ... Two terms at one site over the same coordinates have different motions.
    """

    site: str
    over: tuple[str, ...]
    motion: str

    @property
    def words(self) -> str:
        """Its coordinates, as reports name them."""
        return ",".join(self.over)

    def drivers(self, robot: Chain) -> frozenset[str]:
        """Its coordinates."""
        return frozenset(self.over)


def related(robot: Chain, a: Hypothesis | SmoothTerm, b: Hypothesis | SmoothTerm) -> bool:
    """Whether a deviation of one term from its equation could look like the other term.

    At the same place: where both depend on commands or load, or both on directions of approach or speeds, or both on
    coordinates that change with time. At different places: where both depend on coordinates that change with time, or both on
    forces.
    """
    mine, others = a.drivers(robot), b.drivers(robot)
    if same_place(robot, a, b):
        return bool({_kind(word) for word in mine} & {_kind(word) for word in others})
    return any(mine & set(kind) and others & set(kind) for kind in (CLOCK, LOAD))


def same_place(robot: Chain, a: Hypothesis | SmoothTerm, b: Hypothesis | SmoothTerm) -> bool:
    """Whether two terms act at one site, or one of them at a part of the other's site."""
    return a.site == b.site or b.site in _within(robot, a.site) or a.site in _within(robot, b.site)


def alike(robot: Chain, a: Hypothesis | SmoothTerm, b: Hypothesis | SmoothTerm) -> bool:
    """Whether one explanation could take up a part of the other: at one place, related, or one of them of a whole chain.

    All links, the platform and the frame move with the joints of a chain: what they do over commands, loads or positions, a
    joint or a link can do in part.
    """
    if same_place(robot, a, b) or related(robot, a, b):
        return True
    kinds = ({_kind(word) for word in one.drivers(robot)} for one in (a, b))
    chained = robot.joint_sites and {"arm", "frame", "platform"} & {a.site, b.site}
    return bool(chained and set.intersection(*kinds))


def _kind(word: str) -> str:
    """The kind of a coordinate: coordinates of one kind can look like each other."""
    if word in CLOCK:
        return "clock"
    return "moves" if word.startswith(("approach", "speed")) else "place"


def modulates(at: OperatingPoints, smooth: SmoothTerm, hypothesis: Hypothesis) -> bool:
    """Whether a smooth term is only a modulation of an effect: same site, same kind of motion, no further coordinates.

    An effect over one command alone has no modulation: a smooth function of this command is another function in its place.
    """
    robot, coordinates = at.robot, hypothesis.coordinates(at.robot)
    own = (f"q{robot.sites.index(smooth.site) + 1}",) if smooth.site in robot.sites else ()
    if smooth.site != hypothesis.site or coordinates == frozenset(own):
        return False
    basis = hypothesis.basis(at)
    ways = {
        "along": basis.command,
        "aside": basis.placements or None,
        "length": basis.length,
        "growth": basis.placements or None if basis.length is None else basis.length,
        "tip": basis.placements or None,
        "twist": basis.twist,
        "shift": basis.twist,
        "stretch": basis.twist,
    }
    # Links that grow with a sensor's temperature grow with time as well: the sensor is not in the link.
    late = CLOCK if smooth.motion == "growth" and coordinates & set(CLOCK) else ()
    return ways.get(smooth.motion) is not None and set(smooth.over) <= coordinates | set(late)


def _within(robot: Chain, site: str) -> tuple[str, ...]:
    """The sites that are parts of a site: the links of a cart or of ``arm``."""
    return tuple(robot.rod_sites[i] for i in robot.rods_at(site))


@dataclass(frozen=True)
class Scope:
    """Effects that a diagnosis may name.

    ``effects``: the effects; their ids are different. ``exclude``: effects that are not tried, each as ``effect`` (at all its
    sites) or ``effect@site``. ``false_alarm``: probability of naming a cause where there is none. ``priors``: the constants on
    which verdicts depend.
    """

    effects: tuple[Effect, ...]
    exclude: frozenset[str]
    false_alarm: float
    priors: Priors = PRIORS

    @staticmethod
    def of(
        effects: Iterable[Effect], exclude: Collection[str], false_alarm: float, robot: Chain, priors: Priors = PRIORS
    ) -> Scope:
        """The scope of a user's arguments, checked.

        Raises `ModelError` if two effects have the same id, or an excluded effect or site does not exist.
        """
        known = tuple(effects)
        for effect in known:
            if not isinstance(effect, Effect):
                raise ModelError(f"{effect!r} is no effect", hint="give objects of subclasses of Effect: MyEffect()")
            if missing := [name for name in ("id", "title", "coefficient") if not hasattr(effect, name)]:
                raise ModelError(f"the effect {type(effect).__name__} has no {missing[0]}", hint="set it in the class")
        by_id = {effect.id: effect for effect in known}
        for effect in known:
            if by_id[effect.id] is not effect:
                raise ModelError(f"two effects have the id {effect.id!r}", hint="give each an id of its own")
        excluded = set()
        for word in exclude:
            named, at, place = word.partition("@")
            if named not in by_id or (at and not place):
                raise ModelError(f"no effect is called {word!r}", hint=f"effects are {', '.join(by_id)}")
            place = site_called(place, by_id[named].sites(robot))
            excluded.add(named + at + place)
            if place and place not in by_id[named].sites(robot):
                sites = ", ".join(by_id[named].sites(robot))
                raise ModelError(f"no effect is called {word!r}", hint=f"sites of {named} are {sites}")
        return Scope(known, frozenset(excluded), false_alarm, priors)

    def place(self, word: str, robot: Chain) -> tuple[str, str]:
        """Effect and site of ``EFFECT@SITE``.

        Raises `ModelError` if there is no such effect or site, or it is excluded; the message names the nearest.
        """
        named, _, place = word.partition("@")
        known = {effect.id: tuple(dict.fromkeys(effect.sites(robot))) for effect in self.effects}
        site = site_called(place, known.get(named, ()))
        words = [f"{effect}@{one}" for effect in ([named] if known.get(named) else known) for one in known[effect]]
        if site not in known.get(named, ()):
            nearest = ", ".join(get_close_matches(word, words, 3, 0.0))
            hint = f"the nearest are {nearest}; the candidates in diagnosis.json are all of them"
            raise ModelError(f"no effect at a site is called {word!r}", hint=hint)
        if {named, f"{named}@{site}"} & self.exclude:
            raise ModelError(f"{word} is excluded", hint="do not exclude what is asked for")
        return named, site

    def hypotheses(self, robot: Chain) -> Iterator[Hypothesis]:
        """Every effect at each of its sites, each once, without those that are excluded."""
        for effect in self.effects:
            for site in dict.fromkeys(effect.sites(robot)):
                found = Hypothesis(effect, site)
                if effect.id not in self.exclude and str(found) not in self.exclude:
                    yield found


@dataclass(frozen=True, eq=False)
class Proxy:
    """A hypothesis with a proxy in the place of a covariate that was not recorded.

    ``columns``: (N c, m) whitened displacements, computed with the proxy. ``odds``: prior odds
    of the hypothesis relative to a testable one. ``reason``: for a hypothesis that the recorded columns can test: why it could
    be the cause although that test does not show it. None for an untestable one.
    """

    hypothesis: Hypothesis
    columns: Floats
    odds: float
    reason: Untestable | None = None


Term = Hypothesis | SmoothTerm | Proxy


def explained_by(term: Term) -> Hypothesis | SmoothTerm:
    """The hypothesis of a proxy; other terms unchanged."""
    return term.hypothesis if isinstance(term, Proxy) else term
